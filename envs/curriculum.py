"""What grows or fades with the time trained so far."""

from __future__ import annotations

from typing import NamedTuple

from .quadruped_env_cfg import QuadrupedEnvCfg

__all__ = ["Curriculum", "curriculum", "ramp"]


class Curriculum(NamedTuple):
    """Factors in [0, 1]."""

    quiet: float
    """On the phase rewards."""
    lift: float
    """On the rewards that hold the feet up."""
    guide: float
    """On the rewards that lead to a first walk."""
    commands: float
    """On the range of the commands."""


def curriculum(cfg: QuadrupedEnvCfg, step_count: int) -> Curriculum:
    """Return the factors after a number of control steps.

    Args:
        cfg: The task, whose ramps give the seconds between which a factor grows.
        step_count: Control steps trained so far.
    """
    elapsed = step_count * cfg.step_dt
    return Curriculum(
        quiet=ramp(elapsed, cfg.rewards.quiet_ramp),
        lift=ramp(elapsed, cfg.rewards.lift_ramp),
        guide=1.0 - ramp(elapsed, cfg.rewards.guide_ramp),
        commands=ramp(elapsed, cfg.commands.ramp),
    )


def ramp(elapsed: float, bounds: tuple[float, float]) -> float:
    """Return the share, in [0, 1], of a rise in a straight line that has passed.

    Args:
        elapsed: How far it is.
        bounds: Where the rise begins and where it is over; where they are one, at once.
    """
    start, end = bounds
    if elapsed >= end:
        return 1.0
    return max(0.0, (elapsed - start) / (end - start))
