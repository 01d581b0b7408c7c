"""Vectors and rotations, many at a time.

`np.cross` and `np.stack` take ten times as long as what they do where there are few robots.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["about_vertical", "along_curve", "cross", "into", "packed", "turned", "wrapped"]

Array = NDArray[np.floating]


def packed(*parts: Array) -> Array:
    """Return numbers side by side in a new last dimension. All shapes alike, the first's."""
    out = np.empty((*parts[0].shape, len(parts)))
    for index, part in enumerate(parts):
        out[..., index] = part
    return out


def cross(first: Array, second: Array) -> Array:
    """Return the cross products of vectors in the last dimension."""
    a, b, c = first[..., 0], first[..., 1], first[..., 2]
    x, y, z = second[..., 0], second[..., 1], second[..., 2]
    return packed(b * z - c * y, c * x - a * z, a * y - b * x)


def turned(turn: Array, vectors: Array) -> Array:
    """Return vectors turned by each robot's rotation.

    Args:
        turn: Shape: (n, 3, 3).
        vectors: Shape: (n, ..., 3).
    """
    rows = vectors.reshape(len(vectors), -1, 3)
    return (rows @ turn.transpose(0, 2, 1)).reshape(vectors.shape)


def into(turn: Array, vectors: Array) -> Array:
    """Return vectors turned back, see `turned`."""
    rows = vectors.reshape(len(vectors), -1, 3)
    return (rows @ turn).reshape(vectors.shape)


def about_vertical(angle: Array) -> Array:
    """Return rotations about the z axis. Shape: (n,) -> (n, 3, 3)."""
    cos, sin = np.cos(angle), np.sin(angle)
    turns = np.zeros((*angle.shape, 3, 3))
    turns[..., 0, 0] = turns[..., 1, 1] = cos
    turns[..., 0, 1], turns[..., 1, 0] = -sin, sin
    turns[..., 2, 2] = 1.0
    return turns


def along_curve(velocity: Array, rate: Array, time: Array) -> tuple[Array, Array]:
    """Return how far something gets that turns as it goes, and how fast it goes then.

    Args:
        velocity: Level velocity now, m/s. Shape: (n, 3).
        rate: Turning rate about the vertical, rad/s. Shape: (n,).
        time: From now, s. Shape: (n, times).

    Returns:
        Way, m, and velocity, m/s, in the same directions as `velocity`. Shape: (n, times, 3).
    """
    angle = rate[:, None] * time
    forward = time * np.sinc(angle / np.pi)
    aside = 0.5 * angle * time * np.sinc(0.5 * angle / np.pi) ** 2
    x, y = velocity[:, None, 0], velocity[:, None, 1]
    zero = np.zeros_like(angle)
    way = packed(forward * x - aside * y, aside * x + forward * y, zero)
    sin, cos = np.sin(angle), np.cos(angle)
    return way, packed(cos * x - sin * y, sin * x + cos * y, zero)


def wrapped(angle: Array) -> Array:
    """Return angles within half a turn of 0, rad."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi
