"""What robots are asked for where ground has levels: to get over it, not to turn on the spot."""

from __future__ import annotations

import torch

from .cfg import TerrainCfg

__all__ = ["AHEAD_DRAWS", "suit_commands"]

AHEAD_DRAWS = 2
"""Random numbers that a robot needs: whether it goes ahead, and how fast."""

_SLOWEST = 0.3
"""Of the commands that lead ahead, as a share of the largest speed."""


def suit_commands(
    velocity: torch.Tensor,
    across: torch.Tensor,
    cfg: TerrainCfg,
    speeds: tuple[float, float],
    draw: torch.Tensor | None,
) -> torch.Tensor:
    """Return commands that suit the ground: fewer turns, and more that lead ahead.

    Those ahead take the place of any, of commands to stand as well.

    Args:
        velocity: Commands (v_x, v_y, w_z) as they were drawn. Shape: (num_envs, 3).
        across: Robots whose ground is crossed along x; no others' change. Shape: (num_envs,), bool.
        cfg: The ground.
        speeds: Lowest and largest forward speed that may be asked for, m/s; of those ahead, the
            lowest is at least three tenths of the largest.
        draw: Random numbers in [0, 1); None where no command leads ahead.
            Shape: (num_envs, AHEAD_DRAWS).

    Returns:
        New commands. Shape: (num_envs, 3).
    """
    shares = velocity.new_tensor((1.0, 1.0, cfg.turning_share))
    suited = torch.where(across[:, None], shares * velocity, velocity)
    if draw is None:
        return suited
    lowest, largest = speeds
    lowest = max(lowest, _SLOWEST * largest)
    ahead = torch.zeros_like(velocity)
    ahead[:, 0] = lowest + (largest - lowest) * draw[:, 1]
    return torch.where(across[:, None] & (draw[:, :1] < cfg.ahead_share), ahead, suited)
