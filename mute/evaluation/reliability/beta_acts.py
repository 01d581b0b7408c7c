"""Whether beta acts: landings, lift and level at one actual speed, for several betas."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import torch

from mute.controllers.driver import Driver
from mute.evaluation.gait import GaitMeter
from mute.evaluation.matched_speed import figures_at_speed, level_at_speed
from mute.evaluation.noise_levels import SETTLE_TIME, NoiseSetting, measure_noise
from mute.evaluation.reliability.conditions import (
    SOUND_WORK,
    OnWork,
    dealt,
    make_env,
    walk,
)
from mute.evaluation.reliability.figures import Figure, PartResult, Target
from mute.evaluation.usual_robots import robots_cfg

__all__ = ["beta_acts_work", "beta_figures", "measure_beta_acts"]

BETAS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Quiet factors that are compared, from the loudest to the quietest."""

_DROPS = {0.3: 0.25, 0.5: 0.35, 0.8: 0.25}
"""Actual speeds at which they are, m/s, and by what share landings must be slower at beta 1."""
_COMMANDS = (0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.3)
"""Commanded speeds, m/s: a high beta walks slower than it is asked to, so they go beyond."""
_WALK_TIME = 5.0
_APEX = 0.03
"""Lowest lift of the feet at any beta, m."""
_SURFACE = "wood"
_HEARD_SPEED = 0.5
"""Actual speed at which levels are compared, m/s."""
_HEARD_COMMANDS = (0.4, 0.5, 0.6, 0.7, 0.9)
_HEARD_TIME = 4.0
_LEVEL_DROP = 4.0
"""By how much the mean noise level must be lower at beta 1, dB."""


def measure_beta_acts(policy: Driver, robots: int, seed: int, on_work: OnWork) -> PartResult:
    """Measure what beta changes at equal actual speeds.

    Args:
        policy: What walks.
        robots: A sixteenth of them for each beta and commanded speed; half as many are heard.
        seed: Of physics, first states and noise.
        on_work: Is told of the work that is done.
    """
    at_speeds = _at_speeds(policy, _each(robots), seed, on_work)
    levels = _levels(policy, _heard(robots), seed, on_work)
    figures = [
        figure
        for speed in _DROPS
        for figure in beta_figures(speed, [row for row in at_speeds if row["speed"] == speed])
    ]
    drop = levels[0]["mnl"] - levels[-1]["mnl"]
    name = f"level on {_SURFACE} at {_HEARD_SPEED:g} m/s lower at beta 1"
    figures.append(Figure("beta", name, drop, "dBA", Target(at_least=_LEVEL_DROP)))
    return PartResult(figures, {"beta": at_speeds, "beta_levels": levels})


def beta_acts_work(robots: int) -> float:
    """Return the work of `measure_beta_acts`, s."""
    seen = len(BETAS) * len(_COMMANDS) * _each(robots) * _WALK_TIME
    heard = 2 * len(_HEARD_COMMANDS) * _heard(robots) * (_HEARD_TIME + SETTLE_TIME)
    return seen + SOUND_WORK * heard


def beta_figures(speed: float, rows: Sequence[dict[str, Any]]) -> list[Figure]:
    """Return what is judged at one actual speed.

    Args:
        speed: The speed, m/s.
        rows: `landing_speed_rms` and `apex_mean` of each beta, from the loudest to the quietest.
    """
    landing = [row["landing_speed_rms"] for row in rows]
    apexes = [row["apex_mean"] for row in rows]
    # NaN where a beta did not walk at that speed: then nothing is said of it.
    known = all(math.isfinite(value) for value in (*landing, *apexes))
    drop = 1.0 - landing[-1] / landing[0] if known else math.nan
    steps = float(sum(b < a for a, b in pairwise(landing))) if known else math.nan
    apex = 100.0 * min(apexes) if known else math.nan
    at = f"at {speed:g} m/s"
    return [
        Figure("beta", f"landings slower at beta 1, {at}", drop, "share", Target(_DROPS[speed])),
        Figure("beta", f"steps of beta that land slower, {at}", steps, "", Target(len(rows) - 1.0)),
        Figure("beta", f"lowest apex of any beta, {at}", apex, "cm", Target(100.0 * _APEX)),
    ]


def _each(robots: int) -> int:
    return max(1, robots // 16)


def _heard(robots: int) -> int:
    return max(1, robots // 32)


def _at_speeds(policy: Driver, each: int, seed: int, on_work: OnWork) -> list[dict[str, Any]]:
    """Return the figures of every beta at every actual speed."""
    settings = torch.tensor([(speed, 0.0, 0.0, beta) for beta in BETAS for speed in _COMMANDS])
    command, setting = dealt(settings, each)
    env = make_env(robots_cfg(policy, len(command), _WALK_TIME, seed))
    meter = GaitMeter(env)

    def watch(dones: torch.Tensor) -> None:
        meter.update(command, dones)
        on_work(len(command) * env.step_dt)

    env.reset()
    walk(env, policy.controller(env.cfg), command, _WALK_TIME, watch)
    gaits = [meter.gait(setting == index) for index in range(len(settings))]
    count = len(_COMMANDS)
    own = {beta: gaits[i * count : (i + 1) * count] for i, beta in enumerate(BETAS)}
    names = ("landing_speed_rms", "landing_speed_mean", "apex_mean", "stride_frequency")
    rows = []
    for speed in _DROPS:
        for beta in BETAS:
            figures = figures_at_speed(own[beta], speed)
            rows.append({"speed": speed, "beta": beta} | {name: figures[name] for name in names})
    return rows


def _levels(policy: Driver, each: int, seed: int, on_work: OnWork) -> list[dict[str, float]]:
    """Return the level of the loudest and of the quietest beta at equal actual speed."""
    ends = (BETAS[0], BETAS[-1])
    settings = [NoiseSetting(beta, speed) for beta in ends for speed in _HEARD_COMMANDS]
    work = SOUND_WORK * len(settings) * each * policy.cfg.env.step_dt
    rows = measure_noise(
        policy,
        _SURFACE,
        settings,
        each,
        _HEARD_TIME,
        seed,
        from_energies=True,
        on_step=lambda: on_work(work),
    )
    return [
        {
            "beta": beta,
            "speed": _HEARD_SPEED,
            "mnl": level_at_speed(
                [(row.speed_mean, row.mnl_mean) for row in rows if row.beta == beta], _HEARD_SPEED
            ),
        }
        for beta in ends
    ]
