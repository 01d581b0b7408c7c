"""The reward of a task: terms by name, each with its function, weight, parameters and group.

The sum is r = beta r_phase + (1 - k beta) r_task + r_other (paper, eq. 6), and more groups that
come and go while it learns.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal, get_args

import torch

from mute.support.errors import MuteError
from mute.support.ranges import Range, check_number, check_ordered, check_ranges

from .motion import Motion
from .reward_terms import REWARD_FUNCTIONS, Group

__all__ = ["Motion", "RewardSum", "RewardTermCfg", "RewardsCfg", "paper_terms", "reward_term"]


@dataclass
class RewardTermCfg:
    """One term of a reward. One function may stand in several, with other figures each."""

    function: str
    """Name of its function, one of `REWARD_FUNCTIONS`."""
    weight: float
    """Factor of the function, per second; 0 leaves the term out."""
    group: Group
    """What else scales it: `task` 1 - k beta, `phase` beta times `quiet_ramp`, `lift` `lift_ramp`,
    `guide` the rest of `guide_ramp`, `other` nothing."""
    params: dict[str, float] = field(default_factory=dict)
    """The function's parameters; those left out have its defaults."""


def reward_term(
    function: str, weight: float, group: Group | None = None, **params: float
) -> RewardTermCfg:
    """Return a term in the group that its function was registered with, unless one is given.

    Raises:
        ValueError: If the function is not registered.
    """
    if function not in REWARD_FUNCTIONS:
        raise ValueError(_unknown("function", function))
    known = REWARD_FUNCTIONS[function]
    defaults = {name: parameter.default for name, parameter in known.parameters.items()}
    return RewardTermCfg(function, weight, group or known.group, defaults | params)


def paper_terms() -> dict[str, RewardTermCfg]:
    """Return the terms of the paper's Table I."""
    weights = {
        "lin_vel_tracking": 1.0,
        "ang_vel_tracking": 0.5,
        "foot_drop_velocity": -0.05,
        "foot_raise_velocity": 0.01,
        "lin_vel_z": -2.0,
        "ang_vel_xy": -0.05,
        "joint_power": -2.0e-5,
        "joint_acc": -2.5e-7,
        "action_rate": -0.01,
        "collision": -0.1,
        "base_height": -1.0,
        "orientation": -0.2,
    }
    return {name: reward_term(name, weight) for name, weight in weights.items()}


@dataclass
class RewardsCfg:
    """The terms of a reward and how they are weighed against each other."""

    terms: dict[str, RewardTermCfg] = field(default_factory=paper_terms)
    """The terms by name; the paper's Table I by default."""
    k: float = 0.2
    """How much of the task reward beta = 1 gives up (paper, section II-C)."""
    phase_source: Literal["estimated", "true"] = "estimated"
    """'estimated' (the paper's) or 'true' (the causal phase, for ablation)."""
    following_time: float = 0.0
    """Time constant, s, with which the velocity error is averaged that the following terms read: a
    trunk speeds up and slows down with every step, and what is asked for is its mean. With 0 it is
    that of the moment."""
    following_acceleration: float = 0.0
    """Acceleration, m/s^2 and rad/s^2 along each axis, with which the velocity that the following
    terms ask for goes from one command to the next; with 0 at once. A robot that is paid for
    turning back from full speed at once takes falls into the bargain."""
    quiet_ramp: tuple[float, float] = (0.0, 0.0)
    """Seconds of simulated time per environment between which the phase group's weight grows from
    0 to 1: a full-strength quiet term from the first step teaches the robot to stand still."""
    lift_ramp: tuple[float, float] = (0.0, 0.0)
    """The same for the lift group: shuffling and falling, which it forbids, are how walking
    begins."""
    guide_ramp: tuple[float, float] = (0.0, 0.0)
    """The same for the guide group, whose weight falls from 1 to 0: once the robot walks, its gait
    is its own. With (0, 0) it has none."""
    never_negative: bool = False
    """Whether a control step pays no less than nothing, as in legged_gym
    (`only_positive_rewards`): where the penalties of a robot that knows nothing outweigh what it
    earns, it learns to fall soon."""

    def __post_init__(self) -> None:
        """Fill in parameters that are left out, and check everything.

        Raises:
            ValueError: If a field is out of its range, or a function is not registered.
        """
        if self.phase_source not in ("estimated", "true"):
            raise ValueError(
                f"env.rewards.phase_source must be 'estimated' or 'true', got {self.phase_source!r}"
            )
        check_ranges(self, "env.rewards", _RANGES)
        check_ordered(self, "env.rewards", "quiet_ramp", "lift_ramp", "guide_ramp")
        for name, term in self.terms.items():
            if not name.isidentifier():
                raise ValueError(f"env.rewards.terms must have names as Python has, got {name!r}")
            _complete(f"env.rewards.terms.{name}", term)
            if term.group == "guide" and term.weight != 0.0 and self.guide_ramp[1] == 0.0:
                raise ValueError(
                    "env.rewards.guide_ramp must end after 0 s where "
                    f"env.rewards.terms.{name}.weight is {term.weight}, got {self.guide_ramp}"
                )


