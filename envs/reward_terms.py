"""Reward functions: the paper's Table I, the few that lead to a walk, and how more are added.

Each is a pure function of `Motion` and of numbers that a task may set, without weight. Which of
them a task uses, how much each weighs and what scales it is `rewards`' business.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Literal, get_args

import torch

from mute.support.ranges import Range, check_number

from .motion import Motion

__all__ = ["REWARD_FUNCTIONS", "Group", "Parameter", "RewardFunction", "register_term"]

Group = Literal["task", "phase", "other", "lift", "guide"]
"""What scales a term: (1 - k beta), beta times a ramp, 1, a ramp, or a ramp that falls."""

Function = Callable[..., torch.Tensor]


_ANY = Range(-1e9, 1e9)
_POSITIVE = Range(1e-6, 1e9)
"""Nothing that single precision would make zero or infinite of."""


@dataclass(frozen=True)
class Parameter:
    """A number that a reward function takes beside the motion."""

    default: float
    """Its value unless a task says otherwise."""
    text: str
    """What it is, with its unit."""
    allowed: Range = _ANY
    """What it may be; every number up to 1e9, of either sign, by default."""


@dataclass(frozen=True)
class RewardFunction:
    """A reward function and what is known of it."""

    function: Function
    """Takes the motion and its parameters by name; returns one number a robot, (num_envs,)."""
    group: Group
    """What scales it, unless a task says otherwise."""
    parameters: Mapping[str, Parameter]
    """Its parameters by name."""

    @property
    def text(self) -> str:
        """Its documentation, in one paragraph."""
        return " ".join((inspect.getdoc(self.function) or "").split())

    def with_parameters(self, values: Mapping[str, float]) -> Callable[[Motion], torch.Tensor]:
        """Return it as a function of the motion alone."""
        return partial(self.function, **values)


_functions: dict[str, RewardFunction] = {}

REWARD_FUNCTIONS: Mapping[str, RewardFunction] = MappingProxyType(_functions)
"""Every reward function by its name."""


def register_term(
    group: Group = "other", **parameters: Parameter
) -> Callable[[Function], Function]:
    """Return a decorator that makes a function known to tasks by its name.

    Args:
        group: What scales it, unless a task says otherwise.
        parameters: What it takes by name beside the motion.

    Raises:
        ValueError: If the group is unknown. Of the decorator, if the name is taken or none of
            Python's, a default out of its range, or the function takes something else.
    """
    if group not in get_args(Group):
        allowed = ", ".join(get_args(Group))
        raise ValueError(f"register_term: group must be one of {allowed}, got {group!r}")

    def register(function: Function) -> Function:
        name = getattr(function, "__name__", type(function).__name__)
        if name in _functions or not inspect.isfunction(function) or not name.isidentifier():
            taken = name in _functions
            reason = "is registered already" if taken else "is no function with a name of its own"
            raise ValueError(f"the reward function {name!r} {reason}; give it another name")
        _check_parameters(name, function, parameters)
        _functions[name] = RewardFunction(function, group, MappingProxyType(parameters))
        return function

    return register


def _check_parameters(name: str, function: Function, parameters: Mapping[str, Parameter]) -> None:
    """Refuse parameters that the function does not take by name beside the motion."""
    signature = inspect.signature(function)
    taken = list(signature.parameters)[1:]
    try:
        signature.bind(None, **dict.fromkeys(parameters))
    except TypeError:
        fits = False
    else:
        fits = taken == list(parameters)
    if not fits:
        raise ValueError(
            f"{name} must take the motion and then its parameters by name, got "
            f"{name}{signature} registered with {list(parameters)}"
        )
    for parameter_name, parameter in parameters.items():
        place = f"{name}.{parameter_name}"
        if parameter_name in _RESERVED:
            raise ValueError(f"{place} must have another name: a term has a {parameter_name}")
        if not isinstance(parameter, Parameter):
            raise ValueError(f"{place} must be a Parameter, got {parameter!r}")
        check_number(place, parameter.default, parameter.allowed)


_RESERVED = ("function", "weight", "group")
"""What `rewards.reward_term` takes beside a function's parameters."""


