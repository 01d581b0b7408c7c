"""The ground of every robot: its kind, level and key, and the boxes that are laid around it."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import torch

from mute.envs.scene import GROUND_BOX
from mute.envs.simulation import Simulation

from .figures import TREAD
from .kinds import KINDS, Kind
from .layout import Layout, told_apart

__all__ = ["NEAR", "BoxGround", "FlatGround", "Ground", "num_boxes"]


def num_boxes(kinds: Iterable[str], drawn: bool = False) -> int:
    """Return how many boxes a model needs for these kinds of ground, to be stepped or drawn."""
    return max(
        (KINDS[name].wide_boxes if drawn else KINDS[name].boxes for name in kinds), default=0
    )


class Below(NamedTuple):
    """Heights of the ground below a robot, m."""

    feet: torch.Tensor
    """Under each foot. Shape: (num_envs, feet)."""
    near_feet: torch.Tensor
    """The highest within `NEAR` of each foot, which it may meet soon. Shape: (num_envs, feet)."""
    trunk: torch.Tensor
    """Under the trunk. Shape: (num_envs,)."""


class Ground(ABC):
    """Ground that has one height at every point."""

    @abstractmethod
    def height(self, points: torch.Tensor, robots: torch.Tensor | None = None) -> torch.Tensor:
        """Return the ground height at world points, m.

        Args:
            points: Of each of n robots. Shape: (n, ..., 2).
            robots: Which these are, by their indices; all of them, in order, by default.
                Shape: (n,), int64.

        Returns:
            Shape: (n, ...).
        """

    def height_below(
        self, feet: torch.Tensor, radius: float, robots: torch.Tensor | None = None
    ) -> torch.Tensor:
        """Return the height of the highest ground below spheres, m: over an edge, the upper side.

        It is looked for in the corners of the square around each: of ground whose parts are wider.

        Args:
            feet: Centres in the world, m. Shape: (n, spheres, 2).
            radius: Of all, m.
            robots: Which n robots', see `height`.

        Returns:
            Shape: (n, spheres).
        """
        return self.height(_corners(feet, radius), robots).amax(dim=2)

    def below(self, feet: torch.Tensor, trunk: torch.Tensor) -> Below:
        """Return the heights of the ground below a robot, all looked up at once.

        Args:
            feet: Places in the world, m. Shape: (num_envs, feet, 2).
            trunk: Likewise. Shape: (num_envs, 2).
        """
        count = feet.shape[1]
        around = _corners(feet, NEAR)
        # To look up twenty heights takes hardly longer than one.
        points = torch.cat((feet, trunk[:, None], around.flatten(1, 2)), dim=1)
        heights = self.height(points)
        under, near = heights[:, :count], heights[:, count + 1 :].unflatten(1, (count, -1))
        return Below(under, torch.maximum(under, near.amax(dim=2)), heights[:, count])

    def heading(self, draw: torch.Tensor) -> torch.Tensor:
        """Return in which direction each robot begins, rad.

        Args:
            draw: Random numbers in [-1, 1). Shape: (num_envs,).
        """
        return math.pi * draw

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
        # All x of a robot, then all y: kinds of ground read one after the other. No product of
        # matrices, which a training may let processors make in bfloat16, millimetres off.
        points = torch.stack((cos * along - sin * across, sin * along + cos * across), dim=1)
        points += base_pos[:, :2, None]
        return base_pos[:, 2:3] - self.height(points.transpose(1, 2))


def _corners(centres: torch.Tensor, radius: float) -> torch.Tensor:
    """Return the corners of squares around places. Shape: (n, squares, 2) -> (n, squares, 4, 2)."""
    signs = ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))
    return centres[:, :, None] + radius * centres.new_tensor(signs)


NEAR = 0.12
"""How far from a foot ground counts as near, m: less than half a tread, as far as a foot at 1 m/s
gets in what is left of a swing from its middle on."""


class FlatGround(Ground):
    """An endless plane at height zero."""

    def below(self, feet: torch.Tensor, trunk: torch.Tensor) -> Below:
        """Return zeros, see `Ground.below`."""
        zeros = torch.zeros_like(feet[..., 0])
        return Below(zeros, zeros, zeros[:, 0])

    def height(self, points: torch.Tensor, robots: torch.Tensor | None = None) -> torch.Tensor:
        """Return zero everywhere, see `Ground.height`."""
        return torch.zeros_like(points[..., 0])

    def height_map(
        self, grid: torch.Tensor, base_pos: torch.Tensor, heading: torch.Tensor
    ) -> torch.Tensor:
        """Return the trunk's height for every point: where these lie does not matter here."""
        return base_pos[:, 2:3].expand(-1, len(grid))


