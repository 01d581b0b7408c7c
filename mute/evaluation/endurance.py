"""How much a policy bears on flat ground: single hardships, pushes until it falls, a long walk.

Beside hardships, these are the tests of DreamWaQ's paper that need no hardware (arXiv 2301.10602,
section IV): random commands, drawn anew every 10 s, for 10 minutes with five seeds and for half an
hour, and pushes along random directions of space every second until the fall. Commands are of up to
1 m/s and rad/s, or of the task's own range if that is less. How strong a push is, the paper does
not say: here each is a little stronger than the one before, and the largest that was borne counts.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass

import torch
from tensordict import TensorDict

from mute.controllers import LearnedController
from mute.controllers.learned import Policy
from mute.envs.commands import CommandsCfg
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.randomization import RandomizationCfg, full_randomization
from mute.evaluation.intervals import mean_with_interval
from mute.evaluation.trials import command_sampler, evaluation_cfg, run_trial
from mute.evaluation.usual_robots import under_conditions

__all__ = [
    "COMMAND_TIME",
    "HARDSHIPS",
    "LONGEST_PUSHES",
    "Hardship",
    "LongWalk",
    "Pushes",
    "be_pushed",
    "bear",
    "walk_at_random",
]

_SPEED = 0.5
"""Commanded forward speed where one is told, m/s."""
_PUSH_INTERVAL = 4.0
"""Time between the pushes of a hardship, s."""
_FIRST_PUSH = _STRONGER = 0.05
"""First push of those until the fall, and how much stronger each is than the one before, m/s."""
LONGEST_PUSHES = 60.0
"""Time after which pushes are given up, s; by then they are of 3 m/s."""
COMMAND_TIME = 10.0
"""Time for which a random command holds, s."""
_WIDEST = 1.0
"""Largest random command, m/s and rad/s, or the task's own if that is less."""

OnStep = Callable[[], None]


@dataclass
class Hardship:
    """How robots that differ in everything bear one thing that is hard for all of them."""

    hardship: str
    """What it is, of `HARDSHIPS`."""
    robots: int
    """Robots, one episode each."""
    survived: float
    """Share that neither fell nor had its simulation turn unstable."""
    made: float
    """Distance along the command over the commanded one, until a fall, mean."""

    def as_dict(self) -> dict[str, float | int | str]:
        """Return the figures by name."""
        return asdict(self)


@dataclass
class Pushes:
    """The largest push that robots bore."""

    robots: int
    """Robots."""
    largest: float
    """Mean of the largest that each bore, m/s."""
    deviation: float
    """Its standard deviation over robots, m/s."""
    still_up: float
    """Share that never fell, for which the last push counts."""

    def as_dict(self) -> dict[str, float | int]:
        """Return the figures by name."""
        return asdict(self)


@dataclass
class LongWalk:
    """What came of a long walk at random commands."""

    robots: int
    """Robots."""
    minutes: float
    """How long they walked, min."""
    seed: int
    """Of robots, first states, noise and commands."""
    survived: float
    """Share that neither fell nor had its simulation turn unstable."""
    velocity_rmse: float
    """Root of the mean squared error of the horizontal velocity, until a fall, m/s."""
    yaw_rate_rmse: float
    """The same of the yaw rate, rad/s."""

    def as_dict(self) -> dict[str, float | int]:
        """Return the figures by name."""
        return asdict(self)


def _low_friction(env: QuadrupedEnvCfg, robots: RandomizationCfg) -> RandomizationCfg:
    factor = 0.3 / env.scene.floor_friction
    return dataclasses.replace(robots, friction_factor=(factor, factor))


HARDSHIPS: Mapping[str, Callable[[QuadrupedEnvCfg, RandomizationCfg], RandomizationCfg]] = {
    "none": lambda _, robots: robots,
    "3 kg on the trunk": lambda _, robots: dataclasses.replace(robots, added_mass=(3.0, 3.0)),
    "friction of 0.3": _low_friction,
    "motors 20 ms late": lambda _, robots: dataclasses.replace(robots, action_delay=(0.02, 0.02)),
    "pushes of 1 m/s every 4 s": lambda _, robots: robots,
}
"""What each makes of robots that differ in everything; pushes come on the way."""


def bear(
    policy: Policy,
    hardship: str,
    robots: int,
    seconds: float,
    beta: float,
    seed: int,
    on_step: OnStep = lambda: None,
) -> Hardship:
    """Walk ahead for one episode under a hardship.

    Args:
        policy: What walks.
        hardship: Of `HARDSHIPS`.
        robots: Number of robots.
        seconds: Length of the episode, s.
        beta: Quiet factor.
        seed: Of robots, first states, noise and pushes.
        on_step: Is called after each control step.
    """
    env = _make_env(policy, robots, seconds, seed, HARDSHIPS[hardship])
    generator = torch.Generator().manual_seed(seed)
    interval = round(_PUSH_INTERVAL / env.step_dt)
    made = torch.zeros(robots)
    ended = torch.zeros(robots, dtype=torch.bool)
    steps = 0

    def watch(_: TensorDict, dones: torch.Tensor) -> None:
        nonlocal steps
        steps += 1
        ended.logical_or_(dones)
        made.add_(torch.where(ended, 0.0, env.step_dt * env.base_lin_vel[:, 0]))
        if hardship.startswith("pushes") and steps % interval == 0:
            env.simulation.qvel[:, :2] += _directions(robots, 2, generator)
        on_step()

    command = torch.tensor((_SPEED, 0.0, 0.0, beta))
    controller = LearnedController(policy, robots)
    run_trial(env, controller, command, round(seconds / env.step_dt), watch)
    share = float((made / (_SPEED * seconds)).mean())
    return Hardship(hardship, robots, 1.0 - float(ended.double().mean()), share)


