"""What the policy and the critic see, and how it is scaled and noised.

The layouts are data: other code finds a part of a group by its name, never by a number.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import torch

from mute.support.ranges import Range, check_number

from .randomization import PHYSICS_DIM
from .scene import LEGS

__all__ = [
    "OBSERVATION_WIDTHS",
    "OBS_DIM",
    "SENSOR_WIDTHS",
    "ObservationsCfg",
    "noise_amplitude",
    "policy_observation",
    "privileged_observation",
    "privileged_widths",
    "slices",
]

OBSERVATION_WIDTHS: dict[str, int] = {
    "base_ang_vel": 3,
    "projected_gravity": 3,
    "joint_pos": 12,
    "joint_vel": 12,
    "last_action": 12,
    "command": 4,
}
"""Parts of the policy's observation, in order (paper, eq. 7)."""

OBS_DIM = sum(OBSERVATION_WIDTHS.values())

SENSOR_WIDTHS: dict[str, int] = {"specific_force": 3, "foot_contact": len(LEGS)}
"""Parts of what else a robot measures, in order: what its accelerometer reads, m/s^2, in the body
frame, mean over the control step; and the share of it in which each foot pressed on something."""


@dataclass
class ObservationsCfg:
    """Scales and noise of the policy's observation, as in the field's usual Go1 tasks."""

    scales: dict[str, float] = field(
        default_factory=lambda: {
            "base_ang_vel": 0.25,
            "projected_gravity": 1.0,
            "joint_pos": 1.0,
            "joint_vel": 0.05,
            "last_action": 1.0,
            "command": 1.0,
        }
    )
    """Factor of each part."""
    noise: dict[str, float] = field(
        default_factory=lambda: {
            "base_ang_vel": 0.2,
            "projected_gravity": 0.05,
            "joint_pos": 0.01,
            "joint_vel": 1.5,
        }
    )
    """Half width of the uniform noise on each part, before scaling: rad/s, 1, rad, rad/s."""
    noise_level: float = 1.0
    """Factor on all noise; 0 switches it off."""
    sensors: bool = False
    """Whether there is a group `sensors` of what else a robot measures, `SENSOR_WIDTHS`, which no
    policy uses, but a controller that keeps track of its place."""
    accelerometer_noise: float = 0.2
    """Half width of the uniform noise on the mean of its readings over a control step, m/s^2."""

    def __post_init__(self) -> None:
        """Check the names and the values.

        Raises:
            ValueError: If a scale is missing, a part is unknown, or a number is out of its range.
        """
        if set(self.scales) != set(OBSERVATION_WIDTHS):
            raise ValueError(
                f"env.observations.scales must name {list(OBSERVATION_WIDTHS)},"
                f" got {list(self.scales)}"
            )
        unknown = set(self.noise) - set(OBSERVATION_WIDTHS)
        if unknown:
            raise ValueError(
                f"env.observations.noise must name parts of {list(OBSERVATION_WIDTHS)}, "
                f"got {sorted(unknown)}"
            )
        for name, value in self.scales.items():
            check_number(f"env.observations.scales.{name}", value, Range(-1e6, 1e6))
        for name, value in self.noise.items():
            check_number(f"env.observations.noise.{name}", value, Range(0.0, 1e6))
        check_number("env.observations.noise_level", self.noise_level, Range(0.0, 1e6))
        noise = self.accelerometer_noise
        check_number("env.observations.accelerometer_noise", noise, Range(0.0, 1e6))


def privileged_widths(num_heights: int) -> dict[str, int]:
    """Return the parts of what the critic sees besides, in order."""
    return {
        "base_lin_vel": 3,
        "heights": num_heights,
        "contact": len(LEGS),
        "phase": len(LEGS),
        "physics": PHYSICS_DIM,
    }


def slices(widths: dict[str, int]) -> dict[str, slice]:
    """Return the columns of each part of a group laid out in order."""
    result, start = {}, 0
    for name, width in widths.items():
        result[name] = slice(start, start + width)
        start += width
    return result


def noise_amplitude(cfg: ObservationsCfg, device: torch.device | str = "cpu") -> torch.Tensor:
    """Return the half width of the noise on the scaled observation. Shape: (OBS_DIM,)."""
    sizes = {
        name: cfg.noise.get(name, 0.0) * cfg.scales[name] * cfg.noise_level
        for name in OBSERVATION_WIDTHS
    }
    parts = [
        torch.full((width,), sizes[name], device=device)
        for name, width in OBSERVATION_WIDTHS.items()
    ]
    return torch.cat(parts)


def policy_observation(
    scales: dict[str, float],
    base_ang_vel: torch.Tensor,
    projected_gravity: torch.Tensor,
    joint_pos: torch.Tensor,
    joint_vel: torch.Tensor,
    last_action: torch.Tensor,
    command: torch.Tensor,
) -> torch.Tensor:
    """Return the scaled observation o_t, without noise (paper, eq. 7).

    Args:
        scales: Factor of each part.
        base_ang_vel: Angular velocity in the body frame, rad/s. Shape: (num_envs, 3).
        projected_gravity: Direction of gravity in the body frame. Shape: (num_envs, 3).
        joint_pos: Joint positions relative to the stance, rad. Shape: (num_envs, 12).
        joint_vel: Joint velocities, rad/s. Shape: (num_envs, 12).
        last_action: Action of the previous step. Shape: (num_envs, 12).
        command: Commands (v_x, v_y, w_z, beta). Shape: (num_envs, 4).

    Returns:
        A new tensor. Shape: (num_envs, OBS_DIM).
    """
    return torch.cat(
        (
            base_ang_vel * scales["base_ang_vel"],
            projected_gravity * scales["projected_gravity"],
            joint_pos * scales["joint_pos"],
            joint_vel * scales["joint_vel"],
            last_action * scales["last_action"],
            command * scales["command"],
        ),
        dim=1,
    )


def privileged_observation(
    base_lin_vel: torch.Tensor,
    heights: torch.Tensor,
    contact: torch.Tensor,
    phase: torch.Tensor,
    physics: torch.Tensor,
) -> torch.Tensor:
    """Return what the critic sees besides, laid out as `privileged_widths`.

    Args:
        base_lin_vel: True velocity in the body frame, m/s. Shape: (num_envs, 3).
        heights: Normalised height map. Shape: (num_envs, num_heights).
        contact: Contact of each foot within the control step, bool. Shape: (num_envs, 4).
        phase: Causal phase of each foot. Shape: (num_envs, 4).
        physics: Randomised physics. Shape: (num_envs, PHYSICS_DIM).

    Returns:
        A new tensor. Shape: (num_envs, the sum of the widths).
    """
    return torch.cat((base_lin_vel, heights, contact.float(), phase, physics), dim=1)
