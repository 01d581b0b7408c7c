"""The ground under the robot: heights where the robot wants to know them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import torch

from mute.support.ranges import Range, check_ranges

__all__ = ["FlatTerrain", "HeightMapCfg", "Terrain"]


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


class Terrain(ABC):
    """Ground that has one height at every point."""

    @abstractmethod
    def height(self, points: torch.Tensor) -> torch.Tensor:
        """Return the ground height at world points, m. Shape: (..., 2) -> (...)."""

    def height_map(
        self, grid: torch.Tensor, base_pos: torch.Tensor, heading: torch.Tensor
    ) -> torch.Tensor:
        """Return the trunk's height above the ground at each grid point, m.

        Args:
            grid: Points in the heading frame, m. Shape: (num_points, 2).
            base_pos: Trunk position in the world, m. Shape: (num_envs, 3).
            heading: Unit vector of the trunk's x axis in the horizontal plane.
                Shape: (num_envs, 2).

        Returns:
            Heights, maybe a view of `base_pos`. Shape: (num_envs, num_points).
        """
        cos, sin = heading[:, :1], heading[:, 1:]
        along, across = grid[:, 0], grid[:, 1]
        offset = torch.stack((cos * along - sin * across, sin * along + cos * across), dim=-1)
        return base_pos[:, 2:3] - self.height(base_pos[:, None, :2] + offset)


class FlatTerrain(Terrain):
    """An endless plane at height zero."""

    def height(self, points: torch.Tensor) -> torch.Tensor:
        """Return zero everywhere, see `Terrain.height`."""
        return torch.zeros_like(points[..., 0])

    def height_map(
        self, grid: torch.Tensor, base_pos: torch.Tensor, heading: torch.Tensor
    ) -> torch.Tensor:
        """Return the trunk's height for every point: where these lie does not matter here."""
        return base_pos[:, 2:3].expand(-1, len(grid))


def _centred(extent: float, spacing: float, device: torch.device | str) -> torch.Tensor:
    intervals = round(extent / spacing)
    return (torch.arange(intervals + 1, device=device) - 0.5 * intervals) * spacing
