"""How robots get over a kind of ground at a level, and what they know of it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import asdict, dataclass

import torch
from tensordict import TensorDict

from mute.controllers import LearnedController
from mute.controllers.learned import Policy
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.randomization import full_randomization
from mute.envs.scene import FOOT_RADIUS
from mute.envs.terrain import TerrainCfg
from mute.evaluation.estimation_errors import EstimationMeter
from mute.evaluation.trials import evaluation_cfg, run_trial
from mute.evaluation.usual_robots import under_conditions

__all__ = ["Crossing", "HeightBaselines", "cross", "crossing_cfg"]

_ENOUGH = 0.8
"""Share of the commanded distance from which on a robot got across."""


@dataclass
class Crossing:
    """Figures of one kind of ground at one level."""

    kind: str
    """Kind of ground."""
    level: int
    """Its level."""
    speed: float
    """Commanded forward speed, m/s."""
    episodes: int
    """Robots, one episode each."""
    success: float
    """Share of them that did not fall and got more than 80 % of the commanded distance ahead, from
    where and as they began, and of its part along x where ground is crossed so: who turns aside
    on stairs climbs none. One whose simulation turned unstable is not among them, and did not
    fall."""
    falls: float
    """Share that fell."""
    made: float
    """Distance ahead over the commanded one, until a fall, mean."""
    velocity_rmse: float
    """Estimator: root of the mean squared error of the velocity over axes, m/s."""
    height_rmse: float | None
    """Estimator: root mean squared error of the height map, m; None if it estimates none."""
    height_rmse_flat: float
    """The same of a map that is level at the height of the feet on the ground, m."""
    height_rmse_mean: float
    """The same of the mean map of this kind and level, m."""
    phase_mae: float | None
    """Estimator: mean absolute error of the phase; None if it estimates none."""
    phase_mae_clock: float
    """The same of a clock, see `EstimationErrors`."""
    contact_time_mae: float | None
    """Estimator: mean absolute error of the time until a foot that swings lands, s; None if it
    estimates no phase."""
    contact_time_mae_clock: float
    """The same of the clock, s."""

    def as_dict(self) -> dict[str, float | int | str]:
        """Return the figures by name, without those of what is not estimated."""
        return {name: value for name, value in asdict(self).items() if value is not None}


class HeightBaselines:
    """What two trivial predictors of the height map would have got wrong.

    One takes the ground to be level at the mean height of the feet that stand, which a robot can
    tell from its joints and its tilt. The other always says the mean map, which is known only
    afterwards: no map that is always the same is better.
    """

    def __init__(self, env: QuadrupedEnv) -> None:
        """Start at zero."""
        self._env = env
        points = len(env.grid)
        self._flat = 0.0
        self._sum = torch.zeros(points, dtype=torch.float64)
        self._squares = torch.zeros(points, dtype=torch.float64)
        self._count = 0

    def update(self, counted: torch.Tensor) -> None:
        """Take in where some robots are now.

        Args:
            counted: Which of them. Shape: (num_envs,), bool.
        """
        env = self._env
        heights = env.ground.height_map(env.grid, env.base_pos, env.heading)[counted].double()
        feet = env.foot_pos[counted, :, 2].double() - FOOT_RADIUS
        down = env.footfalls.contact[counted].double()
        # Of a robot in the air, the mean of all four.
        weight = torch.where(down.sum(dim=1, keepdim=True) > 0.0, down, torch.ones_like(down))
        ground = (feet * weight).sum(dim=1) / weight.sum(dim=1)
        level = (env.base_pos[counted, 2] - ground)[:, None]
        self._flat += float((heights - level).square().mean(dim=1).sum())
        self._sum += heights.sum(dim=0)
        self._squares += heights.square().sum(dim=0)
        self._count += len(heights)

    def errors(self) -> tuple[float, float]:
        """Return the root mean squared errors of the level map and of the mean map, m."""
        mean = self._sum / self._count
        spread = (self._squares / self._count - mean.square()).clamp(min=0.0)
        return (self._flat / self._count) ** 0.5, float(spread.mean()) ** 0.5


def crossing_cfg(
    policy: Policy, kind: str, level: int, episodes: int, seconds: float, seed: int
) -> QuadrupedEnvCfg:
    """Return the environment: robots that differ in everything, on one kind of ground.

    Args:
        policy: What walks.
        kind: Kind of ground, of `envs.terrain.KINDS`.
        level: Its level.
        episodes: Number of robots.
        seconds: Length of an episode, s.
        seed: Of ground, robots, first states and noise.
    """
    terrain = TerrainCfg(kind=kind, first_levels=(level, level), curriculum=False)
    robots = full_randomization(push_interval=0.0)
    env = dataclasses.replace(under_conditions(policy).cfg.env, randomization=robots)
    return evaluation_cfg(env, episodes, seconds, seed, randomized=True, terrain=terrain)


def cross(
    policy: Policy,
    cfg: QuadrupedEnvCfg,
    speed: float,
    beta: float,
    seconds: float,
    on_step: Callable[[], None] = lambda: None,
) -> Crossing:
    """Walk ahead for one episode, and return the figures.

    Args:
        policy: What walks.
        cfg: See `crossing_cfg`.
        speed: Commanded forward speed, m/s.
        beta: Quiet factor.
        seconds: Length of the episode, s.
        on_step: Is called after each control step.
    """
    env = QuadrupedEnv(cfg)
    controller = LearnedController(policy, cfg.num_envs)
    estimation = EstimationMeter(env, controller, first_episodes=True)
    baselines = HeightBaselines(env)
    made, along = torch.zeros(2, cfg.num_envs)
    way: list[torch.Tensor] = []
    fallen = torch.zeros(cfg.num_envs, dtype=torch.bool)
    ended = fallen.clone()

    def watch(observations: TensorDict, dones: torch.Tensor) -> None:
        estimation(observations, dones)
        fallen.logical_or_(env.fallen)
        # Who has ended before the time begins anew, of which nothing counts.
        ended.logical_or_(dones)
        if not way:
            way.extend((env.base_pos[:, :2].clone(), env.heading.clone()))
        got = env.base_pos[:, :2] - way[0]
        made.copy_(torch.where(ended, made, (got * way[1]).sum(dim=1)))
        along.copy_(torch.where(ended, along, got[:, 0] / way[1][:, 0]))
        if not bool(ended.all()):
            baselines.update(~ended)
        on_step()

    command = torch.tensor((speed, 0.0, 0.0, beta))
    run_trial(env, controller, command, round(seconds / env.step_dt), watch)
    share, share_of_x = made / (speed * seconds), along / (speed * seconds)
    enough = (share > _ENOUGH) & (~env.travelled.across | (share_of_x > _ENOUGH))
    errors = estimation.errors()
    flat, mean = baselines.errors()
    return Crossing(
        kind=cfg.terrain.kind,
        level=cfg.terrain.first_levels[0],
        speed=speed,
        episodes=cfg.num_envs,
        success=float((~ended & enough).double().mean()),
        falls=float(fallen.double().mean()),
        made=float(share.mean()),
        velocity_rmse=errors.velocity_rmse,
        height_rmse=errors.height_rmse,
        height_rmse_flat=flat,
        height_rmse_mean=mean,
        phase_mae=errors.phase_mae,
        phase_mae_clock=errors.phase_mae_clock,
        contact_time_mae=errors.contact_time_mae,
        contact_time_mae_clock=errors.contact_time_mae_clock,
    )
