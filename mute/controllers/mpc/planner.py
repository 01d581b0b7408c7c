"""What the forces are asked for: a body that follows its command, over the feet as they will be."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mute.envs.scene import FOOT_RADIUS

from .body import Body
from .footholds import footholds
from .forces import ForceProgram, Outlook
from .gait import TrotClock
from .senses import Moment
from .settings import MpcCfg
from .turning import about_vertical, along_curve, cross, into, turned, wrapped

__all__ = ["ForcePlanner"]

Array = NDArray[np.floating]

_LEVEL = (1.0, 1.0, 0.0)
"""What keeps of a vector what is level."""


class ForcePlanner:
    """Plans the forces on the feet; remembers where each robot should be by now."""

    def __init__(self, body: Body, cfg: MpcCfg, num_envs: int) -> None:
        """Start with no past."""
        self._body, self._cfg = body, cfg
        self._program = ForceProgram(body, cfg)
        self._goal = np.zeros((num_envs, 3))
        self._fresh = np.ones(num_envs, dtype=bool)
        self._ends = cfg.horizon_step * np.arange(1, cfg.horizon + 1)
        self._middles = self._ends - 0.5 * cfg.horizon_step

    def reset(self, robots: NDArray[np.bool_]) -> None:
        """Forget the past of some robots. Shape: (num_envs,)."""
        self._fresh |= robots

    def forces(
        self,
        now: Moment,
        clock: TrotClock,
        stance: NDArray[np.bool_],
        ground: Array,
        landing: Array,
        step_dt: float,
    ) -> Array:
        """Return the forces of the ground on the feet until the next control step, N, world.

        Args:
            now: What is known of n robots.
            clock: Their gait.
            stance: Which feet are to be on the ground. Shape: (n, 4).
            ground: Height of their centres, m. Shape: (n,).
            landing: Where the others land, m. Shape: (n, 4, 3).
            step_dt: Control period, s.

        Returns:
            Shape: (n, 4, 3).
        """
        arm = turned(now.turn, np.broadcast_to(self._body.com, now.place.shape))
        com, velocity = now.place + arm, now.velocity + cross(now.ang_vel, arm)
        self._lead(now, com, clock, step_dt)
        heading = about_vertical(now.yaw)
        turn = heading.transpose(0, 2, 1) @ now.turn
        planned = clock.stance(self._middles)
        planned[:, 0] = stance
        arms = self._arms(now, com, clock, stance, ground, landing)
        rise = self._cfg.base_height - FOOT_RADIUS
        path = self._curve(now.command * _LEVEL, now, self._ends)
        outlook = Outlook(
            pose=_pose(turn),
            velocity=np.concatenate((into(heading, now.ang_vel), into(heading, velocity)), axis=1),
            pose_wanted=self._wanted(now, com, heading, ground + rise + arm[:, 2], path[0]),
            velocity_wanted=self._rates(now, path[1]),
            feet=into(heading, arms),
            stance=planned,
            turn=turn,
        )
        return turned(heading, self._program.solve(outlook))

    def _lead(self, now: Moment, com: Array, clock: TrotClock, step_dt: float) -> None:
        """Move the goal on by the command, no farther ahead than it may be."""
        goal, fresh, most = self._goal, self._fresh, self._cfg.max_lead
        goal[fresh] = np.concatenate((com[fresh, :2], now.yaw[fresh, None]), axis=1)
        self._fresh = np.zeros_like(fresh)
        goal[:, :2] += step_dt * now.asked[:, :2]
        goal[:, 2] += step_dt * now.command[:, 2]
        # Who stands does so over its feet.
        middle = now.feet.mean(axis=1)[:, :2]
        goal[:, :2] = np.where(clock.walks[:, None], goal[:, :2], middle)
        goal[:, :2] = com[:, :2] + np.clip(goal[:, :2] - com[:, :2], -most, most)
        goal[:, 2] = now.yaw + np.clip(wrapped(goal[:, 2] - now.yaw), -most, most)

    def _wanted(self, now: Moment, com: Array, heading: Array, height: Array, way: Array) -> Array:
        """Return the pose at the end of each step, in the heading frame. Shape: (n, N, 6)."""
        wanted = np.zeros((len(com), len(self._ends), 6))
        wanted[..., 2] = (self._goal[:, 2] - now.yaw)[:, None] + now.command[:, 2:] * self._ends
        there = np.zeros_like(com)
        there[:, :2] = self._goal[:, :2] - com[:, :2]
        wanted[..., 3:] = into(heading, there)[:, None] + way
        wanted[..., 5] = (height - com[:, 2])[:, None]
        return wanted

    def _rates(self, now: Moment, velocity: Array) -> Array:
        """Return the velocities at the end of each step, likewise. Shape: (n, N, 6)."""
        rates = np.zeros((len(now.command), len(self._ends), 6))
        rates[..., 2] = now.command[:, 2:]
        rates[..., 3:] = velocity
        return rates

    def _curve(self, velocity: Array, now: Moment, times: Array) -> tuple[Array, Array]:
        """Return the way and the velocity of a robot that turns as it is asked to."""
        each = np.broadcast_to(times, (len(velocity), len(times)))
        return along_curve(velocity, now.command[:, 2], each)

    def _arms(
        self,
        now: Moment,
        com: Array,
        clock: TrotClock,
        stance: NDArray[np.bool_],
        ground: Array,
        landing: Array,
    ) -> Array:
        """Return from the centre of mass to each foot in the middle of each step, m, world.

        A foot that has not lifted by then is where it is; another where it will land.
        """
        lands = clock.remaining()
        later = footholds(now, self._body, self._cfg, lands + clock.swing_time, ground)
        lifted = clock.walks[:, None] & (self._middles > lands[:, None])
        landed = np.where(lifted[:, :, None, None], later[:, None], now.feet[:, None])
        feet = np.where(stance[:, None, :, None], landed, landing[:, None])
        path = com[:, None] + self._curve(now.asked, now, self._middles)[0]
        return feet - path[:, :, None]


def _pose(turn: Array) -> Array:
    """Return roll and pitch, and zeros for what is counted from here. Shape: (n, 6)."""
    pose = np.zeros((len(turn), 6))
    pose[:, 0] = np.arctan2(turn[:, 2, 1], turn[:, 2, 2])
    pose[:, 1] = -np.arcsin(np.clip(turn[:, 2, 0], -1.0, 1.0))
    return pose
