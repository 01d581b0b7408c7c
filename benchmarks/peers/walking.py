"""How a peer's policy walks, in the two figures by which MUTE says whether a policy walks.

They are those of `mute.evaluation.gait`: commands that stay as they were drawn, the first second of
an episode not measured, and the horizontal velocity in the robot's frame.
"""

from __future__ import annotations

import numpy as np

__all__ = ["WalkMeter"]

_SETTLE_SECONDS = 1.0
"""Time after the start of an episode that is not measured, s."""


class WalkMeter:
    """Adds up what robots do, step by step."""

    def __init__(self, num_envs: int, step_dt: float) -> None:
        """Start at zero.

        Args:
            num_envs: Number of robots.
            step_dt: Duration of a control step, s.
        """
        self._settle_steps = round(_SETTLE_SECONDS / step_dt)
        self._age = np.zeros(num_envs, dtype=np.int64)
        self._fallen = np.zeros(num_envs, dtype=bool)
        self._squares, self._steps = 0.0, 0

    def update(self, command: np.ndarray, velocity: np.ndarray, fallen: np.ndarray) -> None:
        """Take in a control step.

        Args:
            command: Commanded velocity, m/s; what follows the first two is not read.
                Shape: (num_envs, 2 or more).
            velocity: Velocity in the robot's frame, m/s, likewise. Shape: (num_envs, 2 or more).
            fallen: Robots that fell in it, whose state is a new episode's. Shape: (num_envs,).
        """
        self._age += 1
        measured = (self._age > self._settle_steps) & ~fallen
        error = np.square(command[measured, :2] - velocity[measured, :2]).sum(axis=1)
        self._squares += float(error.sum())
        self._steps += int(measured.sum())
        self._fallen |= fallen
        self._age[fallen] = 0

    def figures(self) -> tuple[float, float]:
        """Return the mean squared velocity error, (m/s)^2, NaN if none, and the share of falls."""
        error = self._squares / self._steps if self._steps else float("nan")
        return error, float(self._fallen.mean())
