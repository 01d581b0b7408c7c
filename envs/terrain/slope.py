"""Which way the ground rises under a robot, as its feet have it."""

from __future__ import annotations

import torch

__all__ = ["slope_under"]

_IN_LINE = 1e-6
"""Keeps a slope finite where all feet are in one line, m^4; those of a stance have 1e-2."""


def slope_under(feet: torch.Tensor, heights: torch.Tensor, heading: torch.Tensor) -> torch.Tensor:
    """Return the rise of the plane that fits the ground under the feet best, m a metre.

    Args:
        feet: Places of the feet in the world, m. Shape: (num_envs, feet, 2).
        heights: Of the ground there, m. Shape: (num_envs, feet).
        heading: Unit vector of the trunk's x axis in the horizontal plane. Shape: (num_envs, 2).

    Returns:
        Rise along the heading and to the left. Shape: (num_envs, 2).
    """
    place = feet - feet.mean(dim=1, keepdim=True)
    cos, sin = heading[:, :1], heading[:, 1:]
    along = cos * place[..., 0] + sin * place[..., 1]
    left = cos * place[..., 1] - sin * place[..., 0]
    xx, xy, yy = (along * along).sum(1), (along * left).sum(1), (left * left).sum(1)
    xh, yh = (along * heights).sum(1), (left * heights).sum(1)
    rise = torch.stack((yy * xh - xy * yh, xx * yh - xy * xh), dim=1)
    return rise / (xx * yy - xy * xy + _IN_LINE)[:, None]
