"""How a robot walks, in figures: speed, tracking, landings, swings, power, falls.

Quiet is only worth something beside the gait that it is bought with: a robot that shuffles or
stands is silent. So the figures come together, always.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import torch

from mute.envs.quadruped_env import QuadrupedEnv

__all__ = ["Gait", "GaitMeter"]


@dataclass
class Gait:
    """Figures over some robots and some time. NaN where nothing happened to measure."""

    speed: float
    """Mean forward speed, body frame, m/s."""
    velocity_error_sq: float
    """Mean of |v_xy^cmd - v_xy|^2, (m/s)^2."""
    yaw_rate_error_sq: float
    """Mean of (w_z^cmd - w_z)^2, (rad/s)^2."""
    landing_speed_mean: float
    """Mean over landings of the largest downward speed in the 20 ms before contact, m/s."""
    landing_speed_rms: float
    """Root mean square of the same, m/s: impact energy goes with its square."""
    apex_mean: float
    """Mean over swings of the highest clearance, m."""
    duty_factor: float
    """Share of the time that a foot is on the ground."""
    stride_frequency: float
    """Landings of a foot per second, Hz."""
    power: float
    """Mean over time of the sum over joints of |torque times velocity|, W."""
    fall_rate: float
    """Share of the robots that fell at least once."""
    unstable: int
    """Times that a simulation blew up and was reset, which is no fall."""
    invalid_actions: int
    """Control steps of a robot whose action held NaN or infinity."""

    def as_dict(self) -> dict[str, float]:
        """Return the figures by name."""
        return asdict(self)


class GaitMeter:
    """Adds up what an environment's robots do, step by step."""

    def __init__(self, env: QuadrupedEnv, settle_time: float = 1.0) -> None:
        """Start at zero.

        Args:
            env: The environment to read after each of its steps.
            settle_time: Time after the start of each episode that is not measured, s; falls are,
                and so is what went wrong.
        """
        self._env = env
        self._settle_steps = round(settle_time / env.step_dt)
        self._sums = torch.zeros(len(_SUMS), env.num_envs, dtype=torch.float64)
        self._fallen = torch.zeros(env.num_envs, dtype=torch.bool)
        self._unstable = torch.zeros(env.num_envs, dtype=torch.long)
        self._invalid_actions = torch.zeros(env.num_envs, dtype=torch.long)
        self._age = torch.zeros(env.num_envs, dtype=torch.long)

    def update(self, command: torch.Tensor, dones: torch.Tensor) -> None:
        """Take in the step that the environment has just made.

        Args:
            command: Commands that were in force during the step. Shape: (num_envs, 4).
            dones: Episodes that ended in it. Shape: (num_envs,).
        """
        env, feet = self._env, self._env.footfalls
        self._age += 1
        # Of an episode that has just ended the state is the next one's already.
        measured = (self._age > self._settle_steps) & ~dones
        landed = feet.touchdown
        values = torch.stack(
            (
                torch.ones(env.num_envs),
                env.base_lin_vel[:, 0],
                (command[:, :2] - env.base_lin_vel[:, :2]).square().sum(dim=1),
                (command[:, 2] - env.base_ang_vel[:, 2]).square(),
                landed.sum(dim=1).float(),
                feet.landing_speed.sum(dim=1),
                feet.landing_speed.square().sum(dim=1),
                (feet.swing_apex * landed).sum(dim=1),
                feet.contact_share.mean(dim=1),
                env.power,
            )
        )
        self._sums += torch.where(measured, values, 0.0)
        self._fallen |= env.fallen
        self._unstable += env.unstable
        self._invalid_actions += env.invalid_action
        self._age.masked_fill_(dones, 0)

    def gait(self, chosen: torch.Tensor | None = None) -> Gait:
        """Return the figures so far.

        Args:
            chosen: Robots to include; None for all. Shape: (num_envs,), bool.
        """
        if chosen is None:
            chosen = torch.ones_like(self._fallen)
        total = dict(zip(_SUMS, self._sums[:, chosen].sum(dim=1).tolist(), strict=True))
        steps, landings = total["steps"], total["landings"]
        feet = self._env.footfalls.touchdown.shape[1]
        return Gait(
            speed=_ratio(total["speed"], steps),
            velocity_error_sq=_ratio(total["velocity_error_sq"], steps),
            yaw_rate_error_sq=_ratio(total["yaw_rate_error_sq"], steps),
            landing_speed_mean=_ratio(total["landing_speed"], landings),
            landing_speed_rms=_ratio(total["landing_speed_sq"], landings) ** 0.5,
            apex_mean=_ratio(total["apex"], landings),
            duty_factor=_ratio(total["contact"], steps),
            stride_frequency=_ratio(landings, steps * feet * self._env.step_dt),
            power=_ratio(total["power"], steps),
            fall_rate=float(self._fallen[chosen].double().mean()),
            unstable=int(self._unstable[chosen].sum()),
            invalid_actions=int(self._invalid_actions[chosen].sum()),
        )


_SUMS = (
    "steps",
    "speed",
    "velocity_error_sq",
    "yaw_rate_error_sq",
    "landings",
    "landing_speed",
    "landing_speed_sq",
    "apex",
    "contact",
    "power",
)


def _ratio(value: float, count: float) -> float:
    return value / count if count > 0.0 else float("nan")