_RAMP = Range(0.0, 1e12)
_RANGES = {
    "k": Range(0.0, 1.0),
    "following_time": Range(0.0, 1e6),
    "following_acceleration": Range(0.0, 1e6),
    "quiet_ramp": _RAMP,
    "lift_ramp": _RAMP,
    "guide_ramp": _RAMP,
}
_WEIGHT = Range(-1e9, 1e9)


def _complete(place: str, term: RewardTermCfg) -> None:
    """Fill in the parameters that a term leaves out, and check it."""
    if term.function not in REWARD_FUNCTIONS:
        raise ValueError(_unknown(f"{place}.function", term.function))
    check_number(f"{place}.weight", term.weight, _WEIGHT)
    if term.group not in get_args(Group):
        allowed = ", ".join(get_args(Group))
        raise ValueError(f"{place}.group must be one of {allowed}, got {term.group!r}")
    parameters = REWARD_FUNCTIONS[term.function].parameters
    for name in term.params:
        if name not in parameters:
            allowed = f"of {', '.join(parameters)}" if parameters else "empty"
            raise ValueError(f"{place}.params must be {allowed}, got {name!r}")
    term.params = {
        name: term.params.get(name, parameter.default) for name, parameter in parameters.items()
    }
    for name, parameter in parameters.items():
        check_number(f"{place}.params.{name}", term.params[name], parameter.allowed)


def _unknown(place: str, function: str) -> str:
    return (
        f"{place} must be one of {', '.join(REWARD_FUNCTIONS)}, or registered by a module that "
        f"MUTE_PLUGINS names, got {function!r}"
    )


def _misshapen(name: str, function: str, value: object, row: torch.Tensor) -> str:
    given = f"shape {tuple(value.shape)}" if isinstance(value, torch.Tensor) else repr(value)
    return (
        f"env.rewards.terms.{name}: the function {function} must return one number a robot, shape "
        f"{tuple(row.shape)}, got {given}"
    )


class RewardSum:
    """Evaluates the terms that have a weight and adds them up."""

    def __init__(
        self, cfg: RewardsCfg, step_dt: float, num_envs: int, device: torch.device
    ) -> None:
        """Choose the terms with a weight.

        Args:
            cfg: The terms.
            step_dt: Control period, s; weights are per second.
            num_envs: Number of environments.
            device: Device of the result.
        """
        self.cfg = cfg
        self.names: list[str] = []
        self._terms: list[Callable[[Motion], torch.Tensor]] = []
        self._rows: dict[str, slice] = {}
        weights = []
        # Group by group, so that a factor scales rows that lie side by side.
        for group in get_args(Group):
            start = len(self.names)
            for name, term in cfg.terms.items():
                if term.group == group and term.weight != 0.0:
                    self.names.append(name)
                    function = REWARD_FUNCTIONS[term.function]
                    self._terms.append(function.with_parameters(term.params))
                    weights.append(term.weight * step_dt)
            self._rows[group] = slice(start, len(self.names))
        self._weights = torch.tensor(weights, device=device).unsqueeze(1)
        self._values = torch.zeros(len(self.names), num_envs, device=device)
        self._step_dt = step_dt

    def __call__(
        self, motion: Motion, quiet: float | torch.Tensor, lift: float, guide: float
    ) -> tuple[torch.Tensor, dict[str, torch.Tensor]]:
        """Return the reward of a control step and each term's share of it.

        Args:
            motion: The control step.
            quiet: Factor in [0, 1] on the phase group: of all, or of each robot, (num_envs,).
            lift: Curriculum factor in [0, 1] on the lift group.
            guide: Curriculum factor in [0, 1] on the guide group.

        Returns:
            The reward, shape (num_envs,), and by name each term's mean over the environments with
            its weight and group factor, per second, as scalars.

        Raises:
            MuteError: If a function returns something else than a number for every robot.
        """
        for name, row, term in zip(self.names, self._values, self._terms, strict=True):
            value = term(motion)
            # Another shape might fit by repetition: the sum over all robots would be paid to each.
            if getattr(value, "shape", None) != row.shape:
                raise MuteError(_misshapen(name, self.cfg.terms[name].function, value, row))
            row.copy_(value)
        weighted = self._values.mul_(self._weights)
        beta = motion.command[:, 3]
        weighted[self._rows["task"]] *= 1.0 - self.cfg.k * beta
        weighted[self._rows["phase"]] *= quiet * beta
        weighted[self._rows["lift"]] *= lift
        weighted[self._rows["guide"]] *= guide
        means = weighted.mean(dim=1) / self._step_dt
        total = weighted.sum(dim=0)
        if self.cfg.never_negative:
            total.clamp_(min=0.0)
        return total, dict(zip(self.names, means.unbind(), strict=True))
