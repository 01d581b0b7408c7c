"""What a robot looks like: a model with shapes to see, put where a simulation's robot is."""

from __future__ import annotations

import dataclasses

import mujoco
import torch

from .quadruped_env import QuadrupedEnv
from .scene import GROUND_BOX, build_scene
from .terrain import BoxGround, num_boxes
from .terrain.figures import TREAD

__all__ = ["Picture"]


class Picture:
    """A robot to be drawn, and the ground around it.

    The model that is stepped has the shapes that collide and no others, and ground as far as the
    robot reaches.
    """

    def __init__(self, env: QuadrupedEnv) -> None:
        """Compile the model of an environment's scene, with its looks.

        Raises:
            SceneError: The look needs a package or meshes that are not there.
        """
        self._env = env
        count = num_boxes(env.cfg.terrain.shares, drawn=True)
        self.model = build_scene(dataclasses.replace(env.cfg.scene, ground_boxes=count))
        """The model; its positions are those of the environment's."""
        self.data = mujoco.MjData(self.model)
        """Its state."""
        self.ground_boxes = [self.model.geom(GROUND_BOX.format(index)).id for index in range(count)]
        """Shapes of the model whose tops are the ground; none on a flat one."""
        self._laid: tuple[object, ...] = ()

    def show(self, robot: int) -> bool:
        """Take on the positions of one of the robots, and its ground.

        Returns:
            Whether the ground lies otherwise than before.
        """
        qpos = self._env.simulation.qpos[robot]
        laid = self._lay(robot, qpos[:2])
        self.data.qpos[:] = qpos.numpy(force=True)
        mujoco.mj_forward(self.model, self.data)
        return laid

    def _lay(self, robot: int, xy: torch.Tensor) -> bool:
        """Lay what is seen of the ground, unless it lies there; return whether it did not."""
        ground = self._env.ground
        if not isinstance(ground, BoxGround):
            return False
        cell = torch.floor(xy / TREAD).tolist()
        place = (robot, int(ground.level[robot]), int(ground.key[robot]), *cell)
        if place == self._laid:
            return False
        self._laid = place
        laid, base = ground.drawn(robot, xy)
        model, boxes = self.model, self.ground_boxes[: laid.pos.shape[1]]
        model.geom_pos[self.ground_boxes, 2] = base - 100.0  # what another kind of ground left
        model.geom_pos[model.geom("floor").id, 2] = base
        model.geom_pos[boxes] = laid.pos[0]
        model.geom_size[boxes] = laid.half[0]
        model.geom_rbound[boxes] = laid.half[0].norm(dim=1)
        model.geom_quat[boxes] = 0.0
        model.geom_quat[boxes, 0] = torch.cos(0.5 * laid.pitch[0])
        model.geom_quat[boxes, 2] = torch.sin(0.5 * laid.pitch[0])
        return True
