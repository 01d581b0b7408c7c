"""Pictures of one robot of a batch."""

from __future__ import annotations

import mujoco
import numpy as np

from .picture import Picture
from .quadruped_env import QuadrupedEnv

__all__ = ["Camera"]


class Camera:
    """Takes pictures from beside a robot; needs OpenGL from the first one on."""

    def __init__(self, width: int, height: int) -> None:
        """Choose the size of a picture, pixels."""
        self._size = (height, width)
        self._picture: Picture | None = None
        self._renderer: mujoco.Renderer | None = None

    def frame(self, env: QuadrupedEnv, index: int) -> np.ndarray:
        """Return a picture of one robot, uint8. Shape: (height, width, 3)."""
        # Every seed has a model of its own, but all look the same.
        picture = self._picture or Picture(env)
        renderer = self._renderer or mujoco.Renderer(picture.model, *self._size)
        self._picture, self._renderer = picture, renderer
        picture.show(index)
        camera = mujoco.MjvCamera()
        camera.lookat[:] = picture.data.qpos[:3]
        camera.distance, camera.azimuth, camera.elevation = 1.5, 130.0, -15.0
        renderer.update_scene(picture.data, camera)
        return renderer.render().copy()

    def close(self) -> None:
        """Release the OpenGL context."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None
