"""When which foot is on the ground: a trot, which starts, goes on and ends by what is asked for."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["TrotClock"]

Array = NDArray[np.floating]

_SWINGS_FIRST = np.array([True, False, False, True])
"""Of the legs FR, FL, RR, RL: one diagonal swings in the first half of a cycle."""


class TrotClock:
    """Each robot's place in the cycle of a trot, or its stand."""

    def __init__(self, num_envs: int, period: float) -> None:
        """Let all robots stand.

        Args:
            num_envs: Number of robots.
            period: Time of a cycle, s.
        """
        self.period = period
        self.walks = np.zeros(num_envs, dtype=bool)
        """Which robots step; the others stand. Shape: (num_envs,)."""
        self.place = np.zeros(num_envs)
        """Share of the cycle that has passed, from 0 to 1. Shape: (num_envs,)."""

    @property
    def swing_time(self) -> float:
        """Time that a foot is in the air, and time that it is on the ground, s."""
        return 0.5 * self.period

    def reset(self, robots: NDArray[np.bool_]) -> None:
        """Let some robots stand. Shape: (num_envs,)."""
        self.walks[robots] = False
        self.place[robots] = 0.0

    def advance(self, time: float, wanted: NDArray[np.bool_]) -> None:
        """Go on by a control step.

        Who stands and wants to walk begins at once; who walks and does not want to any more stands
        as soon as the feet in the air have landed.

        Args:
            time: Control period, s; not longer than a swing.
            wanted: Which robots are to walk. Shape: (num_envs,).
        """
        before = self.place
        after = _rounded(before + time / self.period)
        # A step is done where half of the cycle, or all of it, is passed.
        done = (np.floor(2.0 * after) > np.floor(2.0 * before)) & self.walks
        starts = wanted & ~self.walks
        stays = self.walks & ~(done & ~wanted)
        self.place = np.where(stays, after % 1.0, 0.0)
        self.walks = starts | stays

    def stance(self, ahead: Array) -> NDArray[np.bool_]:
        """Return which feet are to be on the ground some time ahead.

        Args:
            ahead: Times from now, s. Shape: (times,).

        Returns:
            Shape: (num_envs, times, 4).
        """
        place = _rounded(self.place[:, None] + ahead / self.period) % 1.0
        swings = (place < 0.5)[..., None] == _SWINGS_FIRST
        return ~(swings & self.walks[:, None, None])

    def remaining(self) -> Array:
        """Return the time until the feet in the air land, and the others lift, s. (num_envs,)."""
        return self.swing_time * (1.0 - 2.0 * (self.place % 0.5))

    def progress(self, ahead: Array) -> Array:
        """Return how much of its half of the cycle has passed for every robot some time ahead.

        Beyond 1 it has gone on to the next. Shape: (num_envs, times).
        """
        return 2.0 * (self.place % 0.5)[:, None] + ahead / self.swing_time


def _rounded(place: Array) -> Array:
    """Return places so that what should be a half is one, however many steps led to it."""
    halves = np.round(2.0 * place) / 2.0
    return np.where(np.abs(place - halves) < _NOT_MEANT, halves, place)


_NOT_MEANT = 1e-9
"""Share of a cycle that is no time, but rounding."""
