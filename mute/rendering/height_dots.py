"""The height map as dots in a picture: what is there, and what the policy takes it for."""

from __future__ import annotations

import mujoco
import numpy as np
import torch
from numpy.typing import NDArray

from mute.controllers.controller import Controller
from mute.envs.quadruped_env import QuadrupedEnv

__all__ = ["HeightDots"]

_TRUE = np.array([0.1, 0.7, 0.2, 1.0], dtype=np.float32)
_ESTIMATED = np.array([1.0, 0.45, 0.0, 1.0], dtype=np.float32)
_RADIUS = 0.009
"""Of a dot, m."""


class HeightDots:
    """Green dots where the ground is, orange ones where a robot's estimator takes it to be."""

    def __init__(self, env: QuadrupedEnv, controller: Controller, robot: int = 0) -> None:
        """Look at one robot.

        Args:
            env: Where it walks.
            controller: What drives it; one that estimates no heights has no orange dots.
            robot: Its index.
        """
        self._env, self._robot = env, robot
        self.controller = controller
        """What drives it."""

    def add_to(self, scene: mujoco.MjvScene) -> None:
        """Add the dots to what is to be drawn, as far as the scene has room."""
        for places, colour in self._dots():
            for place in places:
                if scene.ngeom >= scene.maxgeom:
                    return
                mujoco.mjv_initGeom(
                    scene.geoms[scene.ngeom],
                    int(mujoco.mjtGeom.mjGEOM_SPHERE),
                    np.full(3, _RADIUS),
                    place,
                    np.eye(3).ravel(),
                    colour,
                )
                scene.ngeom += 1

    def points(self) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
        """Return the places of all dots in the world, m, and their colours, from 0 to 1.

        Shapes: (dots, 3) each.
        """
        places, colours = zip(*self._dots(), strict=True)
        counts = [len(each) for each in places]
        return np.concatenate(places), np.repeat(np.stack(colours)[:, :3], counts, axis=0)

    def _dots(self) -> list[tuple[NDArray[np.float64], NDArray[np.float32]]]:
        """Return the places of the dots, and their colours."""
        env, robot = self._env, self._robot
        true = env.ground.height_map(env.grid, env.base_pos, env.heading)[robot]
        dots = [(self._places(true), _TRUE)]
        estimate = getattr(self.controller, "estimate", None)
        if estimate is not None and estimate.heights.shape[1]:
            dots.append((self._places(estimate.heights[robot]), _ESTIMATED))
        return dots

    def _places(self, below: torch.Tensor) -> NDArray[np.float64]:
        """Return points of the grid in the world, given how far below the trunk they are, m."""
        env, robot = self._env, self._robot
        ahead = env.heading[robot]
        left = torch.stack((-ahead[1], ahead[0]))
        xy = env.base_pos[robot, :2] + env.grid[:, :1] * ahead + env.grid[:, 1:] * left
        places = torch.cat((xy, (env.base_pos[robot, 2] - below)[:, None]), dim=1)
        return places.double().numpy(force=True)