_SHARPNESS = "inverse of the squared error at which 1/e of it is left"


@register_term("task", sharpness=Parameter(4.0, f"{_SHARPNESS}, s^2/m^2", _POSITIVE))
def lin_vel_tracking(motion: Motion, sharpness: float) -> torch.Tensor:
    """Reward the commanded horizontal velocity: exp(-sharpness |v_xy^cmd - v_xy|^2)."""
    return torch.exp(-sharpness * _lin_vel_error_sq(motion))


@register_term("task", sharpness=Parameter(4.0, f"{_SHARPNESS}, s^2/rad^2", _POSITIVE))
def ang_vel_tracking(motion: Motion, sharpness: float) -> torch.Tensor:
    """Reward the commanded yaw rate: exp(-sharpness (w_z^cmd - w_z)^2)."""
    return torch.exp(-sharpness * _ang_vel_error_sq(motion))


_SHARE = Parameter(0.35, "share of the commanded speed by which the width grows", Range(0.0, 10.0))


@register_term(
    "task",
    width=Parameter(0.06, "error at which 1/e is left where none is asked for, m/s", _POSITIVE),
    share=_SHARE,
)
def lin_vel_following(motion: Motion, width: float, share: float) -> torch.Tensor:
    """Reward the commanded horizontal velocity, as sharply when it is slow as when it is fast.

    exp(-|e_xy|^2 / (width^2 + share^2 |v_xy^cmd|^2)) of the averaged error e; not in the paper,
    whose term pays 96 % of its reward for standing when 0.1 m/s is asked for.
    """
    asked_sq = motion.command[:, :2].square().sum(dim=1)
    error_sq = motion.velocity_error[:, :2].square().sum(dim=1)
    return torch.exp(-error_sq / (width**2 + share**2 * asked_sq))


@register_term(
    "task",
    width=Parameter(0.1, "error at which 1/e is left where none is asked for, rad/s", _POSITIVE),
    share=_SHARE,
)
def ang_vel_following(motion: Motion, width: float, share: float) -> torch.Tensor:
    """Reward the commanded yaw rate, as sharply when it is slow as when it is fast.

    exp(-e_z^2 / (width^2 + share^2 (w_z^cmd)^2)) of the averaged error e; not in the paper.
    """
    asked_sq = motion.command[:, 2].square()
    error_sq = motion.velocity_error[:, 2].square()
    return torch.exp(-error_sq / (width**2 + share**2 * asked_sq))


@register_term("task")
def progress(motion: Motion) -> torch.Tensor:
    """Reward the commanded way, as much for a speed of half as for each other half of it.

    1 - e_c / |v_xy^cmd| of what is missing along the command, e_c, from -1 to 1, while asked to go;
    not in the paper. Where a robot is slow, on stairs, the sharp terms pay hardly more for twice
    the speed.
    """
    speed = motion.command[:, :2].norm(dim=1)
    missing = (motion.command[:, :2] * motion.velocity_error[:, :2]).sum(dim=1)
    share = missing / speed.square().clamp(min=1e-6)
    return (1.0 - share.clamp(0.0, 2.0)) * (speed > 0.0)


@register_term("task", most=Parameter(0.3, "drift from which on it costs no more", _POSITIVE))
def yaw_drift(motion: Motion, most: float) -> torch.Tensor:
    """Penalise a heading that drifts from the one asked for: |yaw rate missing|, averaged over 2 s.

    Not in the paper. 0.05 rad/s, next to nothing to the other terms, are 57 degrees in 20 s.
    """
    return motion.yaw_drift.abs().clamp(max=most)


@register_term("phase")
def foot_drop_velocity(motion: Motion) -> torch.Tensor:
    """Penalise feet that move down, most just before contact (paper, eq. 8).

    Sum over feet of exp(phase) v_drop^2.
    """
    return (motion.phase.exp() * motion.foot_drop_sq).sum(dim=1)


