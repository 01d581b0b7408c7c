"""Courses: a path over floors of several kinds, read from a YAML file.

A course says where to walk, how fast, and what lies under the feet. How a robot keeps to the path
is left to `path_following`, the walk itself to `long_walk`.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import ArrayLike, NDArray

from mute.acoustics.floors import FLOORS
from mute.evaluation.course.path_following import MAX_SPEED
from mute.support.errors import MuteError

__all__ = ["MARGIN", "Course", "FloorArea", "Point", "load_course"]

Point = tuple[float, float]
"""A place on the ground, world frame, m."""

MARGIN = 1.0
"""Distance from the path within which there must be floor, m: what a robot may stray, and half its
length."""

_MAX_COORDINATE = 1e4
"""Largest coordinate of a point, m: beyond, the physics would lose precision."""


_NOT_YAML = (
    yaml.YAMLError,
    RecursionError,
    # What PyYAML lets through of a month 13, `!!int x` or `!!timestamp x`.
    ValueError,
    AttributeError,
)
"""What reading a file raises that is no YAML."""


class _FieldError(ValueError):
    """A bad value in a course file: which field, what it holds, and what is allowed."""


@dataclass(frozen=True)
class FloorArea:
    """A rectangle of one floor."""

    floor: str
    """Name of the floor, one of `mute.acoustics.floors.FLOORS`."""
    low: Point
    """Corner with the smallest x and y, m."""
    high: Point
    """Corner with the largest x and y, m."""

    def contains(self, xy: NDArray[np.floating]) -> NDArray[np.bool_]:
        """Return whether points lie in it, its border included. Shape: (...) of (..., 2)."""
        return np.all((xy >= self.low) & (xy <= self.high), axis=-1)

    def overlaps(self, other: FloorArea) -> bool:
        """Return whether it shares more than a border with another one."""
        return all(
            max(self.low[axis], other.low[axis]) < min(self.high[axis], other.high[axis])
            for axis in (0, 1)
        )


@dataclass(frozen=True)
class Course:
    """A path, the floors around it, and a speed."""

    path: tuple[Point, ...]
    """Waypoints, at least two, joined by straight lines; the first is the origin."""
    floors: tuple[FloorArea, ...]
    """Rectangles side by side, at least one."""
    speed: float
    """Forward speed to ask for, m/s."""

    @property
    def length(self) -> float:
        """Length of the path, m."""
        return sum(math.dist(start, end) for start, end in pairwise(self.path))

    @property
    def floor_names(self) -> tuple[str, ...]:
        """The names of the floors, each once, in the order of their first rectangles."""
        return tuple(dict.fromkeys(area.floor for area in self.floors))

    def floor_at(self, xy: ArrayLike) -> NDArray[np.int8]:
        """Return the floor under points: the first rectangle's that holds them.

        Args:
            xy: Places, world frame, m. Shape: (..., 2).

        Returns:
            Indices into `floor_names`; 0 outside of all rectangles. Shape: (...).
        """
        xy, names = np.asarray(xy, dtype=np.float64), self.floor_names
        found = np.zeros(xy.shape[:-1], dtype=np.int8)
        for area in reversed(self.floors):  # the first one is written last and stays
            found[area.contains(xy)] = names.index(area.floor)
        return found


def load_course(path: Path) -> Course:
    """Read a course from a YAML file with the fields `speed`, `path` and `floors`.

    Raises:
        MuteError: If the file cannot be read, or a value in it is not allowed.
    """
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise MuteError(f"cannot read the course {path}: {error.strerror}") from error
    except _NOT_YAML as error:
        reason = " ".join(str(error).split())
        raise MuteError(f"{path} is no YAML file: {reason}") from error
    try:
        return _course(content)
    except _FieldError as error:
        raise MuteError(f"{path}: {error}") from error


def _course(content: Any) -> Course:  # noqa: ANN401
    fields = _fields("the course", content, ("speed", "path", "floors"))
    speed = _number("speed", fields["speed"])
    if not 0.0 < speed <= MAX_SPEED:
        raise _FieldError(f"speed must be above 0 and at most {MAX_SPEED:g} m/s, got {speed:g}")
    waypoints = [
        _point(f"path[{index}]", value)
        for index, value in enumerate(_list("path", fields["path"], 2))
    ]
    areas = [
        _area(f"floors[{index}]", value)
        for index, value in enumerate(_list("floors", fields["floors"], 1))
    ]
    course = Course(tuple(waypoints), tuple(areas), speed)
    _check_path(course.path)
    _check_floors(course)
    return course


def _check_path(path: Sequence[Point]) -> None:
    if path[0] != (0.0, 0.0):
        raise _FieldError(f"path[0] must be [0, 0], where robots start, got {list(path[0])}")
    for index, (start, end) in enumerate(pairwise(path), start=1):
        if start == end:
            raise _FieldError(f"path[{index}] must differ from the point before, got {list(end)}")


def _check_floors(course: Course) -> None:
    """Refuse rectangles that overlap, where feet would touch both, and holes under the path."""
    for (first, one), (second, other) in combinations(enumerate(course.floors), 2):
        if one.overlaps(other):
            raise _FieldError(
                f"floors[{second}] must not overlap floors[{first}],"
                f" got {list(other.low)} to {list(other.high)}"
            )
    points = np.array(list(_around(course.path)))
    held = np.any([area.contains(points) for area in course.floors], axis=0)
    if not held.all():
        x, y = points[np.argmin(held)]
        raise _FieldError(
            f"floors must reach {MARGIN:g} m to all sides of the path, got none at"
            f" [{x:.2f}, {y:.2f}]"
        )


def _around(path: Sequence[Point]) -> Iterator[Point]:
    """Yield points every 0.1 m along a path, and around each of them at the margin and half."""
    turns = np.linspace(0.0, 2.0 * math.pi, 16, endpoint=False)
    circle = np.stack((np.cos(turns), np.sin(turns)), axis=1)
    disc = np.concatenate(([[0.0, 0.0]], 0.5 * MARGIN * circle, MARGIN * circle))
    for start, end in pairwise(np.array(path)):
        for share in np.linspace(0.0, 1.0, math.ceil(math.dist(start, end) / 0.1) + 1):
            yield from start + share * (end - start) + disc


def _area(name: str, value: Any) -> FloorArea:  # noqa: ANN401
    fields = _fields(name, value, ("floor", "low", "high"))
    floor = fields["floor"]
    if not isinstance(floor, str) or floor not in FLOORS:
        raise _FieldError(f"{name}.floor must be one of {', '.join(FLOORS)}, got {floor!r}")
    low, high = _point(f"{name}.low", fields["low"]), _point(f"{name}.high", fields["high"])
    if not (low[0] < high[0] and low[1] < high[1]):
        raise _FieldError(
            f"{name}.high must be above low in x and y, got {list(high)} with low {list(low)}"
        )
    return FloorArea(floor, low, high)


def _fields(name: str, value: Any, allowed: Sequence[str]) -> dict[str, Any]:  # noqa: ANN401
    """Return a mapping that has all of the allowed fields and no other."""
    if not isinstance(value, dict):
        raise _FieldError(
            f"{name} must be a mapping with {', '.join(allowed)}, got {_shown(value)}"
        )
    missing = [field for field in allowed if field not in value]
    if missing:
        raise _FieldError(f"{name} lacks the field {missing[0]}")
    unknown = [field for field in value if field not in allowed]
    if unknown:
        raise _FieldError(
            f"{name} must have the fields {', '.join(allowed)}, got {_shown(unknown[0])}"
        )
    return value


def _list(name: str, value: Any, at_least: int) -> list[Any]:  # noqa: ANN401
    if not isinstance(value, list) or len(value) < at_least:
        raise _FieldError(f"{name} must be a list of {at_least} or more, got {_shown(value)}")
    return value


def _point(name: str, value: Any) -> Point:  # noqa: ANN401
    if not isinstance(value, list) or len(value) != 2:
        raise _FieldError(f"{name} must be two numbers [x, y] in m, got {_shown(value)}")
    x, y = (_number(name, part) for part in value)
    if max(abs(x), abs(y)) > _MAX_COORDINATE:
        raise _FieldError(f"{name} must lie within {_MAX_COORDINATE:g} m, got {value}")
    return x, y


def _number(name: str, value: Any) -> float:  # noqa: ANN401
    # YAML's yes and no are numbers to Python.
    if not isinstance(value, bool) and isinstance(value, int | float):
        with contextlib.suppress(OverflowError):  # of an integer beyond all floats
            number = float(value)
            if math.isfinite(number):
                return number
    raise _FieldError(f"{name} must be a finite number, got {_shown(value)}")


def _shown(value: Any) -> str:  # noqa: ANN401
    """Return a value for a message, cut to a readable length."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."
