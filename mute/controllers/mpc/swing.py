"""The curve that a foot follows through the air: a cycloid, which starts and ends at rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["swing_curve"]

Array = NDArray[np.floating]


def swing_curve(
    start: Array, end: Array, height: float, progress: Array, duration: float
) -> tuple[Array, Array]:
    """Return where a foot should be, and how fast it should move.

    Along the ground, and between the heights of both ends, it is a cycloid's run; up and down half
    a cosine's wave (unitree_guide, 2023, for the same robot).

    Args:
        start: Where the foot left the ground, m. Shape: (..., 3).
        end: Where it is to land, m. Shape: (..., 3).
        height: Of the middle above the straight line, m.
        progress: From 0, lift-off, to 1, landing. Shape: (...).
        duration: Of the swing, s.

    Returns:
        Place and velocity, m and m/s. Shape of each: (..., 3).
    """
    angle = 2.0 * np.pi * np.clip(progress, 0.0, 1.0)
    rate = 2.0 * np.pi / duration
    sin, cos = np.sin(angle), np.cos(angle)
    way = end - start
    place = start + way * ((angle - sin) / (2.0 * np.pi))[..., None]
    velocity = way * ((1.0 - cos) * rate / (2.0 * np.pi))[..., None]
    place[..., 2] += 0.5 * height * (1.0 - cos)
    velocity[..., 2] += 0.5 * height * sin * rate
    return place, velocity
