"""Pictures of one robot of a batch."""

from __future__ import annotations

import mujoco
import numpy as np

from .quadruped_env import QuadrupedEnv
from .scene import build_scene

__all__ = ["Camera"]


class Camera:
    """Takes pictures from beside a robot; needs OpenGL from the first one on."""

    def __init__(self, width: int, height: int) -> None:
        """Choose the size of a picture, pixels."""
        self._size = (height, width)
        self._model: mujoco.MjModel | None = None
        self._renderer: mujoco.Renderer | None = None

    def frame(self, env: QuadrupedEnv, index: int) -> np.ndarray:
        """Return a picture of one robot, uint8. Shape: (height, width, 3)."""
        # Every seed has a model of its own, but all look the same.
        model = self._model or build_scene(env.cfg.scene)
        renderer = self._renderer or mujoco.Renderer(model, *self._size)
        self._model, self._renderer = model, renderer
        data = mujoco.MjData(model)
        data.qpos[:] = env.simulation.qpos[index].numpy()
        mujoco.mj_forward(model, data)
        camera = mujoco.MjvCamera()
        camera.lookat[:] = data.qpos[:3]
        camera.distance, camera.azimuth, camera.elevation = 1.5, 130.0, -15.0
        renderer.update_scene(data, camera)
        return renderer.render().copy()

    def close(self) -> None:
        """Release the OpenGL context."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None
