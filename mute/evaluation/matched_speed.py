"""Quiet at equal speed: figures of several betas at one actual forward speed.

A robot that slows down is quieter for that alone. So each beta walks at a range of commanded
speeds, and its figures are read off where the actual speed is the one asked for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import torch

from mute.controllers.controller import Controller
from mute.envs.quadruped_env import QuadrupedEnv
from mute.evaluation.gait import Gait
from mute.evaluation.trials import run_trial

__all__ = ["figures_at_speed", "level_at_speed", "sweep_beta_at_speed"]

_COMMAND_FACTORS = (0.8, 1.0, 1.2, 1.4, 1.7, 2.0)
"""Commanded over target speed: a high beta walks slower than it is asked to, so the actual speeds
enclose the target only if the commands go well beyond it."""


def sweep_beta_at_speed(
    env: QuadrupedEnv,
    controller: Controller,
    speed: float,
    betas: Sequence[float],
    num_steps: int,
) -> list[dict[str, float]]:
    """Return each beta's figures at an actual forward speed.

    The robots are dealt out evenly to all pairs of beta and commanded speed, in one batch.

    Args:
        env: The environment; needs at least len(betas) * 6 robots.
        controller: What drives.
        speed: Actual forward speed, m/s.
        betas: Quiet factors.
        num_steps: Control steps to walk.

    Raises:
        ValueError: If there are fewer robots than pairs.
    """
    pairs = torch.tensor([(beta, factor * speed) for beta in betas for factor in _COMMAND_FACTORS])
    if env.num_envs < len(pairs):
        raise ValueError(f"num_envs must be >= {len(pairs)} for this sweep, got {env.num_envs}")
    assigned = torch.arange(env.num_envs) % len(pairs)
    commands = torch.zeros(env.num_envs, 4)
    commands[:, 3], commands[:, 0] = pairs[assigned].T
    meter = run_trial(env, controller, commands, num_steps)
    gaits = [meter.gait(assigned == index) for index in range(len(pairs))]
    count = len(_COMMAND_FACTORS)
    return [
        {"beta": beta} | figures_at_speed(gaits[i * count : (i + 1) * count], speed)
        for i, beta in enumerate(betas)
    ]


def figures_at_speed(gaits: Sequence[Gait], speed: float) -> dict[str, float]:
    """Interpolate figures linearly in the actual speed.

    Args:
        gaits: Figures at several commanded speeds.
        speed: Actual speed to read them off at, m/s.

    Returns:
        Every figure by name; NaN where no two gaits enclose the speed.
    """
    ordered = sorted(gaits, key=lambda gait: gait.speed)
    speeds = [gait.speed for gait in ordered]
    if not speeds[0] <= speed <= speeds[-1]:
        return dict.fromkeys(ordered[0].as_dict(), math.nan)
    names = ordered[0].as_dict()
    return {
        name: float(np.interp(speed, speeds, [getattr(gait, name) for gait in ordered]))
        for name in names
    }


def level_at_speed(walks: Sequence[tuple[float, float]], speed: float) -> float:
    """Return the mean noise level at an actual speed, between measured ones, dBA.

    Args:
        walks: Actual speed, m/s, and level, dBA, of one beta at several commanded speeds.
        speed: Actual speed, m/s.

    Returns:
        NaN where no two walks with a level enclose the speed.
    """
    known = sorted((walked, level) for walked, level in walks if math.isfinite(level))
    if not known or not known[0][0] <= speed <= known[-1][0]:
        return math.nan
    speeds, levels = zip(*known, strict=True)
    return float(np.interp(speed, speeds, levels))
