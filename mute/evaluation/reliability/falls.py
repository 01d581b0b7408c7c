"""How many robots fall on commands that are drawn evenly."""

from __future__ import annotations

import torch

from mute.controllers.driver import Driver
from mute.evaluation.reliability.conditions import OnWork, make_env, walk
from mute.evaluation.reliability.figures import Figure, PartResult, Target
from mute.evaluation.trials import command_sampler
from mute.evaluation.usual_robots import robots_cfg

__all__ = ["falls_work", "measure_falls"]

_EPISODE = 20.0
"""Length of an episode, s."""
_FALLS = Target(below=0.01)


def measure_falls(policy: Driver, robots: int, seed: int, on_work: OnWork) -> PartResult:
    """Measure the share of robots that fall in an episode.

    Commands and betas are drawn evenly from the task's ranges, and drawn anew within the episode.

    Args:
        policy: What walks.
        robots: Number of robots, an episode each.
        seed: Of physics, first states, commands and noise.
        on_work: Is told of the work that is done.
    """
    env = make_env(robots_cfg(policy, robots, _EPISODE, seed))
    controller = policy.controller(env.cfg)
    cfg = policy.cfg.env.commands.drawn_evenly()
    sampler = command_sampler(cfg, robots, seed)
    everyone = torch.ones(robots, dtype=torch.bool)
    fallen, unstable = torch.zeros_like(everyone), torch.zeros_like(everyone)

    def watch(_: torch.Tensor) -> None:
        fallen.logical_or_(env.fallen)
        unstable.logical_or_(env.unstable)
        on_work(robots * env.step_dt)

    env.reset()
    left, first = _EPISODE, True
    while left > 0.5 * env.step_dt:
        sampler.resample(everyone, with_beta=first)
        seconds = min(left, cfg.resampling_time)
        walk(env, controller, sampler.command.clone(), seconds, watch)
        left, first = left - seconds, False
    share = float(fallen.double().mean())
    row = {"robots": robots, "fell": int(fallen.sum()), "unstable": int(unstable.sum())}
    figures = [Figure("falls", "robots that fall in an episode of 20 s", share, "share", _FALLS)]
    return PartResult(figures, {"falls": [row]})


def falls_work(robots: int) -> float:
    """Return the work of `measure_falls`, s."""
    return robots * _EPISODE
