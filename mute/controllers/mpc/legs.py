"""The legs' geometry: where feet are, how joints move them, and which joints put them there.

Arrays of joints and feet are (n, 4, 3), n robots, the legs in the order FR, FL, RR, RL, the joints
hip, thigh, calf. Places are in the trunk's frame, m. Figures are the robot's (go1.xml).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .turning import packed, wrapped

__all__ = [
    "HIPS",
    "LINK",
    "OFFSETS",
    "SIDES",
    "foot_jacobians",
    "foot_positions",
    "joints_of_feet",
    "sole_jacobians",
]

Array = NDArray[np.floating]

HIPS = np.array(
    [[0.1881, -0.04675, 0.0], [0.1881, 0.04675, 0.0], [-0.1881, -0.04675, 0.0],
     [-0.1881, 0.04675, 0.0]]
)  # fmt: skip
"""Where the legs are joined to the trunk, m. Shape: (4, 3)."""

SIDES = np.array([-1.0, 1.0, -1.0, 1.0])
"""Which side each leg is on: 1 is the left. Shape: (4,)."""

OFFSETS = 0.08 * SIDES
"""From the hip's axis to the plane of thigh and calf, m."""
LINK = 0.213
"""Length of the thigh, and of the calf down to the foot's centre, m."""
_SHORTEST = 0.05
"""Shortest distance from thigh joint to foot that is asked for, m."""


def foot_positions(joint_pos: Array) -> Array:
    """Return where the feet's centres are. Shape: (n, 4, 3)."""
    x, _, y, z = _in_leg(joint_pos)
    return HIPS + packed(x, y, z)


def foot_jacobians(joint_pos: Array) -> Array:
    """Return how the feet move with the joints, m/rad. Shape: (n, 4, 3, 3), rows x, y, z."""
    x, down, y, z = _in_leg(joint_pos)
    hip, bend = joint_pos[..., 0], joint_pos[..., 1] + joint_pos[..., 2]
    calf_x, calf_down = -LINK * np.cos(bend), LINK * np.sin(bend)
    sin, cos = np.sin(hip), np.cos(hip)
    zero = np.zeros_like(x)
    columns = (
        packed(zero, -z, y),
        packed(down, x * sin, -x * cos),
        packed(calf_x, -calf_down * sin, calf_down * cos),
    )
    return packed(*columns)


def sole_jacobians(joint_pos: Array, below: Array) -> Array:
    """Return how the points that touch the ground move past the feet's centres, m/rad.

    A foot is a ball at the end of its calf, and turns with it.

    Args:
        joint_pos: Joint positions, rad. Shape: (n, 4, 3).
        below: From the feet's centres to these points, m. Shape: (n, 1, 3) or (n, 4, 3).

    Returns:
        Shape: (n, 4, 3, 3), rows x, y, z.
    """
    sin, cos = np.sin(joint_pos[..., 0]), np.cos(joint_pos[..., 0])
    x, y, z = below[..., 0], below[..., 1], below[..., 2]
    zero = np.zeros_like(sin)
    by_hip = packed(zero, zero - z, zero + y)
    by_knee = packed(cos * z - sin * y, sin * x, -cos * x)
    return packed(by_hip, by_knee, by_knee)


def joints_of_feet(feet: Array) -> Array:
    """Return the joint positions that put feet somewhere, knees bent backwards.

    A foot out of reach is brought as near as the leg gets.

    Args:
        feet: Places of their centres. Shape: (n, 4, 3).
    """
    x, y, z = np.moveaxis(feet - HIPS, -1, 0)
    down = -np.sqrt(np.maximum(y * y + z * z - OFFSETS**2, 0.0))
    hip = wrapped(np.arctan2(z, y) - np.arctan2(down, OFFSETS))
    reach = np.clip(np.hypot(x, down), _SHORTEST, 2.0 * LINK * 0.999)
    calf = -np.arccos(np.clip(0.5 * (reach / LINK) ** 2 - 1.0, -1.0, 1.0))
    thigh = np.arctan2(-x, -down) - 0.5 * calf
    return packed(hip, thigh, calf)


def _in_leg(joint_pos: Array) -> tuple[Array, Array, Array, Array]:
    """Return the foot's place from the hip, x, y and z, second the height in its own plane."""
    hip, thigh = joint_pos[..., 0], joint_pos[..., 1]
    bend = thigh + joint_pos[..., 2]
    x = -LINK * (np.sin(thigh) + np.sin(bend))
    down = -LINK * (np.cos(thigh) + np.cos(bend))
    sin, cos = np.sin(hip), np.cos(hip)
    return x, down, OFFSETS * cos - down * sin, OFFSETS * sin + down * cos
