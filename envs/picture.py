"""What a robot looks like: a model with shapes to see, put where a simulation's robot is."""

from __future__ import annotations

import mujoco
import torch

from .quadruped_env import QuadrupedEnv
from .scene import build_scene

__all__ = ["Picture"]


class Picture:
    """A robot to be drawn. The model that is stepped has the shapes that collide and no others."""

    def __init__(self, env: QuadrupedEnv) -> None:
        """Compile the model of an environment's scene, with its looks.

        Raises:
            SceneError: The look needs a package or meshes that are not there.
        """
        self.model = build_scene(env.cfg.scene)
        """The model; its positions are those of the environment's."""
        self.data = mujoco.MjData(self.model)
        """Its state."""

    def show(self, qpos: torch.Tensor) -> None:
        """Take on a robot's positions. Shape: (nq,)."""
        self.data.qpos[:] = qpos.numpy(force=True)
        mujoco.mj_forward(self.model, self.data)