@register_term("phase")
def foot_raise_velocity(motion: Motion) -> torch.Tensor:
    """Reward feet that move up, most just after foot-off (paper, eq. 8).

    Sum over feet of exp(-phase) v_raise^2.
    """
    return ((-motion.phase).exp() * motion.foot_raise_sq).sum(dim=1)


@register_term("phase", depth=Parameter(0.02, "height at which 1/e of it is left, m", _POSITIVE))
def near_ground_drop(motion: Motion, depth: float) -> torch.Tensor:
    """Penalise feet that move down close to the ground, whatever the phase; not in the paper.

    Sum over feet of exp(-height / depth) v_drop^2.
    """
    return (torch.exp(-motion.foot_height.clamp(min=0.0) / depth) * motion.foot_drop_sq).sum(dim=1)


@register_term("phase")
def landing_speed(motion: Motion) -> torch.Tensor:
    """Penalise each landing by its speed squared, to which the impact's energy is proportional.

    Sum over the feet that land; not in the paper.
    """
    return motion.landing_speed.square().sum(dim=1)


@register_term(
    "phase", most=Parameter(0.3, "change of speed from which on it costs no more, m/s", _POSITIVE)
)
def foot_speed_change(motion: Motion, most: float) -> torch.Tensor:
    """Penalise feet whose vertical speed changes, as a blow makes it, up to a bound.

    Sum over feet of the mean of min(change, most)^2 from each physics step to the next; after
    Mueller et al., "Olaf", 2025 (arXiv 2512.16705), who take it between control steps.
    """
    change = motion.foot_vel_z_substeps.diff(dim=0).abs().clamp(max=most)
    return change.square().mean(dim=0).sum(dim=1)


@register_term("phase")
def landing_load(motion: Motion) -> torch.Tensor:
    """Penalise feet by the force that they land with, in weights of the robot, squared.

    Sum over the feet that are not known to stand yet of the largest vertical force in the control
    step; after Hu et al., "QuietWalk", 2026 (arXiv 2604.23702), who estimate it. Needs
    `env.scene.foot_forces`.
    """
    assert motion.foot_load is not None  # the environment's configuration sees to it
    # A foot is known to stand some physics steps after the blow, and carries the robot by then.
    return (motion.foot_load.square() * ~motion.contact).sum(dim=1)


@register_term()
def lin_vel_z(motion: Motion) -> torch.Tensor:
    """Penalise a bouncing trunk: v_z^2."""
    return motion.base_lin_vel[:, 2].square()


@register_term()
def ang_vel_xy(motion: Motion) -> torch.Tensor:
    """Penalise a rolling and pitching trunk: |w_xy|^2."""
    return motion.base_ang_vel[:, :2].square().sum(dim=1)


@register_term()
def joint_power(motion: Motion) -> torch.Tensor:
    """Penalise mechanical power: sum over joints of |torque| |velocity|."""
    return (motion.torque * motion.joint_vel).abs().sum(dim=1)


@register_term()
def joint_acc(motion: Motion) -> torch.Tensor:
    """Penalise joint accelerations: their sum of squares."""
    return motion.joint_acc.square().sum(dim=1)


@register_term()
def action_rate(motion: Motion) -> torch.Tensor:
    """Penalise changes of the action: |a_t - a_{t-1}|^2."""
    return (motion.action - motion.last_action).square().sum(dim=1)


@register_term()
def collision(motion: Motion) -> torch.Tensor:
    """Count the links other than feet that touch the ground."""
    return motion.collisions


@register_term(desired=Parameter(0.30, "height of the trunk above the ground, m", _POSITIVE))
def base_height(motion: Motion, desired: float) -> torch.Tensor:
    """Penalise a trunk off its desired height: (desired - height)^2."""
    return (desired - motion.base_height).square()


@register_term()
def orientation(motion: Motion) -> torch.Tensor:
    """Penalise a tilted trunk: |g_xy|^2."""
    return motion.projected_gravity[:, :2].square().sum(dim=1)


