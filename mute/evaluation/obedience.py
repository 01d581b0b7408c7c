"""Whether robots do what they are asked: how fast they are along their commands."""

from __future__ import annotations

import torch

__all__ = ["GOING_SHARE", "along_command"]

GOING_SHARE = 0.4
"""Share of a commanded velocity from which on a robot counts as going."""


def along_command(
    command: torch.Tensor, lin_vel: torch.Tensor, ang_vel: torch.Tensor
) -> torch.Tensor:
    """Return the velocity along a command over the commanded one: 1 where it is followed exactly.

    Of a command that both moves and turns it is the smaller of the two ratios.

    Args:
        command: (v_x, v_y, w_z, ...) in the body frame, m/s and rad/s. Shape: (num_envs, 3 or 4).
        lin_vel: Velocity of the trunk in the body frame, m/s. Shape: (num_envs, 3).
        ang_vel: Its angular velocity in the body frame, rad/s. Shape: (num_envs, 3).

    Returns:
        Infinity where the command is zero. Shape: (num_envs,).
    """
    asked, turn = command[:, :2], command[:, 2]
    moving = (asked * lin_vel[:, :2]).sum(dim=1) / asked.square().sum(dim=1)
    turning = ang_vel[:, 2] / turn
    moving = torch.where((asked == 0.0).all(dim=1), torch.inf, moving)
    return torch.minimum(moving, torch.where(turn == 0.0, torch.inf, turning))
