"""The parts of the exam: what each measures, and how much work it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from mute.controllers.driver import Driver
from mute.evaluation.reliability.beta_acts import beta_acts_work, measure_beta_acts
from mute.evaluation.reliability.conditions import OnWork
from mute.evaluation.reliability.falls import falls_work, measure_falls
from mute.evaluation.reliability.figures import PartResult
from mute.evaluation.reliability.follows import follows_work, measure_follows
from mute.evaluation.reliability.stands import measure_stands, stands_work
from mute.evaluation.reliability.starts import measure_starts, starts_work

__all__ = ["PARTS", "Part"]


@dataclass(frozen=True)
class Part:
    """One part of the exam."""

    measure: Callable[[Driver, int, int, OnWork], PartResult]
    """Measures a policy `under_conditions` with a number of robots and a seed; tells its work."""
    work: Callable[[int], float]
    """Work with that many robots, s."""
    heard: bool = False
    """Whether it needs a policy that can be heard."""


PARTS = {
    "starts": Part(measure_starts, starts_work),
    "follows": Part(measure_follows, follows_work),
    "stands": Part(measure_stands, stands_work, heard=True),
    "beta": Part(measure_beta_acts, beta_acts_work, heard=True),
    "falls": Part(measure_falls, falls_work),
}
"""Parts by name, in the order in which they are measured."""
