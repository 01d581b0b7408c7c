"""Whether robots walk as fast as they are told to, and take stop and go without a fall."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import torch

from mute.controllers.driver import Driver
from mute.envs.commands import BETA, CommandSampler
from mute.evaluation.gait import GaitMeter
from mute.evaluation.reliability.conditions import (
    OnWork,
    dealt,
    make_env,
    walk,
)
from mute.evaluation.reliability.figures import Figure, PartResult, Target, worst
from mute.evaluation.trials import command_sampler
from mute.evaluation.usual_robots import robots_cfg

__all__ = ["Following", "follows_work", "measure_follows", "stop_and_go_falls", "velocity_errors"]

SPEEDS = tuple(round(0.1 * tenth, 1) for tenth in range(1, 11))
"""Commanded forward speeds, m/s."""

_BETAS = (0.0, 1.0)
_SETTLE_TIME = 2.0
"""Time after which a robot's speed counts, s."""
_WALK_TIME = 5.0
"""Length of a walk at one speed, s."""
_RANGE_SETTLE_TIME = 1.0
"""The same over the command range, as `evaluate.py gait` has it, s."""
_RANGE_TIME = 10.0
"""Length of a walk with a command of the whole range, s."""
_CHANGE_TIME = 2.0
"""Time between new commands of stop and go, s."""
_CHANGES = 10
_STOPPED_SHARE = 0.4
"""Share of those commands that are zero."""


@dataclass(frozen=True)
class Following:
    """How fast robots of one beta walk on one command."""

    beta: float
    """Quiet factor."""
    command_speed: float
    """Commanded forward speed, m/s."""
    robots: int
    """How many walked."""
    speed: float
    """Their mean forward speed, m/s."""
    ratio: float
    """Actual over commanded speed."""


def measure_follows(policy: Driver, robots: int, seed: int, on_work: OnWork) -> PartResult:
    """Measure speeds, errors over the command range, and falls in stop and go.

    Args:
        policy: What walks.
        robots: A quarter of them walk at each speed and beta; all of them, half at beta 0 and half
            at beta 1, take stop and go, and commands of the whole range.
        seed: Of physics, first states, commands and noise.
        on_work: Is told of the work that is done.
    """
    rows = _ratios(policy, _each(robots), seed, on_work)
    errors = velocity_errors(policy, _half(robots), seed, on_work)
    falls = stop_and_go_falls(policy, _half(robots), seed, on_work)
    error_rows = [
        {"beta": beta, "velocity_error_sq": errors[beta], "stop_and_go_falls": falls[beta]}
        for beta in _BETAS
    ]
    tables = {"follows": [asdict(row) for row in rows], "follows_range": error_rows}
    return PartResult(_figures(rows, errors, falls), tables)


def follows_work(robots: int) -> float:
    """Return the work of `measure_follows`, s."""
    at_speeds = len(_BETAS) * len(SPEEDS) * _each(robots) * _WALK_TIME
    return at_speeds + len(_BETAS) * _half(robots) * (_RANGE_TIME + _CHANGES * _CHANGE_TIME)


def velocity_errors(policy: Driver, each: int, seed: int, on_work: OnWork) -> dict[float, float]:
    """Return the mean squared velocity error over the command range by beta, (m/s)^2.

    The commands are drawn evenly from the ranges of the policy's task, a tenth of them zero,
    whichever way the task draws them.

    Args:
        policy: What walks.
        each: Robots for each beta.
        seed: Of physics, first states, commands and noise.
        on_work: Is told of the work that is done.
    """
    robots = each * len(_BETAS)
    env = make_env(robots_cfg(policy, robots, _RANGE_TIME, seed))
    controller = policy.controller(env.cfg)
    setting = torch.arange(robots) % len(_BETAS)
    sampler = command_sampler(policy.cfg.env.commands.drawn_evenly(), robots, seed)
    command = _drawn(sampler, setting)
    meter = GaitMeter(env, _RANGE_SETTLE_TIME)

    def watch(dones: torch.Tensor) -> None:
        meter.update(command, dones)
        on_work(robots * env.step_dt)

    env.reset()
    walk(env, controller, command, _RANGE_TIME, watch)
    gaits = [meter.gait(setting == index) for index in range(len(_BETAS))]
    return {beta: gait.velocity_error_sq for beta, gait in zip(_BETAS, gaits, strict=True)}


