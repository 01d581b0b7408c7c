"""Reward terms: the paper's Table I, and the few that lead to a walk and keep the feet lifting.

Each term is a pure function of `Motion`, without weight, named as its field in `RewardsCfg`. The
sum is r = beta r_phase + (1 - k beta) r_task + r_other (paper, eq. 6).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields

import torch

__all__ = ["GROUPS", "TERMS", "Motion", "RewardSum", "RewardsCfg"]


@dataclass(slots=True)
class Motion:
    """What one control step looked like, for the reward. Velocities in m/s, angles in rad."""

    command: torch.Tensor
    """(v_x, v_y, w_z, beta). Shape: (num_envs, 4)."""
    base_lin_vel: torch.Tensor
    """Trunk velocity in the body frame. Shape: (num_envs, 3)."""
    base_ang_vel: torch.Tensor
    """Trunk angular velocity in the body frame. Shape: (num_envs, 3)."""
    projected_gravity: torch.Tensor
    """Direction of gravity in the body frame. Shape: (num_envs, 3)."""
    base_height: torch.Tensor
    """Trunk height above the ground, m. Shape: (num_envs,)."""
    joint_pos: torch.Tensor
    """Joint positions relative to the stance. Shape: (num_envs, 12)."""
    joint_vel: torch.Tensor
    """Joint velocities. Shape: (num_envs, 12)."""
    joint_acc: torch.Tensor
    """Joint accelerations over the control step, rad/s^2. Shape: (num_envs, 12)."""
    torque: torch.Tensor
    """Joint torques, N m. Shape: (num_envs, 12)."""
    action: torch.Tensor
    """Action of this step. Shape: (num_envs, 12)."""
    last_action: torch.Tensor
    """Action one step before. Shape: (num_envs, 12)."""
    action_before_last: torch.Tensor
    """Action two steps before. Shape: (num_envs, 12)."""
    collisions: torch.Tensor
    """Number of links other than feet that touch the ground. Shape: (num_envs,)."""
    phase: torch.Tensor
    """Phase of each foot that the phase terms use. Shape: (num_envs, 4)."""
    foot_drop_sq: torch.Tensor
    """Mean over the physics steps of max(-v_z, 0)^2, world frame. Shape: (num_envs, 4)."""
    foot_raise_sq: torch.Tensor
    """Mean over the physics steps of max(v_z, 0)^2, world frame. Shape: (num_envs, 4)."""
    foot_speed_xy: torch.Tensor
    """Horizontal speed of each foot. Shape: (num_envs, 4)."""
    foot_height: torch.Tensor
    """Clearance under each foot, m. Shape: (num_envs, 4)."""
    contact: torch.Tensor
    """Debounced contact of each foot, bool. Shape: (num_envs, 4)."""
    touchdown: torch.Tensor
    """Feet that landed, bool. Shape: (num_envs, 4)."""
    landing_speed: torch.Tensor
    """Landing speed of the feet that landed, else 0. Shape: (num_envs, 4)."""
    swing_apex: torch.Tensor
    """Highest clearance of the current or last swing, m. Shape: (num_envs, 4)."""
    fallen: torch.Tensor
    """Robots whose episode this step ends by a fall, bool. Shape: (num_envs,)."""


@dataclass
class RewardsCfg:
    """Weights, per second of reward; 0 leaves a term out. Defaults are the paper's Table I."""

    lin_vel_tracking: float = 1.0
    """exp(-4 |v_xy^cmd - v_xy|^2)."""
    ang_vel_tracking: float = 0.5
    """exp(-4 (w_z^cmd - w_z)^2)."""
    foot_drop_velocity: float = -0.05
    """sum over feet of exp(phase) v_drop^2."""
    foot_raise_velocity: float = 0.01
    """sum over feet of exp(-phase) v_raise^2."""
    near_ground_drop: float = 0.0
    """sum over feet of exp(-height / 2 cm) v_drop^2; not in the paper."""
    landing_speed: float = 0.0
    """sum over the feet that land of the landing speed squared; not in the paper."""
    lin_vel_z: float = -2.0
    """v_z^2."""
    ang_vel_xy: float = -0.05
    """|w_xy|^2."""
    joint_power: float = -2.0e-5
    """sum over joints of |torque| |velocity|."""
    joint_acc: float = -2.5e-7
    """|joint acceleration|^2."""
    action_rate: float = -0.01
    """|a_t - a_{t-1}|^2."""
    collision: float = -0.1
    """Number of links other than feet in contact."""
    base_height: float = -1.0
    """(desired height - height)^2."""
    orientation: float = -0.2
    """|g_xy|^2."""
    smoothness: float = 0.0
    """|a_t - 2 a_{t-1} + a_{t-2}|^2; DreamWaQ's."""
    power_distribution: float = 0.0
    """Variance over joints of torque times velocity; DreamWaQ's."""
    foot_clearance: float = 0.0
    """sum over feet of (target - clearance)^2 |v_xy|; DreamWaQ's."""
    touchdown_apex: float = 0.0
    """sum over the feet that land of max(1 - apex / target, 0), while asked to move."""
    foot_slip: float = 0.0
    """sum over the feet in contact of |v_xy|^2."""
    stand_still: float = 0.0
    """sum over joints of the distance to the stance, while asked to stand."""
    tilt: float = 0.0
    """|g_xy|^2 once more, in the lift group: a first step is not taken level."""
    diagonal_support: float = 0.0
    """half |c_FR + c_RL - c_FL - c_RR| of the contacts c, unless asked to stand; not in the paper.
    It counts while `guide_ramp` lasts."""
    fall: float = 0.0
    """1 in the step that ends an episode by a fall; not in the paper."""

    k: float = 0.2
    """How much of the task reward beta = 1 gives up (paper, section II-C)."""
    desired_height: float = 0.30
    """Height of the trunk above the ground, m."""
    clearance_target: float = 0.06
    """Clearance of a foot in swing, m."""
    apex_target: float = 0.04
    """Apex that a swing should reach, m."""
    phase_source: str = "estimated"
    """'estimated' (the paper's) or 'true' (the causal phase, for ablation)."""
    quiet_ramp: tuple[float, float] = (0.0, 0.0)
    """Seconds of simulated time per environment between which the phase group's weight grows from
    0 to 1: a full-strength quiet term from the first step teaches the robot to stand still."""
    lift_ramp: tuple[float, float] = (0.0, 0.0)
    """The same for the lift group: shuffling and falling, which it forbids, are how walking
    begins."""
    guide_ramp: tuple[float, float] = (0.0, 0.0)
    """The same for the guide group, whose weight falls from 1 to 0: once the robot walks, its gait
    is its own. With (0, 0) it has none."""

    def __post_init__(self) -> None:
        """Check what the weights cannot express.

        Raises:
            ValueError: If a field is out of its range.
        """
        if self.phase_source not in ("estimated", "true"):
            raise ValueError(
                f"rewards.phase_source must be 'estimated' or 'true', got {self.phase_source!r}"
            )
        for name, value in vars(self).items():
            numbers = value if isinstance(value, tuple | list) else (value,)
            if name != "phase_source" and not all(map(math.isfinite, numbers)):
                raise ValueError(f"rewards.{name} must be finite, got {value}")
        if not 0.0 <= self.k <= 1.0:
            raise ValueError(f"rewards.k must be in [0, 1], got {self.k}")
        for name in ("quiet_ramp", "lift_ramp", "guide_ramp"):
            start, end = getattr(self, name)
            if not 0.0 <= start <= end:
                raise ValueError(
                    f"rewards.{name} must be (start, end) with 0 <= start <= end, "
                    f"got {(start, end)}"
                )
        if self.diagonal_support != 0.0 and self.guide_ramp[1] == 0.0:
            raise ValueError(
                "rewards.guide_ramp must end after 0 s where rewards.diagonal_support is "
                f"{self.diagonal_support}, got {self.guide_ramp}"
            )
        for name in ("desired_height", "clearance_target", "apex_target"):
            if getattr(self, name) <= 0.0:
                raise ValueError(f"rewards.{name} must be > 0, got {getattr(self, name)}")


