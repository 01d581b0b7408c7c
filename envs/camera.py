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
        if self._model is None or self._renderer is None:
            self._model = build_scene(env.cfg.scene)
            self._renderer = mujoco.Renderer(self._model, *self._size)
        data = mujoco.MjData(self._model)
        data.qpos[:] = env.simulation.qpos[index].numpy()
        mujoco.mj_forward(self._model, data)
        camera = mujoco.MjvCamera()
        camera.lookat[:] = data.qpos[:3]
        camera.distance, camera.azimuth, camera.elevation = 1.5, 130.0, -15.0
        self._renderer.update_scene(data, camera)
        return self._renderer.render().copy()

    def close(self) -> None:
        """Release the OpenGL context."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None
