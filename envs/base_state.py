"""Where the trunk is and how it moves, in the frames that rewards and observations ask for."""

from __future__ import annotations

from typing import NamedTuple

import torch

__all__ = ["GRAVITY", "BaseState", "base_state", "specific_force"]


class BaseState(NamedTuple):
    """The trunk of every robot; positions and angular velocities are views of the engine's own."""

    pos: torch.Tensor
    """Position in the world, m. Shape: (num_envs, 3)."""
    lin_vel: torch.Tensor
    """Velocity in the body frame, m/s. Shape: (num_envs, 3)."""
    ang_vel: torch.Tensor
    """Angular velocity in the body frame, rad/s. Shape: (num_envs, 3)."""
    projected_gravity: torch.Tensor
    """Direction of gravity in the body frame. Shape: (num_envs, 3)."""
    heading: torch.Tensor
    """Unit vector of the trunk's x axis in the horizontal plane. Shape: (num_envs, 2)."""


GRAVITY = 9.81
"""Acceleration of free fall that the scene has, m/s^2."""


def specific_force(qpos: torch.Tensor, acceleration: torch.Tensor) -> torch.Tensor:
    """Return what an accelerometer in the trunk reads, m/s^2, in the body frame: at rest, upwards.

    Args:
        qpos: Generalised positions, those of the trunk's free joint first. Shape: (n, nq).
        acceleration: Of the trunk in the world, m/s^2. Shape: (n, 3).
    """
    up = acceleration.new_tensor((0.0, 0.0, GRAVITY))
    return (_rotation(qpos) * (acceleration + up)[:, :, None]).sum(dim=1)


def base_state(qpos: torch.Tensor, qvel: torch.Tensor) -> BaseState:
    """Return the trunk's state from that of the engine.

    Args:
        qpos: Generalised positions, those of the trunk's free joint first. Shape: (num_envs, nq).
        qvel: Generalised velocities, likewise. Shape: (num_envs, nv).
    """
    rotation = _rotation(qpos)
    heading = rotation[:, :2, 0]
    return BaseState(
        pos=qpos[:, :3],
        # A batch of such small products takes a CPU several times as long as their terms.
        lin_vel=(rotation * qvel[:, :3, None]).sum(dim=1),
        # MuJoCo gives a free joint's angular velocity in the body frame already.
        ang_vel=qvel[:, 3:6],
        projected_gravity=-rotation[:, 2],
        heading=heading / torch.hypot(*heading.unbind(dim=1)).clamp(min=1e-6)[:, None],
    )


def _rotation(qpos: torch.Tensor) -> torch.Tensor:
    """Return the rotation from body to world: rows are its axes seen by the body. (n, 3, 3)."""
    w, x, y, z = qpos[:, 3:7].unbind(dim=1)
    return torch.stack(
        (
            1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y),
            2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x),
            2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y),
        ),
        dim=1,
    ).view(-1, 3, 3)  # fmt: skip
