"""What a peer is made of: facts about it, and the parts that are timed."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

__all__ = ["ACTION_SETS", "TARGET_NOISE", "Facts", "Loop", "Parts", "timed_loop"]

ACTION_SETS = 24
"""Random actions that are drawn beforehand, and then taken in turns."""

TARGET_NOISE = 0.1
"""Standard deviation of the joints' targets about the standing pose, rad."""

Loop = Callable[[], tuple[int, float]]
"""An iteration of training; returns its control steps, environments times steps, and seconds."""


@dataclass(frozen=True)
class Facts:
    """What is stepped; plain data that goes into the report."""

    engine: str
    """Engine and its version."""
    robot: str
    """Name of the robot."""
    task: str
    """Name of the task."""
    num_envs: int
    """Robots that are stepped at once."""
    physics_step: float
    """Duration of a physics step, s."""
    decimation: int
    """Physics steps of a control step."""
    note: str
    """What else should be known to judge the figures."""


@dataclass(frozen=True)
class Parts:
    """A peer that is ready."""

    facts: Facts
    """What it steps."""
    environment: Callable[[], None]
    """A control step of all robots."""
    loop: Loop | None = None
    """Its own training loop; None if it has none."""
    walk: Callable[[int, float], tuple[float, float]] | None = None
    """Lets the policy of the loop walk a number of robots for some seconds, without noise on its
    actions; returns the mean squared velocity error, (m/s)^2, and the share of them that fell."""


def timed_loop(iteration: Callable[[], None], steps: int) -> Loop:
    """Return an iteration of training with the time that it takes.

    Args:
        iteration: Trains for one iteration.
        steps: Control steps of an iteration, environments times steps.
    """

    def run() -> tuple[int, float]:
        start = time.perf_counter()
        iteration()
        return steps, time.perf_counter() - start

    return run