def _asked_to_move(motion: Motion) -> torch.Tensor:
    """Return which robots have a command other than to stand. Shape: (num_envs,)."""
    return (motion.command[:, :3] != 0.0).any(dim=1)


def lin_vel_tracking(motion: Motion, cfg: RewardsCfg) -> torch.Tensor:
    """Reward the commanded horizontal velocity."""
    error = (motion.command[:, :2] - motion.base_lin_vel[:, :2]).square().sum(dim=1)
    return torch.exp(-4.0 * error)


def ang_vel_tracking(motion: Motion, cfg: RewardsCfg) -> torch.Tensor:
    """Reward the commanded yaw rate."""
    return torch.exp(-4.0 * (motion.command[:, 2] - motion.base_ang_vel[:, 2]).square())


def foot_drop_velocity(motion: Motion, cfg: RewardsCfg) -> torch.Tensor:
    """Penalise feet that move down, most just before contact (paper, eq. 8)."""
    return (motion.phase.exp() * motion.foot_drop_sq).sum(dim=1)


def foot_raise_velocity(motion: Motion, cfg: RewardsCfg) -> torch.Tensor:
    """Reward feet that move up, most just after foot-off (paper, eq. 8)."""
    return ((-motion.phase).exp() * motion.foot_raise_sq).sum(dim=1)


