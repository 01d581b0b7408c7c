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
    fastest: float,
    draw: torch.Tensor,
) -> torch.Tensor:
    """Return commands that suit the ground: fewer turns, and more that lead ahead.

    Args:
        velocity: Commands (v_x, v_y, w_z) as they were drawn. Shape: (num_envs, 3).
        across: Robots whose ground is crossed along x; no others' change. Shape: (num_envs,), bool.
        cfg: The ground.
        fastest: Largest forward speed, m/s.
        draw: Random numbers in [0, 1). Shape: (num_envs, AHEAD_DRAWS).
    """
    shares = velocity.new_tensor((1.0, 1.0, cfg.turning_share))
    ahead = torch.zeros_like(velocity)
    ahead[:, 0] = fastest * (_SLOWEST + (1.0 - _SLOWEST) * draw[:, 1])
    goes_ahead = (draw[:, :1] < cfg.ahead_share) & across[:, None]
    return torch.where(goes_ahead, ahead, torch.where(across[:, None], shares * velocity, velocity))
