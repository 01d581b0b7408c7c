"""The grid around the robot whose heights make the height map."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from mute.support.ranges import Range, check_ranges

__all__ = ["HeightMapCfg"]


@dataclass
class HeightMapCfg:
    """The grid of points around the robot whose heights make the height map."""

    length: float = 0.9
    """Extent along the heading, m, centred on the trunk."""
    width: float = 0.6
    """Extent across the heading, m."""
    spacing: float = 0.15
    """Distance between neighbours, m."""
    offset: float = 0.30
    """Height of the trunk above a point for which critic and estimator see 0, m."""
    scale: float = 0.1
    """Difference in height that is 1 to them, m."""

    def __post_init__(self) -> None:
        """Check the lengths.

        Raises:
            ValueError: If one is out of its range, or an extent is no multiple of the spacing.
        """
        check_ranges(self, "env.height_map", _RANGES)
        for name in ("length", "width"):
            extent = getattr(self, name)
            intervals = extent / self.spacing
            if abs(intervals - round(intervals)) > 1e-6:
                raise ValueError(
                    f"env.height_map.{name} must be a multiple of env.height_map.spacing,"
                    f" {self.spacing}, got {extent}"
                )

    def grid(self, device: torch.device | str = "cpu") -> torch.Tensor:
        """Return the grid points in the heading frame, m. Shape: (num_points, 2)."""
        along = _centred(self.length, self.spacing, device)
        across = _centred(self.width, self.spacing, device)
        return torch.cartesian_prod(along, across)

    def normalised(self, heights: torch.Tensor) -> torch.Tensor:
        """Return heights in m as critic and estimator see them."""
        return (heights - self.offset) / self.scale

    def metres(self, normalised: torch.Tensor) -> torch.Tensor:
        """Return normalised heights in m."""
        return self.offset + self.scale * normalised


_RANGES = {
    "length": Range(0.0, 10.0),
    "width": Range(0.0, 10.0),
    "spacing": Range(0.01, 10.0),
    "offset": Range(-10.0, 10.0),
    "scale": Range(0.001, 10.0),
}


def _centred(extent: float, spacing: float, device: torch.device | str) -> torch.Tensor:
    intervals = round(extent / spacing)
    return (torch.arange(intervals + 1, device=device) - 0.5 * intervals) * spacing