@register_term()
def lean(motion: Motion) -> torch.Tensor:
    """Penalise a trunk that is tilted against the ground under its feet: on the level, |g_xy|^2.

    On stairs a trunk that follows them leans by nothing; not in the paper. Along ground that rises
    by s_x a metre along the heading and s_y to the left, gravity in the body frame is
    -s_x / sqrt(1 + s_x^2) and -s_y / (sqrt(1 + s_x^2) sqrt(1 + |s|^2)).
    """
    ahead, left = motion.ground_slope.unbind(dim=1)
    steep = 1.0 / (1.0 + ahead.square()).sqrt()
    gravity_x = -ahead * steep
    gravity_y = -left * steep / (1.0 + ahead.square() + left.square()).sqrt()
    away_x = motion.projected_gravity[:, 0] - gravity_x
    away_y = motion.projected_gravity[:, 1] - gravity_y
    return away_x.square() + away_y.square()


@register_term()
def smoothness(motion: Motion) -> torch.Tensor:
    """Penalise the second difference of the actions: |a_t - 2 a_{t-1} + a_{t-2}|^2; DreamWaQ's."""
    second = motion.action - 2.0 * motion.last_action + motion.action_before_last
    return second.square().sum(dim=1)


@register_term()
def power_distribution(motion: Motion) -> torch.Tensor:
    """Penalise power that is spread unevenly over the joints: its variance; DreamWaQ's."""
    power = motion.torque * motion.joint_vel
    # Not `var`, which takes ten times as long over rows this short on a CPU.
    return (power - power.mean(dim=1, keepdim=True)).square().mean(dim=1)


@register_term("lift", target=Parameter(0.06, "clearance of a foot in swing, m", _POSITIVE))
def foot_clearance(motion: Motion, target: float) -> torch.Tensor:
    """Penalise feet that travel off their target clearance; DreamWaQ's.

    Sum over feet of (target - clearance)^2 |v_xy|, above the highest ground near the foot.
    """
    error = (target - motion.foot_lift).square()
    return (error * motion.foot_speed_xy).sum(dim=1)


@register_term("lift", target=Parameter(0.04, "apex that a swing should reach, m", _POSITIVE))
def touchdown_apex(motion: Motion, target: float) -> torch.Tensor:
    """Penalise, at landing, a swing that stayed below its target.

    Sum over the feet that land of max(1 - apex / target, 0), while asked to move.
    """
    missing = 1.0 - _lift_share(motion, target)
    return (missing * motion.touchdown).sum(dim=1) * _asked_to_move(motion)


@register_term("lift")
def foot_slip(motion: Motion) -> torch.Tensor:
    """Penalise feet that slide: sum over the feet in contact of |v_xy|^2."""
    return (motion.foot_speed_xy.square() * motion.contact).sum(dim=1)


@register_term("lift")
def stand_still(motion: Motion) -> torch.Tensor:
    """Penalise leaving the stance while asked to stand: sum over joints of the distance to it."""
    standing = ~_asked_to_move(motion)
    return motion.joint_pos.abs().sum(dim=1) * standing


@register_term(
    "lift", speed=Parameter(0.2, "speed of the trunk at which 1/e of it is left, m/s", _POSITIVE)
)
def feet_lifted(motion: Motion, speed: float) -> torch.Tensor:
    """Count the feet off the ground while asked to stand; not in the paper.

    Marching on the spot keeps the stance on average, and is no silence. Times
    exp(-(|v_xy| / speed)^2): a robot that still moves, or was pushed, has to step lest it falls.
    """
    lifted = (~motion.contact).sum(dim=1).float() * ~_asked_to_move(motion)
    return lifted * torch.exp(-motion.base_lin_vel[:, :2].square().sum(dim=1) / speed**2)


@register_term("lift")
def fall(motion: Motion) -> torch.Tensor:
    """Penalise a fall: 1 in the step that ends an episode by one; not in the paper.

    Where the other terms leave little to gain, as a high beta does at a fast command, ending the
    episode would cost nothing else.
    """
    return motion.fallen.float()