def be_pushed(
    policy: Policy, robots: int, beta: float, seed: int, on_step: OnStep = lambda: None
) -> Pushes:
    """Walk ahead and be pushed along a random direction of space every second, until the fall.

    Args:
        policy: What walks.
        robots: Number of robots.
        beta: Quiet factor.
        seed: Of robots, first states, noise and pushes.
        on_step: Is called after each control step.
    """
    env = _make_env(policy, robots, LONGEST_PUSHES, seed)
    generator = torch.Generator().manual_seed(seed)
    second = round(1.0 / env.step_dt)
    up = torch.ones(robots, dtype=torch.bool)
    largest = torch.zeros(robots)
    steps, strength = 0, 0.0

    def watch(_: TensorDict, dones: torch.Tensor) -> None:
        nonlocal steps, strength
        steps += 1
        up.logical_and_(~dones)
        if steps % second == 0:
            # Who is still up a second after a push has borne it.
            largest[up] = strength
            strength = strength + _STRONGER if strength else _FIRST_PUSH
            env.simulation.qvel[:, :3] += strength * _directions(robots, 3, generator)
        on_step()

    command = torch.tensor((_SPEED, 0.0, 0.0, beta))
    controller = LearnedController(policy, robots)
    run_trial(env, controller, command, round(LONGEST_PUSHES / env.step_dt), watch)
    mean, deviation, _ = mean_with_interval(largest.tolist())
    return Pushes(robots, mean, deviation, float(up.double().mean()))


def walk_at_random(
    policy: Policy,
    robots: int,
    minutes: float,
    beta: float,
    seed: int,
    on_step: OnStep = lambda: None,
) -> LongWalk:
    """Walk at commands that are drawn anew every 10 s.

    Args:
        policy: What walks.
        robots: Number of robots.
        minutes: How long, min.
        beta: Quiet factor.
        seed: Of robots, first states, noise and commands.
        on_step: Is called after each control step.
    """
    env = _make_env(policy, robots, 60.0 * minutes, seed)
    controller = LearnedController(policy, robots)
    sampler = command_sampler(_commands(policy.cfg.env.commands, beta), robots, seed)
    everyone = torch.ones(robots, dtype=torch.bool)
    ended = ~everyone
    squares, counted = torch.zeros(2, dtype=torch.float64), 0
    env.reset()
    hold = round(COMMAND_TIME / env.step_dt)
    for step in range(round(60.0 * minutes / env.step_dt)):
        if step % hold == 0:
            sampler.resample(everyone, with_beta=True)
            env.set_command(sampler.command)
        _, _, dones, _ = env.step(controller.act(env.get_observations()))
        ended |= dones
        if bool(dones.any()):
            controller.reset(dones)
            env.set_command(sampler.command)
        left = ~ended
        wrong = env.base_lin_vel[left, :2] - sampler.command[left, :2]
        turned = env.base_ang_vel[left, 2] - sampler.command[left, 2]
        squares += torch.stack((wrong.square().sum(), turned.square().sum())).double()
        counted += int(left.sum())
        on_step()
    velocity, yaw = (squares / max(counted, 1)).sqrt().tolist()
    return LongWalk(robots, minutes, seed, 1.0 - float(ended.double().mean()), velocity, yaw)


def _make_env(
    policy: Policy,
    robots: int,
    seconds: float,
    seed: int,
    harder: Callable[[QuadrupedEnvCfg, RandomizationCfg], RandomizationCfg] = HARDSHIPS["none"],
) -> QuadrupedEnv:
    """Return robots that differ in everything, on flat ground, which nobody pushes by himself."""
    env = under_conditions(policy).cfg.env
    different = harder(env, full_randomization(push_interval=0.0))
    env = dataclasses.replace(env, randomization=different)
    return QuadrupedEnv(evaluation_cfg(env, robots, seconds, seed, randomized=True))


def _commands(cfg: CommandsCfg, beta: float) -> CommandsCfg:
    """Return random commands no wider than the task's own, all of one beta."""

    def within(bounds: tuple[float, float]) -> tuple[float, float]:
        return max(bounds[0], -_WIDEST), min(bounds[1], _WIDEST)

    return dataclasses.replace(
        cfg.drawn_evenly(standing_fraction=0.0),
        lin_vel_x=within(cfg.lin_vel_x),
        lin_vel_y=within(cfg.lin_vel_y),
        ang_vel_z=within(cfg.ang_vel_z),
        beta=(beta, beta),
    )


def _directions(robots: int, axes: int, generator: torch.Generator) -> torch.Tensor:
    """Return a random unit vector for each robot. Shape: (robots, axes)."""
    draw = torch.randn(robots, axes, generator=generator)
    return draw / draw.norm(dim=1, keepdim=True)