def near_ground_drop(motion: Motion, cfg: RewardsCfg) -> torch.Tensor:
    """Penalise feet that move down close to the ground, whatever the phase."""
    return (torch.exp(-motion.foot_height.clamp(min=0.0) / 0.02) * motion.foot_drop_sq).sum(dim=1)


def landing_speed(motion: Motion, cfg: RewardsCfg) -> torch.Tensor:
    """Penalise each landing by its speed squared, to which the impact's energy is proportional."""
    return motion.landing_speed.square().sum(dim=1)


def lin_vel_z(motion: Motion, cfg: RewardsCfg) -> torch.Tensor:
    """Penalise a bouncing trunk."""
    return motion.base_lin_vel[:, 2].square()


def ang_vel_xy(motion: Motion, cfg: RewardsCfg) -> torch.Tensor:
    """Penalise a rolling and pitching trunk."""
    return motion.base_ang_vel[:, :2].square().sum(dim=1)


def joint_power(motion: Motion, cfg: RewardsCfg) -> torch.Tensor:
    """Penalise mechanical power at the joints."""
    return (motion.torque * motion.joint_vel).abs().sum(dim=1)


def joint_acc(motion: Motion, cfg: RewardsCfg) -> torch.Tensor:
    """Penalise joint accelerations."""
    return motion.joint_acc.square().sum(dim=1)


def action_rate(motion: Motion, cfg: RewardsCfg) -> torch.Tensor:
    """Penalise changes of the action."""
    return (motion.action - motion.last_action).square().sum(dim=1)


def collision(motion: Motion, cfg: RewardsCfg) -> torch.Tensor:
    """Count the links other than feet that touch the ground."""
    return motion.collisions


def base_height(motion: Motion, cfg: RewardsCfg) -> torch.Tensor:
    """Penalise a trunk off its desired height."""
    return (cfg.desired_height - motion.base_height).square()


def orientation(motion: Motion, cfg: RewardsCfg) -> torch.Tensor:
    """Penalise a tilted trunk."""
    return motion.projected_gravity[:, :2].square().sum(dim=1)


def smoothness(motion: Motion, cfg: RewardsCfg) -> torch.Tensor:
    """Penalise the second difference of the actions."""
    second = motion.action - 2.0 * motion.last_action + motion.action_before_last
    return second.square().sum(dim=1)


def power_distribution(motion: Motion, cfg: RewardsCfg) -> torch.Tensor:
    """Penalise power that is spread unevenly over the joints."""
    power = motion.torque * motion.joint_vel
    # Not `var`, which takes ten times as long over rows this short on a CPU.
    return (power - power.mean(dim=1, keepdim=True)).square().mean(dim=1)


def foot_clearance(motion: Motion, cfg: RewardsCfg) -> torch.Tensor:
    """Penalise feet that travel off their target clearance."""
    error = (cfg.clearance_target - motion.foot_height).square()
    return (error * motion.foot_speed_xy).sum(dim=1)


def touchdown_apex(motion: Motion, cfg: RewardsCfg) -> torch.Tensor:
    """Penalise, at landing, a swing that stayed below its target."""
    missing = (1.0 - motion.swing_apex / cfg.apex_target).clamp(min=0.0)
    return (missing * motion.touchdown).sum(dim=1) * _asked_to_move(motion)


def foot_slip(motion: Motion, cfg: RewardsCfg) -> torch.Tensor:
    """Penalise feet that slide while in contact."""
    return (motion.foot_speed_xy.square() * motion.contact).sum(dim=1)


