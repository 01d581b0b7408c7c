"""How a robot stands: its motors hold the joints, while the trunk moves over the feet and stays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mute.envs.scene import FOOT_RADIUS, LEGS

from .body import Body
from .legs import foot_positions, joints_of_feet
from .motors import JointTargets
from .senses import Moment
from .settings import MpcCfg
from .turning import about_vertical, into, turned

__all__ = ["Stand"]

Array = NDArray[np.floating]


class Stand:
    """Where each robot that stands holds its joints."""

    def __init__(self, body: Body, cfg: MpcCfg, num_envs: int) -> None:
        """Let nobody stand yet."""
        self._body, self._cfg = body, cfg
        shape = (num_envs, len(LEGS), 3)
        self._from, self._to = np.zeros(shape), np.zeros(shape)
        self._forces = np.zeros(shape)
        self._time = np.full(num_envs, np.nan)

    def reset(self, robots: NDArray[np.bool_]) -> None:
        """Forget where some robots stood. Shape: (num_envs,)."""
        self._time[robots] = np.nan
        self._forces[robots] = 0.0

    def update(self, now: Moment, walks: NDArray[np.bool_], forces: Array, step_dt: float) -> Array:
        """Go on by a control step, and return the forces to push with, world, N.

        Args:
            now: What is known of the robots.
            walks: Which of them walk. Shape: (n,).
            forces: What is planned. Shape: (n, 4, 3).
            step_dt: Control period, s.

        Returns:
            What is planned, evened out where robots stand. Shape: (n, 4, 3).
        """
        begins = ~walks & np.isnan(self._time)
        self._from[begins] = now.joint_pos[begins]
        self._time = np.where(walks, np.nan, np.where(begins, 0.0, self._time + step_dt))
        settles = self._time < self._cfg.settling_time
        if settles.any():
            # The mean of what is seen on the way there: one look at it is off by some degrees.
            count = np.round(self._time[settles] / step_dt) + 1.0
            seen = self._over_feet(now)[settles] - self._to[settles]
            self._to[settles] += seen / count[:, None, None]
        share = np.where(walks | begins, 1.0, step_dt / self._cfg.force_time)[:, None, None]
        self._forces += share * (forces - self._forces)
        return self._forces.copy()

    def targets(self, pushing: JointTargets, ahead: Array) -> JointTargets:
        """Return what the legs of robots that stand are to do: hold their joints, and push.

        Args:
            pushing: What they would do otherwise, whose torques hold the trunk up.
            ahead: Times from now, s. Shape: (steps,).
        """
        settling = self._cfg.settling_time
        progress = np.clip((self._time[:, None] + ahead) / settling, 0.0, 1.0)
        share = (0.5 - 0.5 * np.cos(np.pi * progress))[..., None, None]
        rate = (0.5 * np.pi / settling * np.sin(np.pi * progress))[..., None, None]
        way = (self._to - self._from)[:, None]
        return JointTargets(pushing.torque, self._from[:, None] + share * way, rate * way)

    def _over_feet(self, now: Moment) -> Array:
        """Return the joint positions of a level trunk over the middle of the feet. (n, 4, 3)."""
        legs = turned(now.turn, foot_positions(now.joint_pos))
        middle = legs.mean(axis=1, keepdims=True)
        heading = about_vertical(now.yaw)
        level = into(heading, legs - middle)
        level -= (*-self._body.com[:2], self._cfg.base_height - FOOT_RADIUS)
        return joints_of_feet(level)
