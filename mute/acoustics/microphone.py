"""Where the listening is done, and what becomes of sound on the way there.

The direct sound of what is small falls with 1/r (-6.02 dB a doubling of the distance) and comes
after r/c; a floor that rings is near wherever one stands on it (`physics.plate`). What walls give
back is `physics.room`'s. The robot's own shadow is left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mute.acoustics.air import AIR_IMPEDANCE
from mute.acoustics.contacts import ContactBlock

__all__ = [
    "TRUNK_OFFSET",
    "Microphone",
    "distance",
    "mean_square",
]

MIN_DISTANCE = 0.05
"""Sources are no points: nobody hears them from nearer than this, m (chosen)."""

TRUNK_OFFSET = (0.30, 0.0, 0.0)
"""Microphone at the head, in the trunk's frame, m. With the trunk at its height of 0.30 m it is
0.30 m above the floor and 0.34 to 0.59 m from the feet, as the paper says: about 30 cm above the
ground and about 50 cm from where feet and ground meet."""


@dataclass(frozen=True)
class Microphone:
    """A microphone that rides on the trunk, walks along, or stands still."""

    offset: tuple[float, float, float] = TRUNK_OFFSET
    """Place in the frame of its mount, m."""
    mount: Literal["trunk", "beside", "world"] = "trunk"
    """`trunk`: fixed in the trunk's frame. `beside`: a listener who walks along; the frame is that
    of the robot's heading, x forward, y left, z up from the ground (world z = 0) under the trunk.
    `world`: fixed in the world."""

    def __post_init__(self) -> None:
        if self.mount not in ("trunk", "beside", "world"):
            raise ValueError(f"mount must be trunk, beside or world, got {self.mount!r}")
        if len(self.offset) != 3 or not np.all(np.isfinite(self.offset)):
            raise ValueError(f"offset must be three finite numbers, got {self.offset!r}")

    def position(self, block: ContactBlock) -> NDArray[np.float64]:
        """Return where it is at each step, world frame, m. Shape: (steps, robots, 3)."""
        offset = np.asarray(self.offset, dtype=np.float64)
        trunk = np.asarray(block.trunk_pos, dtype=np.float64)
        if self.mount == "world":
            return np.broadcast_to(offset, trunk.shape)
        quat = np.asarray(block.trunk_quat, dtype=np.float64)
        if self.mount == "trunk":
            return trunk + _rotate(quat, offset)
        w, x, y, z = np.moveaxis(quat, -1, 0)
        yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        cos, sin = np.cos(yaw), np.sin(yaw)
        return np.stack(
            (
                trunk[..., 0] + cos * offset[0] - sin * offset[1],
                trunk[..., 1] + sin * offset[0] + cos * offset[1],
                np.full(yaw.shape, offset[2]),
            ),
            axis=-1,
        )


def _rotate(quat: NDArray, vector: NDArray) -> NDArray:
    """Return a vector turned by unit quaternions w x y z. Shape: (..., 3) from (..., 4)."""
    w, axis = quat[..., :1], quat[..., 1:]
    along = axis @ vector
    across = axis @ np.cross(np.eye(3), vector)  # the cross products axis x vector
    square = np.square(axis).sum(axis=-1, keepdims=True)
    return (1.0 - 2.0 * square) * vector + 2.0 * (along[..., None] * axis + w * across)


def distance(source: ArrayLike, microphone: ArrayLike) -> NDArray[np.float64]:
    """Return the distance between points, at least `MIN_DISTANCE`, m. Shape: (...) of (..., 3)."""
    apart = np.asarray(source, dtype=np.float64) - np.asarray(microphone, dtype=np.float64)
    return np.maximum(np.sqrt(np.einsum("...i,...i->...", apart, apart)), MIN_DISTANCE)


def mean_square(power: NDArray, distance: NDArray) -> NDArray:
    """Return the mean square pressure of a small source on a hard floor, Pa^2.

    Sound power W goes evenly into the half space above: p^2 = rho c W / (2 pi r^2).

    Args:
        power: Sound power W, W.
        distance: From the source, r, m.
    """
    return AIR_IMPEDANCE * power / (2.0 * pi * distance**2)