class BoxGround(Ground):
    """Ground of boxes, each robot's its own, that are laid anew as it walks."""

    def __init__(self, simulation: Simulation, kind_of_robot: Sequence[str]) -> None:
        """Take hold of the boxes of the model; `renew` begins.

        Args:
            simulation: The engine, whose model has `num_boxes` boxes named as `scene.GROUND_BOX`.
            kind_of_robot: Each robot's kind of ground.
        """
        model, device = simulation.model, simulation.device
        num_envs = simulation.num_envs
        self.kinds = tuple(dict.fromkeys(kind_of_robot))
        """Kinds of ground that there are."""
        self.kind = torch.tensor([self.kinds.index(name) for name in kind_of_robot], device=device)
        """Each robot's kind, an index into `kinds`. Shape: (num_envs,)."""
        self.level = torch.zeros(num_envs, dtype=torch.long, device=device)
        """Each robot's level. Shape: (num_envs,)."""
        self.key = torch.zeros(num_envs, dtype=torch.long, device=device)
        """What makes each robot's ground its own. Shape: (num_envs,)."""
        self._robots = [torch.nonzero(self.kind == index)[:, 0] for index in range(len(self.kinds))]
        self._plane = model.geom("floor").id
        widest = torch.tensor([KINDS[name].max_heading for name in self.kinds], device=device)
        self._max_heading = widest[self.kind]
        self.across = self._max_heading < math.pi
        """Robots whose ground is crossed along x. Shape: (num_envs,)."""
        names = (GROUND_BOX.format(index) for index in range(num_boxes(self.kinds)))
        ids = [model.geom(name).id for name in names]
        self._boxes = torch.tensor(ids, dtype=torch.long, device=device)
        self._cell = torch.full((num_envs, 2), torch.inf, device=device)
        self._pos, self._size, self._quat, self._aabb, self._rbound = (
            simulation.field(name)
            for name in ("geom_pos", "geom_size", "geom_quat", "geom_aabb", "geom_rbound")
        )
        fields = (self._pos, self._size, self._aabb, self._rbound)
        self._away = [(field, field[0, self._boxes].clone()) for field in fields]
        self._put_away()

    def height(self, points: torch.Tensor, robots: torch.Tensor | None = None) -> torch.Tensor:
        """Return the ground height at world points, m, see `Ground.height`."""
        flat = points.reshape(len(points), -1, 2)
        heights = torch.empty_like(flat[..., 0])
        level, key = self.level, self.key
        rows_of_kind = self._robots
        if robots is not None:
            level, key, kind = level[robots], key[robots], self.kind[robots]
            rows_of_kind = [torch.nonzero(kind == index)[:, 0] for index in range(len(self.kinds))]
        for name, rows in zip(self.kinds, rows_of_kind, strict=True):
            if len(rows):
                heights[rows] = KINDS[name].height(flat[rows], level[rows], key[rows])
        return heights.reshape(points.shape[:-1])

    def heading(self, draw: torch.Tensor) -> torch.Tensor:
        """Return in which direction each robot begins, see `Ground.heading`."""
        # The sign says whether up or down the x axis, the size how far beside it.
        beside = self._max_heading * (2.0 * draw.abs() - 1.0)
        limited = beside + torch.where(draw < 0.0, math.pi, 0.0)
        return torch.where(self.across, limited, math.pi * draw)

    def lay(self, xy: torch.Tensor, anew: torch.Tensor | None = None) -> None:
        """Lay the boxes around the robots that have come into another cell.

        Args:
            xy: Where each robot is in the world, m. Shape: (num_envs, 2).
            anew: Robots whose ground is another one than before. Shape: (num_envs,), bool.
        """
        cell = torch.floor(xy / TREAD)
        due = (cell != self._cell).any(dim=1)
        if anew is not None:
            due |= anew
        self._cell = torch.where(due[:, None], cell, self._cell)
        for name, robots in zip(self.kinds, self._robots, strict=True):
            chosen = robots[due[robots]]
            if KINDS[name].boxes and len(chosen):
                self._lay(KINDS[name], chosen, xy[chosen])

    def has_kind(self, *names: str) -> torch.Tensor:
        """Return which robots have ground of these kinds. Shape: (num_envs,), bool."""
        among = [name in names for name in self.kinds]
        return torch.tensor(among, device=self.kind.device)[self.kind]

    def state_dict(self) -> dict[str, Any]:
        """Return all that is needed to continue bit for bit; the boxes are the simulation's."""
        parts = {name: getattr(self, name).clone() for name in ("kind", "level", "key")}
        return {"kinds": list(self.kinds), "cell": self._cell.clone(), **parts}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from a `state_dict`, where the simulation does so as well.

        Raises:
            ValueError: If robots had ground of other kinds.
        """
        device = self.level.device
        self.level = state["level"].to(device, copy=True)
        self.key = state["key"].to(device, copy=True)
        self._cell = state["cell"].to(device, copy=True)
        if "kinds" not in state:
            # Of an earlier version, whose choices may have had other shares: boxes are laid anew.
            self._cell.fill_(torch.inf)
            self._put_away()
        elif tuple(state["kinds"]) != self.kinds or not torch.equal(
            state["kind"].to(device), self.kind
        ):
            raise ValueError(
                f"its robots had ground of the kinds {', '.join(state['kinds'])} in other shares or"
                f" another order than now: {', '.join(self.kinds)}"
            )

    def drawn(self, robot: int, xy: torch.Tensor) -> tuple[Layout, float]:
        """Return the boxes of a robot's ground as far as one looks, and the height of its plane.

        Args:
            robot: Its index.
            xy: Where it is in the world, m. Shape: (2,).
        """
        kind = KINDS[self.kinds[int(self.kind[robot])]]
        level, key = self.level[robot, None].cpu(), self.key[robot, None].cpu()
        return kind.lay(xy.cpu()[None], level, key, wide=True), float(kind.base(level))

    def _put_away(self) -> None:
        """Leave every box as the model has it, away from the robots and not turned."""
        for field, away in self._away:
            field[:, self._boxes] = away
        self._quat[:, self._boxes] = 0.0
        self._quat[:, self._boxes, 0] = 1.0

    def _lay(self, kind: Kind, robots: torch.Tensor, xy: torch.Tensor) -> None:
        level, dtype = self.level[robots], self._pos.dtype
        base = kind.base(level)
        laid = told_apart(kind.lay(xy, level, self.key[robots]), xy, base, TREAD)
        at = (robots[:, None], self._boxes[: kind.boxes])
        half = laid.half.to(dtype)
        self._pos[robots, self._plane, 2] = base.to(dtype)
        self._pos[at] = laid.pos.to(dtype)
        self._size[at] = half
        self._aabb[(*at, slice(3, None))] = half
        self._rbound[at] = half.norm(dim=-1)
        turn = 0.5 * laid.pitch.to(dtype)  # before, or MuJoCo would have no unit quaternions
        self._quat[(*at, 0)] = torch.cos(turn)
        self._quat[(*at, 2)] = torch.sin(turn)