@register_term("guide")
def diagonal_support(motion: Motion) -> torch.Tensor:
    """Reward the difference between the diagonals: 1 for standing on one alone, as a trot does.

    Half |c_FR + c_RL - c_FL - c_RR| of the contacts c, unless asked to stand; not in the paper. Two
    feet balance a robot for as long as it takes to tip over, so it has to step to earn that. One
    foot off the ground, or one on it, earns half.
    """
    front_right, front_left, rear_right, rear_left = motion.contact.float().unbind(dim=1)
    difference = front_right + rear_left - front_left - rear_right
    return 0.5 * difference.abs() * _asked_to_move(motion)


_PERIOD = Parameter(0.8, "time between a foot's landings up to which it earns, s", _POSITIVE)
_FULL_APEX = Parameter(0.04, "apex from which on a swing earns in full, m", _POSITIVE)


@register_term("task", period=_PERIOD, target=_FULL_APEX)
def stepping(motion: Motion, period: float, target: float) -> torch.Tensor:
    """Reward steps, as long as they lift the feet, and no kind of steps more than another.

    Sum over the feet that land of min(stride time, period) min(apex / target, 1), while asked to
    move; not in the paper. However often a foot lands, once a period or more, it earns the same: a
    reward for air under the feet would shorten the landings, and one for each step hasten them.
    """
    return _step_time(motion, period, target).sum(dim=1) * _asked_to_move(motion)


@register_term(
    "phase",
    speed=Parameter(0.4, "landing speed at which 1/e of it is left, m/s", _POSITIVE),
    period=_PERIOD,
    target=_FULL_APEX,
)
def soft_steps(motion: Motion, speed: float, period: float, target: float) -> torch.Tensor:
    """Reward steps as `stepping` does, the more the softer they land.

    Its share of each landing is exp(-(landing speed / speed)^2); not in the paper. A penalty on
    landings is cut by landing seldom, and most by standing; this one is earned by soft steps alone.
    """
    softness = torch.exp(-motion.landing_speed.square() / speed**2)
    earned = _step_time(motion, period, target) * softness
    return earned.sum(dim=1) * _asked_to_move(motion)


@register_term(
    "lift",
    above=Parameter(0.6, "landing speed from which on it counts, m/s", Range(0.0, 100.0)),
)
def stamping(motion: Motion, above: float) -> torch.Tensor:
    """Penalise hard landings alone: the square of what is above a landing speed.

    Sum over the feet that land; not in the paper. What lands softer than that is left to the terms
    of the quiet factor.
    """
    return (motion.landing_speed - above).clamp(min=0.0).square().sum(dim=1)


def _lin_vel_error_sq(motion: Motion) -> torch.Tensor:
    """Return |v_xy^cmd - v_xy|^2, (m/s)^2. Shape: (num_envs,)."""
    return (motion.command[:, :2] - motion.base_lin_vel[:, :2]).square().sum(dim=1)


def _ang_vel_error_sq(motion: Motion) -> torch.Tensor:
    """Return (w_z^cmd - w_z)^2, (rad/s)^2. Shape: (num_envs,)."""
    return (motion.command[:, 2] - motion.base_ang_vel[:, 2]).square()


def _lift_share(motion: Motion, target: float) -> torch.Tensor:
    """Return what of a target, in m, each swing's apex reaches, at most 1. Shape: (num_envs, 4)."""
    return (motion.swing_apex / target).clamp(max=1.0)


def _step_time(motion: Motion, period: float, target: float) -> torch.Tensor:
    """Return what each step earns, s: its stride time by its lift. Shape: (num_envs, 4)."""
    return motion.stride_time.clamp(max=period) * _lift_share(motion, target)


def _asked_to_move(motion: Motion) -> torch.Tensor:
    """Return which robots have a command other than to stand. Shape: (num_envs,)."""
    return (motion.command[:, :3] != 0.0).any(dim=1)
