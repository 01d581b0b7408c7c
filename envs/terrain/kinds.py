"""Kinds of ground: each a height in closed form, and the boxes whose tops are it.

A kind knows where its ground is from the place alone, its level, and a key that is the robot's own,
so that there is no edge: boxes are laid around wherever the robot is. No two boxes of one height
lie side by side. Feet over such a seam would be pushed along the ground by its edge: what is level
is one box, and a step is a box that lies on the one below.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from math import pi

import torch

from .draws import CELLS, KEYS, along_line, in_square, units
from .figures import FIGURES, LEVELS, TREAD
from .layout import DEPTH, HALF_WIDTH, WIDE, Layout, boxes, join

__all__ = ["KINDS", "Kind", "Stairs"]


_UNITS = units(5, KEYS)
"""Five random numbers of each cell."""


class Kind(ABC):
    """A kind of ground. Levels and keys: (n,), int64, of n robots, each on ground of its own."""

    boxes: int
    """Boxes that it takes at a time."""
    wide_boxes: int
    """Boxes that it takes to be drawn."""
    max_heading: float = pi
    """Largest angle between the x axis, up or down, and the heading that a robot begins with, rad:
    stairs are there to be climbed."""

    @abstractmethod
    def height(self, xy: torch.Tensor, level: torch.Tensor, key: torch.Tensor) -> torch.Tensor:
        """Return the height of the ground, m; at the middle of where robots begin it is 0.

        Args:
            xy: Points in the world frame, m, finite; those of a robot within few metres, as all
                that lies between them may be looked up. Shape: (n, points, 2), n > 0.
            level: Of each robot.
            key: Of each robot.

        Returns:
            Shape: (n, points).
        """

    @abstractmethod
    def lay(
        self, xy: torch.Tensor, level: torch.Tensor, key: torch.Tensor, wide: bool = False
    ) -> Layout:
        """Return the boxes within `layout.REACH` of a place.

        Args:
            xy: Places in the world frame, m. Shape: (n, 2).
            level: Of each robot.
            key: Of each robot.
            wide: Return as many more as it takes to draw the ground as far as one looks.
        """

    def base(self, level: torch.Tensor) -> torch.Tensor:
        """Return the height of the plane that the boxes stand on, m. Shape: (n,)."""
        return torch.zeros_like(level, dtype=torch.float32)


class Flat(Kind):
    """The plane alone."""

    boxes = wide_boxes = 0

    def height(self, xy: torch.Tensor, level: torch.Tensor, key: torch.Tensor) -> torch.Tensor:
        """Return 0."""
        return torch.zeros_like(xy[..., 0])

    def lay(
        self, xy: torch.Tensor, level: torch.Tensor, key: torch.Tensor, wide: bool = False
    ) -> Layout:
        """Return nothing."""
        nothing = xy.new_zeros(len(xy), 0, 3)
        return Layout(nothing, nothing, nothing[..., 0])


class Stairs(Kind):
    """Flights of stairs up and down along x, one after the other, with landings between.

    A hill of flights is its steps on top of each other: step m is a box as long as all that is as
    high as it, or higher.
    """

    boxes = 7
    wide_boxes = 24
    max_heading = 0.25 * pi
    STEPS = 8
    """Steps of a flight."""
    TOP = 2.4
    """Length of the upper landing, m."""
    VALLEY = 2.4
    """Length of the lower landing, m; there no second hill is near."""
    PERIOD = TOP + VALLEY + 2 * (STEPS - 1) * TREAD

    def __init__(self, begins_on_top: bool) -> None:
        """Choose which way the first flight goes: robots begin on a landing's middle."""
        self._shift = 0.0 if begins_on_top else 0.5 * self.PERIOD
        self._on_top = begins_on_top

    def height(self, xy: torch.Tensor, level: torch.Tensor, key: torch.Tensor) -> torch.Tensor:
        """Return the height of the step below each point, see `Kind.height`."""
        riser = _figure("riser", level, xy)[:, None]
        away = (xy[..., 0] - self._middle(xy[..., 0])).abs()
        # Steps that reach as far from the middle of the hill; a step's edge belongs to it.
        reach = self._half(1) + (1.0 + 1e-6) * TREAD
        steps = torch.floor((reach - away) / TREAD).clamp(0, self.STEPS)
        return torch.addcmul(self.base(level)[:, None], riser, steps)

    def lay(
        self, xy: torch.Tensor, level: torch.Tensor, key: torch.Tensor, wide: bool = False
    ) -> Layout:
        """Return the steps that are near, see `Kind.lay`."""
        x = xy[:, :1]
        middle = self._middle(x)
        if wide:
            middle = _around(middle, self.PERIOD).repeat_interleave(self.STEPS, dim=1)
            step = torch.arange(1, self.STEPS + 1, device=xy.device).repeat(1, 3)
        else:
            here = torch.floor((self._half(1) - (x - middle).abs()) / TREAD + 1.0)
            lowest = (here - self.boxes // 2).clamp(1, self.STEPS - self.boxes + 1)
            step = lowest + torch.arange(self.boxes, device=xy.device)
        half, base = self._half(step), self.base(level)[:, None]
        top = base + _figure("riser", level, xy)[:, None] * step
        return boxes((middle - half, middle + half), _beside(xy, top.shape[1], wide), top, base)

    def base(self, level: torch.Tensor) -> torch.Tensor:
        """Return the height of the lower landing, m. Shape: (n,)."""
        rise = self.STEPS * _figure("riser", level)
        return -rise if self._on_top else torch.zeros_like(rise)

    def _middle(self, x: torch.Tensor) -> torch.Tensor:
        """Return the middle of the hill that is nearest."""
        return self._shift + self.PERIOD * torch.round((x - self._shift) / self.PERIOD)

    def _half(self, step: torch.Tensor | int) -> torch.Tensor | float:
        """Return half the length of a step's box, the first and longest of which is 1."""
        return 0.5 * self.TOP + TREAD * (self.STEPS - step)


class Slopes(Kind):
    """Ramps up and down along x, with level ground between."""

    boxes = 3
    wide_boxes = 9
    max_heading = 0.25 * pi
    _RAMP = 2.1
    """Length of a ramp on the map, m."""
    _TOP = 1.2
    """Length of the level ground above, m."""
    _VALLEY = 1.8
    """Length of the level ground below, in whose middle robots begin, m."""
    _PERIOD = 2 * _RAMP + _TOP + _VALLEY

    def height(self, xy: torch.Tensor, level: torch.Tensor, key: torch.Tensor) -> torch.Tensor:
        """Return the height of the ramp at each point, see `Kind.height`."""
        slope = torch.tan(_figure("slope", level, xy))[:, None]
        away = (xy[..., 0] - self._middle(xy[..., 0])).abs()
        return slope * (0.5 * self._TOP + self._RAMP - away).clamp(0.0, self._RAMP)

    def lay(
        self, xy: torch.Tensor, level: torch.Tensor, key: torch.Tensor, wide: bool = False
    ) -> Layout:
        """Return the ramps of the hill that is nearest, see `Kind.lay`."""
        angle = _figure("slope", level, xy)[:, None]
        middle = self._middle(xy[:, :1])
        if wide:
            middle = _around(middle, self._PERIOD)
        angle = angle.expand_as(middle)
        y = _beside(xy, middle.shape[1], wide)
        rise = self._RAMP * torch.tan(angle)
        zero = torch.zeros_like(angle)
        half = zero + 0.5 * self._TOP
        top = boxes((middle - half, middle + half), y, rise, zero)
        return join(top, *(self._ramp(middle, side, angle, y) for side in (-1.0, 1.0)))

    def _ramp(
        self,
        middle: torch.Tensor,
        side: float,
        angle: torch.Tensor,
        y: tuple[torch.Tensor, torch.Tensor],
    ) -> Layout:
        """Return the ramp on a side of a hill.

        Its upper end is where the level ground begins, its lower end a little below the ground.
        """
        cos, sin, tan = torch.cos(angle), torch.sin(angle), torch.tan(angle)
        length = self._RAMP / cos + 0.1
        thick = torch.full_like(length, DEPTH)
        # From the upper edge down along the ramp, and into it, both as (x, z).
        x = middle + side * (0.5 * self._TOP + 0.5 * (length * cos - thick * sin))
        z = self._RAMP * tan - 0.5 * (length * sin + thick * cos)
        pos = torch.stack((x, 0.5 * (y[0] + y[1]), z), dim=-1)
        half = torch.stack((0.5 * length, 0.5 * (y[1] - y[0]), 0.5 * thick), dim=-1)
        return Layout(pos, half, side * angle)

    def _middle(self, x: torch.Tensor) -> torch.Tensor:
        shift = 0.5 * self._PERIOD
        return shift + self._PERIOD * torch.round((x - shift) / self._PERIOD)


class Uneven(Kind):
    """Blocks side by side, each as high as it happens to be."""

    boxes = 25
    wide_boxes = 25**2
    _SIZE = 0.3
    """Length of a block's sides, m."""

    def height(self, xy: torch.Tensor, level: torch.Tensor, key: torch.Tensor) -> torch.Tensor:
        """Return the height of the block below each point, see `Kind.height`."""
        cell = torch.floor(xy / self._SIZE).long()
        return self._top(cell[..., 0], cell[..., 1], level, key)

    def lay(
        self, xy: torch.Tensor, level: torch.Tensor, key: torch.Tensor, wide: bool = False
    ) -> Layout:
        """Return five by five blocks, the robot over the one in the middle, see `Kind.lay`."""
        i, j = _window(xy, self._SIZE, 25 if wide else 5)
        x, y = i * self._SIZE, j * self._SIZE
        top = self._top(i, j, level, key)
        return boxes((x, x + self._SIZE), (y, y + self._SIZE), top, self.base(level)[:, None])

    def base(self, level: torch.Tensor) -> torch.Tensor:
        """Return half the range of heights below 0, m. Shape: (n,)."""
        return -0.5 * _figure("uneven", level)

    def _top(
        self, i: torch.Tensor, j: torch.Tensor, level: torch.Tensor, key: torch.Tensor
    ) -> torch.Tensor:
        unit = _UNITS.to(key.device)[0][in_square(i, j, key)]
        return _figure("uneven", level)[:, None] * (unit - 0.5)


class Blocks(Kind):
    """Level ground on which blocks and sills lie, to step over or onto."""

    boxes = 9
    wide_boxes = 13**2
    _CELL = 0.6
    """Length of the sides of a cell, each of which holds a block or none, m."""

    def height(self, xy: torch.Tensor, level: torch.Tensor, key: torch.Tensor) -> torch.Tensor:
        """Return the height of what lies below each point, see `Kind.height`."""
        place = xy / self._CELL
        cell = torch.floor(place)
        i, j, which = _cells(cell)
        along, across, top = (part.gather(1, which) for part in self._block(i, j, level, key))
        x, y = ((place - cell - 0.5).abs() * self._CELL).unbind(dim=-1)
        # Numbers all along: a mask takes four times as long to make, and to use.
        outside = torch.floor(torch.minimum(along - x, across - y))  # -1, or 0 on the block
        return torch.addcmul(top, top, outside)

    def lay(
        self, xy: torch.Tensor, level: torch.Tensor, key: torch.Tensor, wide: bool = False
    ) -> Layout:
        """Return what lies in three by three cells, see `Kind.lay`."""
        i, j = _window(xy, self._CELL, 13 if wide else 3)
        x, y = (i + 0.5) * self._CELL, (j + 0.5) * self._CELL
        along, across, top = self._block(i, j, level, key)
        base = self.base(level)[:, None]
        return boxes((x - along, x + along), (y - across, y + across), top, base)

    def _block(
        self, i: torch.Tensor, j: torch.Tensor, level: torch.Tensor, key: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Return half the length and width of cells' blocks, and their heights, 0 for none."""
        along, across, high = _BLOCKS.to(key.device)[:, in_square(i, j, key)]
        clear = (i.abs() <= 1) & (j.abs() <= 1)  # where robots begin
        return along, across, torch.where(clear, 0.0, _figure("block", level)[:, None] * high)


class Rooms(Kind):
    """Floors with what lies on them: cables, sills, edges of carpets, steps and short stairs.

    Along x, every 2.4 m, comes one of them, across the way.
    """

    boxes = 6
    wide_boxes = 24
    max_heading = 0.25 * pi
    _CELL = 2.4
    STEPS = 3
    """Steps of stairs, and so boxes of a cell."""

    def height(self, xy: torch.Tensor, level: torch.Tensor, key: torch.Tensor) -> torch.Tensor:
        """Return the height of what lies below each point, see `Kind.height`."""
        place = xy[..., 0] / self._CELL
        cell = torch.round(place)
        # The few cells that a robot's points are in are looked up once for all of them.
        cells, which = _run(cell)
        which = which.long()
        half, steps, rise = (part.gather(1, which) for part in self._thing(cells, level, key))
        away = (place - cell).abs() * self._CELL
        covering = torch.floor((half - away) / TREAD + 1.0).clamp(min=0.0)
        return rise * torch.minimum(covering, steps)

    def lay(
        self, xy: torch.Tensor, level: torch.Tensor, key: torch.Tensor, wide: bool = False
    ) -> Layout:
        """Return the two things that are nearest, see `Kind.lay`."""
        first = torch.floor(xy[:, :1] / self._CELL).long()
        cell = first + torch.arange(-3 if wide else 0, 5 if wide else 2, device=xy.device)
        half, steps, rise = self._thing(cell, level, key)
        step = torch.arange(self.STEPS, device=xy.device).repeat_interleave(cell.shape[1])
        half, steps, rise = (part.repeat(1, self.STEPS) for part in (half, steps, rise))
        there = step < steps
        half = torch.where(there, half - TREAD * step, 0.0)
        top = torch.where(there, rise * (step + 1.0), 0.0)
        middle = (cell * self._CELL).repeat(1, self.STEPS)
        base = self.base(level)[:, None]
        return boxes((middle - half, middle + half), _beside(xy, top.shape[1], wide), top, base)

    def _thing(
        self, cell: torch.Tensor, level: torch.Tensor, key: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Return what lies in cells: half the length of its lowest step, how many, how high each.

        All but stairs are a single one. Shape of each: that of `cell`.
        """
        index = along_line(cell, key)
        half, steps = _THINGS.to(key.device)[:, index]
        rise = _RISES.to(key.device)[level[:, None], index]
        return half, steps, torch.where(cell == 0, 0.0, rise)  # robots begin in cell 0


def _draw_blocks() -> torch.Tensor:
    """Return half the length and width of the block in each cell, and the share of its height.

    Shape: (3, KEYS).
    """
    there, thin, turned, long, high = _UNITS
    wide = 0.1 + 0.15 * long
    narrow = torch.where(thin < 1.0 / 3.0, 0.03 + 0.02 * long, wide)  # a third of them are sills
    along = torch.where(turned < 0.5, narrow, wide)
    across = torch.where(turned < 0.5, wide, narrow)
    return torch.stack((along, across, torch.where(there < 0.6, 0.3 + 0.7 * high, 0.0)))


def _draw_rooms() -> tuple[torch.Tensor, torch.Tensor]:
    """Return what lies in each cell of rooms, and by level how high it is.

    Shapes: (2, CELLS), half the length of its lowest step and how many it has, and (LEVELS, CELLS),
    how high each step is.
    """
    which, size = _UNITS[:2, :CELLS]
    half, steps, rise = torch.zeros(CELLS), torch.ones(CELLS), torch.zeros(LEVELS, CELLS)
    share = 0.15  # of nothing
    for name, its_share, its_half in (
        ("cable", 0.2, 0.004 + 0.004 * size),
        ("sill", 0.25, 0.03 + 0.03 * size),
        ("carpet", 0.15, torch.full_like(size, 0.6)),
        ("riser", 0.15, torch.full_like(size, 0.6)),
    ):
        here = (which >= share) & (which < share + its_share)
        half = torch.where(here, its_half, half)
        heights = torch.tensor(FIGURES[name])[:, None] * (0.4 + 0.6 * size)
        rise = torch.where(here, heights, rise)
        share += its_share
    stairs = which >= share
    half = torch.where(stairs, 0.3 + (Rooms.STEPS - 1) * TREAD, half)
    steps = torch.where(stairs, float(Rooms.STEPS), steps)
    rise = torch.where(stairs, torch.tensor(FIGURES["riser"])[:, None], rise)
    return torch.stack((half, steps)), rise


_BLOCKS = _draw_blocks()
_THINGS, _RISES = _draw_rooms()

KINDS: dict[str, Kind] = {
    "flat": Flat(),
    "slopes": Slopes(),
    "uneven": Uneven(),
    "blocks": Blocks(),
    "stairs": Stairs(begins_on_top=False),
    "stairs_down": Stairs(begins_on_top=True),
    "rooms": Rooms(),
}
"""Kinds of ground by their names."""


def _figure(name: str, level: torch.Tensor, like: torch.Tensor | None = None) -> torch.Tensor:
    """Return a figure of the table for each robot's level. Shape: (n,)."""
    dtype = torch.float32 if like is None else like.dtype
    return torch.tensor(FIGURES[name], dtype=dtype, device=level.device)[level]


def _around(middle: torch.Tensor, period: float) -> torch.Tensor:
    """Return a place, and those a period before and after it. Shape: (n, 1) -> (n, 3)."""
    return middle + period * torch.tensor((-1.0, 0.0, 1.0), device=middle.device)


def _beside(xy: torch.Tensor, count: int, wide: bool = False) -> tuple[torch.Tensor, torch.Tensor]:
    """Return where boxes end to the sides, that go along with the robot. Shapes: (n, count)."""
    half = WIDE if wide else HALF_WIDTH
    # In steps: a box that moved under a standing foot at every step would rub it.
    y = (0.5 * torch.round(2.0 * xy[:, 1:])).expand(-1, count)
    return y - half, y + half


def _window(xy: torch.Tensor, size: float, row: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Return the indices of the cells around each place. Shapes: (n, row^2)."""
    around = torch.arange(row, device=xy.device) - row // 2
    cell = torch.floor(xy / size).long()
    i = (cell[:, 0, None] + around.repeat_interleave(row)).contiguous()
    j = (cell[:, 1, None] + around.repeat(row)).contiguous()
    return i, j


def _cells(cell: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Return the cells that a robot's points are in, to be looked up once for all of its points.

    Args:
        cell: The indices of the cell of each point, whole numbers. Shape: (n, points, 2).

    Returns:
        The indices of the cells of a rectangle around the points, each of shape (n, cells), and
        which of these each point is in, of shape (n, points).
    """
    (i, along), (j, across) = (_run(part) for part in cell.unbind(dim=-1))
    rows, row = i.shape[1], j.shape[1]
    return i.repeat_interleave(row, dim=1), j.repeat(1, rows), (along * row + across).long()


def _run(cell: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Return the cells from the first to the last that a robot's points are in, along one axis.

    Args:
        cell: The index of the cell of each point, whole numbers. Shape: (n, points).

    Returns:
        The indices of the cells, int64, of shape (n, cells), and which of these each point is in,
        whole numbers of the type of `cell`, of its shape.
    """
    first = cell.amin(dim=1, keepdim=True)
    which = cell - first
    cells = torch.arange(int(which.max()) + 1, device=cell.device)
    return first.long() + cells, which
