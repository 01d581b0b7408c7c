"""Boxes whose tops are the ground, as a kind of ground lays them around its robots."""

from __future__ import annotations

from typing import NamedTuple

import torch

__all__ = ["DEPTH", "HALF_WIDTH", "REACH", "WIDE", "Layout", "boxes", "join"]

DEPTH = 0.3
"""How far a box reaches below the plane that all boxes stand on, m: no foot gets under one."""

REACH = 0.6
"""Distance from the trunk, m, up to which there has to be ground: feet are at most 0.45 m away, and
all of a robot that falls within it."""

HALF_WIDTH = 1.5
"""Half the width of what is endless to the sides, m; it is laid beside the robot as it walks."""

WIDE = 6.0
"""The same where ground is drawn, m."""


class Layout(NamedTuple):
    """Boxes of several robots, as many for each. Lengths in m, in the world frame."""

    pos: torch.Tensor
    """Centres. Shape: (n, boxes, 3)."""
    half: torch.Tensor
    """Half sizes. Shape: (n, boxes, 3)."""
    pitch: torch.Tensor
    """Turn about the y axis, rad; positive turns the far end down. Shape: (n, boxes)."""


def boxes(
    x: tuple[torch.Tensor, torch.Tensor],
    y: tuple[torch.Tensor, torch.Tensor],
    top: torch.Tensor,
    base: torch.Tensor,
) -> Layout:
    """Return upright boxes. Those whose top is not above the base lie below it, out of the way.

    Args:
        x: Lower and upper end. Shape of each: (n, boxes).
        y: Likewise.
        top: Height of the top. Shape: (n, boxes).
        base: Height of the plane. Shape: (n, 1).
    """
    bottom = torch.minimum(base, top) - DEPTH
    top = torch.where(top > base, top, base - 0.5 * DEPTH)
    pos = torch.stack((0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]), 0.5 * (top + bottom)), dim=-1)
    half = torch.stack((0.5 * (x[1] - x[0]), 0.5 * (y[1] - y[0]), 0.5 * (top - bottom)), dim=-1)
    return Layout(pos, half.clamp(min=1e-3), torch.zeros_like(top))


def join(*layouts: Layout) -> Layout:
    """Return the boxes of several layouts of the same robots."""
    return Layout(*(torch.cat(parts, dim=1) for parts in zip(*layouts, strict=True)))
