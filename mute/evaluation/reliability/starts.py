"""Whether robots that stand begin to walk when they are told to.

They begin in the exact stance, at rest, as a user's robot does: of what first states stir up, a
robot may still be marching when the command comes. They stand for `STAND_TIME` at the command zero,
then it comes. A robot *goes* if within
`DEADLINE` the mean over half a second of its velocity along the command reached `GOING_SHARE` of
what is asked; if over the last second of the trial, which ends half a second after the deadline, it
is still as fast; and if it did not fall, standing or going. The end of the first such half second
is the time that it took.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import torch

from mute.controllers.controller import Controller
from mute.controllers.driver import Driver
from mute.envs.quadruped_env import QuadrupedEnv
from mute.evaluation.obedience import GOING_SHARE, along_command
from mute.evaluation.reliability.conditions import (
    BETAS,
    OnWork,
    dealt,
    make_env,
    walk,
)
from mute.evaluation.reliability.figures import Figure, PartResult, Target
from mute.evaluation.trials import evaluation_cfg, from_the_stance
from mute.evaluation.usual_robots import robots_cfg

__all__ = ["COMMANDS", "Start", "going_times", "measure_starts", "starts_of", "starts_work"]

COMMANDS = {
    "0.1 m/s forward": (0.1, 0.0, 0.0),
    "0.2 m/s forward": (0.2, 0.0, 0.0),
    "0.3 m/s forward": (0.3, 0.0, 0.0),
    "0.5 m/s forward": (0.5, 0.0, 0.0),
    "0.3 m/s backward": (-0.3, 0.0, 0.0),
    "0.2 m/s sideways": (0.0, 0.2, 0.0),
    "0.3 rad/s turning": (0.0, 0.0, 0.3),
    "0.6 rad/s turning": (0.0, 0.0, 0.6),
}
"""What robots that stand are told, (v_x, v_y, w_z) in m/s and rad/s."""

STAND_TIME = 3.0
"""Time that robots stand before the command comes, s."""
DEADLINE = 2.0
"""Time within which they must go, s."""
TRIAL_TIME = 2.5
"""Time that is watched after the command, s."""
_WINDOW = 0.5
"""Time over which a velocity is averaged, s: about a stride, in which the trunk sways."""
_HOLD = 1.0
"""Last part of the trial, in which a robot must still go, s."""
_SHARE = Target(at_least=0.98)


@dataclass(frozen=True)
class Start:
    """How robots of one beta start on one command."""

    command: str
    """Name of the command."""
    beta: float
    """Quiet factor."""
    robots: int
    """How many stood."""
    share: float
    """Share of them that go."""
    seconds: float
    """Median over those that go of the time that it took, s; NaN if none goes."""


def going_times(progress: torch.Tensor, ended: torch.Tensor, step_dt: float) -> torch.Tensor:
    """Return when each robot goes, s after the command; infinity for one that does not.

    Args:
        progress: Velocity along the command over what is asked, from the command to the end of the
            trial. Shape: (steps, robots).
        ended: Robots that fell or blew up. Shape: (robots,), bool.
        step_dt: Control period, s.

    Returns:
        Shape: (robots,).
    """
    window, hold = round(_WINDOW / step_dt), round(_HOLD / step_dt)
    fast = progress.unfold(0, window, 1).mean(dim=-1) >= GOING_SHARE
    first = (fast.float().argmax(dim=0) + window) * step_dt
    lasting = progress[-hold:].mean(dim=0) >= GOING_SHARE
    # Half a step of grace: the deadline is no number of steps in floating point.
    in_time = fast.any(dim=0) & (first <= DEADLINE + 0.5 * step_dt)
    return torch.where(in_time & lasting & ~ended, first, math.inf)


def measure_starts(policy: Driver, robots: int, seed: int, on_work: OnWork) -> PartResult:
    """Start randomised robots with noisy sensors, and the exact robot with exact sensors.

    Args:
        policy: What walks.
        robots: Robots for each command and beta.
        seed: Of physics and noise.
        on_work: Is told of the work that is done.
    """
    seconds = STAND_TIME + TRIAL_TIME
    cfg = from_the_stance(robots_cfg(policy, robots * len(BETAS), seconds, seed))
    randomized = starts_of(make_env(cfg), policy.controller(cfg), on_work)
    exact = from_the_stance(evaluation_cfg(policy.cfg.env, len(BETAS), seconds, seed))
    nominal = starts_of(make_env(exact), policy.controller(exact), on_work)
    figures = [_least_share(randomized, beta) for beta in BETAS]
    figures += [_nominal(nominal, beta) for beta in BETAS]
    tables = {
        "starts": [asdict(start) for start in randomized],
        "starts_nominal": [asdict(start) for start in nominal],
    }
    return PartResult(figures, tables)


def starts_work(robots: int) -> float:
    """Return the work of `measure_starts`, s."""
    return len(BETAS) * (robots + 1) * (STAND_TIME + len(COMMANDS) * TRIAL_TIME)


def starts_of(env: QuadrupedEnv, controller: Controller, on_work: OnWork) -> list[Start]:
    """Let robots stand, and start them on each command in turn from the same stand.

    Args:
        env: The robots, a multiple of the number of `BETAS`; it is reset first.
        controller: What drives them.
        on_work: Is told of the work that is done.

    Returns:
        A row for each beta and command.
    """
    betas = torch.zeros(len(BETAS), 4)
    betas[:, 3] = torch.tensor(BETAS)
    standing, setting = dealt(betas, env.num_envs // len(BETAS))
    env.reset()
    controller.reset()
    watch = _Watch(env, on_work)
    walk(env, controller, standing, STAND_TIME, watch)
    stand, fell_standing = env.state_dict(), watch.ended
    rows: list[Start] = []
    for name, velocity in COMMANDS.items():
        env.load_state_dict(stand)
        command = standing.clone()
        command[:, :3] = torch.tensor(velocity)
        watch = _Watch(env, on_work)
        # A copy goes on from the same past; the one that it is of keeps it for the next command.
        walk(env, copy.deepcopy(controller), command, TRIAL_TIME, watch)
        times = going_times(watch.progress, watch.ended | fell_standing, env.step_dt)
        rows += [_start(name, beta, times[setting == index]) for index, beta in enumerate(BETAS)]
    return rows


class _Watch:
    """Keeps how fast each robot is along its command, and which of them fell or blew up."""

    def __init__(self, env: QuadrupedEnv, on_work: OnWork) -> None:
        self._env = env
        self._on_work = on_work
        self._steps: list[torch.Tensor] = []
        self.ended = torch.zeros(env.num_envs, dtype=torch.bool)

    def __call__(self, dones: torch.Tensor) -> None:
        env = self._env
        self._steps.append(along_command(env.commands.command, env.base_lin_vel, env.base_ang_vel))
        self.ended |= dones
        self._on_work(env.num_envs * env.step_dt)

    @property
    def progress(self) -> torch.Tensor:
        """Velocity along the command over what is asked. Shape: (steps, robots)."""
        return torch.stack(self._steps)


def _start(command: str, beta: float, times: torch.Tensor) -> Start:
    gone = times[times.isfinite()]
    median = float(gone.median()) if len(gone) else math.nan
    return Start(command, beta, len(times), len(gone) / len(times), median)


def _least_share(starts: Sequence[Start], beta: float) -> Figure:
    least = min(start.share for start in starts if start.beta == beta)
    name = f"robots that go, at the worst command, beta {beta:g}"
    return Figure("starts", name, least, "share", _SHARE)


def _nominal(starts: Sequence[Start], beta: float) -> Figure:
    gone = sum(start.share == 1.0 for start in starts if start.beta == beta)
    name = f"commands on which the exact robot goes, beta {beta:g}"
    return Figure("starts", name, float(gone), "", Target(at_least=float(len(COMMANDS))))
