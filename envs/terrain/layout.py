"""Boxes whose tops are the ground, as a kind of ground lays them around its robots."""

from __future__ import annotations

from typing import NamedTuple

import torch

__all__ = ["CAP", "DEPTH", "HALF_WIDTH", "REACH", "WIDE", "Layout", "boxes", "join", "told_apart"]

DEPTH = 0.3
"""How far a box reaches below the plane that all boxes stand on, m: no foot gets under one."""

_SUNK = 0.5 * DEPTH
"""How far below that plane the top is of a box that is out of the way, m."""

REACH = 0.6
"""Distance from the trunk, m, up to which there has to be ground: feet are at most 0.45 m away, and
all of a robot that falls within it."""

HALF_WIDTH = 1.5
"""Half the width of what is endless to the sides, m; it is laid beside the robot as it walks."""

CAP = 0.1
"""How far the sphere around a box may rise above its top, m: well below a trunk that walks."""

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
    top = torch.where(top > base, top, base - _SUNK)
    pos = torch.stack((0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]), 0.5 * (top + bottom)), dim=-1)
    half = torch.stack((0.5 * (x[1] - x[0]), 0.5 * (y[1] - y[0]), 0.5 * (top - bottom)), dim=-1)
    return Layout(pos, half.clamp(min=1e-3), torch.zeros_like(top))


def told_apart(layout: Layout, xy: torch.Tensor, base: torch.Tensor, step: float) -> Layout:
    """Return the same ground by boxes that the engine can tell to be far away.

    MuJoCo looks closer at a shape and a box wherever the spheres around them meet. The sphere
    around a slab holds all of the robot above it; around a box as deep as a well it is level with
    the top, and what is not near the ground is passed over. Boxes beyond reach then have to sink,
    as their spheres reach far to the sides.

    Args:
        layout: Boxes around n robots.
        xy: Where these are, m. Shape: (n, 2).
        base: Height of the plane, m. Shape: (n,).
        step: How far a robot gets along x or y before its boxes are laid anew, m.

    Returns:
        In double precision, as the depths are up to a thousand times the steps between boxes.
    """
    pos, half = layout.pos.double(), layout.half.double()
    upright = layout.pitch == 0.0
    top = pos[..., 2] + half[..., 2]
    away = (xy[:, None] - pos[..., :2]).abs() - half[..., :2]
    far = upright & (away > REACH + step).any(dim=-1)
    deep = half[..., :2].square().sum(dim=-1) / (2.0 * CAP)
    depth = torch.where(upright, torch.maximum(deep, half[..., 2]), half[..., 2])
    top = torch.where(far, base[:, None].double() - _SUNK, top)
    pos[..., 2] = torch.where(upright, top - depth, pos[..., 2])
    half[..., 2] = depth
    return Layout(pos, half, layout.pitch)


def join(*layouts: Layout) -> Layout:
    """Return the boxes of several layouts of the same robots."""
    return Layout(*(torch.cat(parts, dim=1) for parts in zip(*layouts, strict=True)))
