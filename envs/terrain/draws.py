"""Random numbers that a place has of its own: the same whenever, and in whatever order, asked.

They are drawn once, for a square of cells that is repeated in all directions; where a robot stands
in it follows from its key. To look them up costs a tenth of what mixing the place's indices does.
"""

from __future__ import annotations

import torch

__all__ = ["CELLS", "KEYS", "along_line", "in_square", "units"]

CELLS = 128
"""Cells along a side of the square, a power of two."""

KEYS = CELLS * CELLS
"""Number of keys: each is a place in the square."""

_SEED = 20250623


def units(count: int, *shape: int) -> torch.Tensor:
    """Return numbers in [0, 1) that are the same in every process. Shape: (count, *shape)."""
    generator = torch.Generator().manual_seed(_SEED)
    return torch.rand(count, *shape, generator=generator)


def along_line(cell: torch.Tensor, key: torch.Tensor) -> torch.Tensor:
    """Return the index of a cell among `CELLS` that stand in a line.

    Args:
        cell: Its number, int64. Shape: (n, ...).
        key: Of each robot, int64. Shape: (n,).
    """
    return (cell + key[(...,) + (None,) * (cell.dim() - 1)]) & (CELLS - 1)


def in_square(i: torch.Tensor, j: torch.Tensor, key: torch.Tensor) -> torch.Tensor:
    """Return the index of a cell among `CELLS` squared that stand in rows.

    Args:
        i: Its number along x, int64. Shape: (n, ...).
        j: Along y, likewise.
        key: Of each robot, int64. Shape: (n,).
    """
    return along_line(i, key) * CELLS + along_line(j, key // CELLS)
