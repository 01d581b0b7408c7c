"""Whether robots that are told to stop stand in silence, and recover from a push.

They walk at 0.5 m/s, then the command is zero. From `SETTLE_TIME` after that on they must stand:
all feet on the ground and staying there, by contacts debounced as the training's are. Then each is
pushed, in a direction of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

import torch

from mute.acoustics.audible_env import listening_cfg
from mute.acoustics.listener import Listener
from mute.controllers.driver import Driver
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.evaluation.obedience import STILL_SPEED
from mute.evaluation.reliability.conditions import (
    BETAS,
    SOUND_WORK,
    OnWork,
    dealt,
    make_env,
    walk,
    without_noise,
)
from mute.evaluation.reliability.figures import Figure, PartResult, Target, worst
from mute.evaluation.usual_robots import robots_cfg

__all__ = ["SETTLE_TIME", "Standing", "Stillness", "measure_stands", "stands_work"]

SETTLE_TIME = 2.0
"""Time after the command zero from which on robots must stand, s."""

_SPEED = 0.5
"""Forward speed that they walk at before, m/s."""
_WALK_TIME = 3.0
_STAND_TIME = 3.0
"""How long standing is watched, s."""
_PUSH = 0.5
"""Change of the trunk's horizontal velocity by the push, m/s."""
_RECOVERY_TIME = 3.0
"""Time within which a robot that was pushed must stand again, s."""
_STILL_TIME = 0.5
"""Last part of it, in which the robot must be still, s."""
_SURFACE = "wood"
_SHARE = Target(at_least=1.0)
_JOINT_SPEED = Target(at_most=0.03)
_LEVEL = Target(at_most=56.0)


@dataclass(frozen=True)
class Standing:
    """How robots of one beta stand."""

    beta: float
    """Quiet factor."""
    robots: int
    """How many were told to."""
    feet_down: float
    """Share of them whose feet are down and stay down."""
    recovered: float
    """Share of them that is still again after the push, without a fall."""
    joint_speed: float
    """Mean over joints, time and robots of the joints' speed, with exact sensors, rad/s."""
    level: float
    """Mean over robots of the mean noise level at the trunk, modelled, dBA; NaN if none was
    heard."""


class Stillness:
    """Watches robots that are to stand: their feet, the speed of trunk and joints, their falls."""

    def __init__(self, env: QuadrupedEnv) -> None:
        """Begin to watch."""
        self._env = env
        self._steps = 0
        self._trunk_speed = torch.zeros(env.num_envs, dtype=torch.float64)
        self._joint_speed = torch.zeros(env.num_envs, dtype=torch.float64)
        self.feet_down = torch.ones(env.num_envs, dtype=torch.bool)
        """Robots whose feet were down all the time, and that did not fall. Shape: (num_envs,)."""

    def update(self, dones: torch.Tensor) -> None:
        """Take in the step that the environment has just made.

        Args:
            dones: Episodes that ended in it. Shape: (num_envs,).
        """
        env = self._env
        self._steps += 1
        self.feet_down &= env.footfalls.contact.all(dim=1) & ~dones
        self._trunk_speed += env.base_lin_vel[:, :2].norm(dim=1)
        self._joint_speed += env.joint_vel.abs().mean(dim=1)

    @property
    def trunk_speed(self) -> torch.Tensor:
        """Mean horizontal speed of each trunk, m/s. Shape: (num_envs,)."""
        return self._trunk_speed / self._steps

    @property
    def joint_speed(self) -> torch.Tensor:
        """Mean speed of each robot's joints, rad/s. Shape: (num_envs,)."""
        return self._joint_speed / self._steps


def measure_stands(policy: Driver, robots: int, seed: int, on_work: OnWork) -> PartResult:
    """Measure how robots stand, how they recover, and what they sound like.

    Args:
        policy: What walks.
        robots: A third of them at each beta; a quarter of these are heard.
        seed: Of physics, first states, pushes and noise.
        on_work: Is told of the work that is done.
    """
    each = _each(robots)
    feet_down, recovered = _stood_and_pushed(policy, each, seed, on_work)
    joint_speed = _joint_speeds(policy, each, seed, on_work)
    level = _levels(policy, _heard(robots), seed, on_work)
    rows = [
        Standing(beta, each, *values)
        for beta, *values in zip(BETAS, feet_down, recovered, joint_speed, level, strict=True)
    ]
    return PartResult(_figures(rows), {"stands": [asdict(row) for row in rows]})


def stands_work(robots: int) -> float:
    """Return the work of `measure_stands`, s."""
    begun = _WALK_TIME + SETTLE_TIME + _STAND_TIME
    unheard = _each(robots) * (2.0 * begun + _RECOVERY_TIME)
    return len(BETAS) * (unheard + SOUND_WORK * _heard(robots) * begun)


def _each(robots: int) -> int:
    return max(1, robots // len(BETAS))


def _heard(robots: int) -> int:
    return max(1, _each(robots) // 4)


class _Robots:
    """Robots of every beta that walk, are told to stop, and settle."""

    def __init__(
        self,
        policy: Driver,
        cfg: QuadrupedEnvCfg,
        on_work: OnWork,
        weight: float = 1.0,
    ) -> None:
        """Make them.

        Args:
            policy: What drives them.
            cfg: Their environment.
            on_work: Is told of the work that is done.
            weight: Work of a second that a robot walks, s.
        """
        self.env = make_env(cfg)
        self._controller = policy.controller(cfg)
        seconds = weight * cfg.num_envs * cfg.step_dt
        self._done = lambda _: on_work(seconds)
        settings = torch.zeros(len(BETAS), 4)
        settings[:, 3] = torch.tensor(BETAS)
        self.zero, self._setting = dealt(settings, cfg.num_envs // len(BETAS))

    def stop(self, *watchers: Callable[[torch.Tensor], object]) -> None:
        """Begin anew, walk, and settle at the command zero."""
        self.env.reset()
        self._controller.reset()
        walking = self.zero.clone()
        walking[:, 0] = _SPEED
        walk(self.env, self._controller, walking, _WALK_TIME, self._done, *watchers)
        self.stand(SETTLE_TIME, *watchers)

    def stand(self, seconds: float, *watchers: Callable[[torch.Tensor], object]) -> None:
        """Hold the command zero."""
        walk(self.env, self._controller, self.zero, seconds, self._done, *watchers)

    def means(self, values: torch.Tensor) -> list[float]:
        """Return the mean of a value over the robots of each beta, NaN left out.

        Args:
            values: Shape: (num_envs,).
        """
        values = values.double()
        return [float(values[self._setting == index].nanmean()) for index in range(len(BETAS))]


def _stood_and_pushed(
    policy: Driver, each: int, seed: int, on_work: OnWork
) -> tuple[list[float], list[float]]:
    """Return by beta the share that stands, and the share that does so again after the push."""
    seconds = _WALK_TIME + SETTLE_TIME + _STAND_TIME + _RECOVERY_TIME
    robots = _Robots(policy, robots_cfg(policy, each * len(BETAS), seconds, seed), on_work)
    env = robots.env
    robots.stop()
    standing = Stillness(env)
    robots.stand(_STAND_TIME, standing.update)
    env.simulation.qvel[:, :2] += _PUSH * _directions(env.num_envs, seed)
    ended = torch.zeros(env.num_envs, dtype=torch.bool)
    robots.stand(_RECOVERY_TIME - _STILL_TIME, ended.logical_or_)
    still = Stillness(env)
    robots.stand(_STILL_TIME, still.update)
    recovered = still.feet_down & (still.trunk_speed <= STILL_SPEED) & ~ended
    return robots.means(standing.feet_down), robots.means(recovered)


def _joint_speeds(policy: Driver, each: int, seed: int, on_work: OnWork) -> list[float]:
    """Return the mean speed of the joints of robots that stand with exact sensors, rad/s."""
    seconds = _WALK_TIME + SETTLE_TIME + _STAND_TIME
    cfg = without_noise(robots_cfg(policy, each * len(BETAS), seconds, seed))
    robots = _Robots(policy, cfg, on_work)
    robots.stop()
    standing = Stillness(robots.env)
    robots.stand(_STAND_TIME, standing.update)
    return robots.means(standing.joint_speed)


def _levels(policy: Driver, each: int, seed: int, on_work: OnWork) -> list[float]:
    """Return the mean noise level of robots that stand, on wood, dBA."""
    settled = _WALK_TIME + SETTLE_TIME
    cfg = robots_cfg(policy, each * len(BETAS), settled + _STAND_TIME, seed)
    robots = _Robots(policy, listening_cfg(cfg, _SURFACE), on_work, SOUND_WORK)
    with Listener(
        robots.env,
        [_SURFACE],
        settle_time=settled,
        seed=seed,
        from_energies=True,
    ) as listener:
        robots.stop(listener.listen)
        robots.stand(_STAND_TIME, listener.listen)
    return robots.means(torch.tensor([own.mnl for own in listener.levels()]))


def _directions(robots: int, seed: int) -> torch.Tensor:
    """Return a horizontal unit vector for each robot. Shape: (robots, 2)."""
    generator = torch.Generator().manual_seed(seed)
    angle = 2.0 * math.pi * torch.rand(robots, generator=generator)
    return torch.stack((angle.cos(), angle.sin()), dim=1)


def _figures(rows: Sequence[Standing]) -> list[Figure]:
    values = {name: [getattr(row, name) for row in rows] for name in Standing.__annotations__}

    def at_worst(name: str, column: str, unit: str, target: Target) -> Figure:
        value = worst(values[column], target)
        return Figure("stands", f"{name}, at the worst beta", value, unit, target)

    return [
        at_worst("robots whose feet are down and stay down", "feet_down", "share", _SHARE),
        at_worst("joint speed without noise", "joint_speed", "rad/s", _JOINT_SPEED),
        at_worst("level at the trunk", "level", "dBA", _LEVEL),
        at_worst("robots still again 3 s after a push", "recovered", "share", _SHARE),
    ]