def stop_and_go_falls(policy: Driver, each: int, seed: int, on_work: OnWork) -> dict[float, float]:
    """Return the share of robots that fall in 20 s of a new command every 2 s, by beta.

    Args:
        policy: What walks.
        each: Robots for each beta.
        seed: Of physics, first states, commands and noise.
        on_work: Is told of the work that is done.
    """
    robots = each * len(_BETAS)
    env = make_env(robots_cfg(policy, robots, _CHANGES * _CHANGE_TIME, seed))
    controller = policy.controller(env.cfg)
    setting = torch.arange(robots) % len(_BETAS)
    cfg = policy.cfg.env.commands.drawn_evenly(_STOPPED_SHARE)
    sampler = command_sampler(cfg, robots, seed)
    fallen = torch.zeros(robots, dtype=torch.bool)

    def watch(_: torch.Tensor) -> None:
        fallen.logical_or_(env.fallen)
        on_work(robots * env.step_dt)

    env.reset()
    for _ in range(_CHANGES):
        walk(env, controller, _drawn(sampler, setting), _CHANGE_TIME, watch)
    return {
        beta: float(fallen[setting == index].double().mean()) for index, beta in enumerate(_BETAS)
    }


def _ratios(policy: Driver, each: int, seed: int, on_work: OnWork) -> list[Following]:
    settings = torch.tensor([(speed, 0.0, 0.0, beta) for beta in _BETAS for speed in SPEEDS])
    command, setting = dealt(settings, each)
    env = make_env(robots_cfg(policy, len(command), _WALK_TIME, seed))
    meter = GaitMeter(env, _SETTLE_TIME)

    def watch(dones: torch.Tensor) -> None:
        meter.update(command, dones)
        on_work(len(command) * env.step_dt)

    env.reset()
    walk(env, policy.controller(env.cfg), command, _WALK_TIME, watch)
    pairs = [(beta, speed) for beta in _BETAS for speed in SPEEDS]
    speeds = [meter.gait(setting == index).speed for index in range(len(pairs))]
    return [
        Following(beta, asked, each, speed, speed / asked)
        for (beta, asked), speed in zip(pairs, speeds, strict=True)
    ]


def _figures(
    rows: Sequence[Following], errors: dict[float, float], falls: dict[float, float]
) -> list[Figure]:
    loud, quiet = ([row.ratio for row in rows if row.beta == beta] for beta in _BETAS)
    error = "squared velocity error, beta"
    return [
        _ratio("smallest actual over commanded speed, beta 0", loud, Target(at_least=0.9)),
        _ratio("largest actual over commanded speed, beta 0", loud, Target(at_most=1.1)),
        _ratio("smallest actual over commanded speed, beta 1", quiet, Target(at_least=0.75)),
        Figure("follows", f"{error} 0", errors[0.0], "(m/s)²", Target(at_most=0.02)),
        Figure("follows", f"{error} 1", errors[1.0], "(m/s)²", Target(at_most=0.04)),
        *(
            Figure("follows", f"falls in stop and go, beta {beta:g}", falls[beta], "share", _NONE)
            for beta in _BETAS
        ),
    ]


_NONE = Target(at_most=0.0)


def _ratio(name: str, ratios: Sequence[float], target: Target) -> Figure:
    return Figure("follows", name, worst(ratios, target), "", target)


def _each(robots: int) -> int:
    """Return the robots for each speed and beta."""
    return max(1, robots // 4)


def _half(robots: int) -> int:
    """Return the robots for each beta."""
    return max(1, robots // len(_BETAS))


def _drawn(sampler: CommandSampler, setting: torch.Tensor) -> torch.Tensor:
    """Return new commands for all robots, with the beta of each one's setting."""
    sampler.resample(torch.ones(len(setting), dtype=torch.bool), with_beta=True)
    command = sampler.command.clone()
    command[:, BETA] = torch.tensor(_BETAS)[setting]
    return command