def stand_still(motion: Motion, cfg: RewardsCfg) -> torch.Tensor:
    """Penalise leaving the stance while asked to stand."""
    standing = ~_asked_to_move(motion)
    return motion.joint_pos.abs().sum(dim=1) * standing


def tilt(motion: Motion, cfg: RewardsCfg) -> torch.Tensor:
    """Penalise a tilted trunk, as `orientation` does."""
    return orientation(motion, cfg)


def fall(motion: Motion, cfg: RewardsCfg) -> torch.Tensor:
    """Penalise a fall.

    Where the other terms leave little to gain, as a high beta does at a fast command, ending the
    episode would cost nothing else.
    """
    return motion.fallen.float()


def diagonal_support(motion: Motion, cfg: RewardsCfg) -> torch.Tensor:
    """Reward the difference between the diagonals: 1 for standing on one alone, as a trot does.

    Two feet balance a robot for as long as it takes to tip over, so it has to step to earn that.
    One foot off the ground, or one on it, earns half.
    """
    front_right, front_left, rear_right, rear_left = motion.contact.float().unbind(dim=1)
    difference = front_right + rear_left - front_left - rear_right
    return 0.5 * difference.abs() * _asked_to_move(motion)


Term = Callable[[Motion, RewardsCfg], torch.Tensor]

GROUPS: dict[str, tuple[Term, ...]] = {
    "task": (lin_vel_tracking, ang_vel_tracking),
    "phase": (foot_drop_velocity, foot_raise_velocity, near_ground_drop, landing_speed),
    "other": (
        lin_vel_z,
        ang_vel_xy,
        joint_power,
        joint_acc,
        action_rate,
        collision,
        base_height,
        orientation,
        smoothness,
        power_distribution,
    ),
    "lift": (foot_clearance, touchdown_apex, foot_slip, stand_still, tilt, fall),
    "guide": (diagonal_support,),
}
"""Terms by the factor they get: (1 - k beta), beta times a ramp, 1, a ramp, and one that falls."""

TERMS: dict[str, Term] = {term.__name__: term for terms in GROUPS.values() for term in terms}
"""Every term by its name, which is its weight's field in `RewardsCfg`."""


class RewardSum:
    """Evaluates the terms that have a weight and adds them up."""

    def __init__(
        self, cfg: RewardsCfg, step_dt: float, num_envs: int, device: torch.device
    ) -> None:
        """Choose the terms with a weight.

        Args:
            cfg: Weights and constants.
            step_dt: Control period, s; weights are per second.
            num_envs: Number of environments.
            device: Device of the result.
        """
        assert {f.name for f in fields(cfg)} >= set(TERMS)
        self.cfg = cfg
        self.names: list[str] = []
        self._terms: list[Term] = []
        self._rows: dict[str, slice] = {}
        for group, terms in GROUPS.items():
            start = len(self.names)
            for term in terms:
                if getattr(cfg, term.__name__) != 0.0:
                    self.names.append(term.__name__)
                    self._terms.append(term)
            self._rows[group] = slice(start, len(self.names))
        weights = [getattr(cfg, name) * step_dt for name in self.names]
        self._weights = torch.tensor(weights, device=device).unsqueeze(1)
        self._values = torch.zeros(len(self.names), num_envs, device=device)
        self._step_dt = step_dt

    def __call__(
        self, motion: Motion, quiet: float, lift: float, guide: float
    ) -> tuple[torch.Tensor, dict[str, torch.Tensor]]:
        """Return the reward of a control step and each term's share of it.

        Args:
            motion: The control step.
            quiet: Curriculum factor in [0, 1] on the phase group.
            lift: Curriculum factor in [0, 1] on the lift group.
            guide: Curriculum factor in [0, 1] on the guide group.

        Returns:
            The reward, shape (num_envs,), and by name each term's mean over the environments with
            its weight and group factor, per second, as scalars.
        """
        for row, term in zip(self._values, self._terms, strict=True):
            row.copy_(term(motion, self.cfg))
        weighted = self._values.mul_(self._weights)
        beta = motion.command[:, 3]
        weighted[self._rows["task"]] *= 1.0 - self.cfg.k * beta
        weighted[self._rows["phase"]] *= quiet * beta
        weighted[self._rows["lift"]] *= lift
        weighted[self._rows["guide"]] *= guide
        means = weighted.mean(dim=1) / self._step_dt
        return weighted.sum(dim=0), dict(zip(self.names, means.unbind(), strict=True))
