"""Tests of the courses: what a file says, what is refused, which floor lies where, the map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from places import REPOSITORY

from mute.evaluation.course.course import Course, FloorArea, load_course
from mute.evaluation.course.course_map import coloured_stretches, draw_map
from mute.evaluation.course.long_walk import Track
from mute.support.errors import MuteError

OFFICE = REPOSITORY / "resources" / "courses" / "office.yaml"


def _make_content():
    return {
        "speed": 0.4,
        "path": [[0, 0], [3, 0], [3, 4]],
        "floors": [
            {"floor": "wood", "low": [-1, -1], "high": [2, 1]},
            {"floor": "tile", "low": [2, -1], "high": [4, 5]},
        ],
    }


def _write(directory: Path, content) -> Path:
    path = directory / "course.yaml"
    path.write_text(content if isinstance(content, str) else yaml.safe_dump(content))
    return path


def _make_track(readings: int) -> Track:
    ramp = np.linspace(0.0, 3.0, readings)
    names = np.where(ramp < 2.0, "wood", "tile")
    return Track(
        ramp, ramp, np.zeros(readings), names, np.linspace(60.0, 59.0 + readings, readings)
    )


def test_a_course_is_what_its_file_says(tmp_path):
    course = load_course(_write(tmp_path, _make_content()))
    assert course.speed == 0.4
    assert course.path == ((0.0, 0.0), (3.0, 0.0), (3.0, 4.0))
    assert course.floors[1] == FloorArea("tile", (2.0, -1.0), (4.0, 5.0))
    assert course.length == 7.0
    assert course.floor_names == ("wood", "tile")


def test_the_office_is_as_long_and_as_fast_as_the_papers_walk():
    course = load_course(OFFICE)
    assert course.length == pytest.approx(91.7, abs=0.05)
    assert course.speed == 0.36


def test_the_office_leads_over_wood_tile_carpet_concrete_and_wood_again():
    course = load_course(OFFICE)
    names = np.array(course.floor_names)[course.floor_at(_points_along(course))]
    met = [name for name, before in zip(names[1:], names[:-1], strict=True) if name != before]
    assert [names[0], *met] == ["wood", "tile", "carpet", "concrete", "wood"]


def test_the_office_has_floor_within_a_metre_and_a_half_of_the_path():
    course = load_course(OFFICE)
    turns = np.linspace(0.0, 2.0 * np.pi, 36)
    circle = np.stack((np.cos(turns), np.sin(turns)), axis=1)
    for radius in (0.0, 0.5, 1.0, 1.5):
        points = _points_along(course)[:, None] + radius * circle
        assert np.any([area.contains(points) for area in course.floors], axis=0).all()


def test_floors_are_found_by_place_for_arrays_of_any_shape(tmp_path):
    course = load_course(_write(tmp_path, _make_content()))
    places = np.array([[[0.0, 0.0], [3.0, 0.0]], [[2.5, 4.9], [-0.9, 0.9]]])
    assert course.floor_at(places).tolist() == [[0, 1], [1, 0]]
    assert int(course.floor_at((3.0, 2.0))) == 1


def test_outside_of_all_rectangles_lies_the_first_floor_and_on_a_border_the_first_rectangle():
    areas = (FloorArea("tile", (0, 0), (1, 1)), FloorArea("wood", (1, 0), (2, 1)))
    course = Course(((0, 0), (1, 0)), areas, 0.3)
    assert course.floor_at([[9.0, 9.0], [1.0, 0.5], [1.1, 0.5]]).tolist() == [0, 0, 1]


def test_a_floor_that_comes_twice_has_one_index():
    areas = tuple(
        FloorArea(name, (x, -1), (x + 1, 1)) for x, name in enumerate(("wood", "tile", "wood"))
    )
    course = Course(((0, 0), (3, 0)), areas, 0.3)
    assert course.floor_at([[0.5, 0.0], [1.5, 0.0], [2.5, 0.0]]).tolist() == [0, 1, 0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"speed": 0}, "speed must be above 0 and at most 1 m/s, got 0"),
        ({"speed": 1.5}, "speed must be above 0 and at most 1 m/s, got 1.5"),
        ({"speed": True}, "speed must be a finite number, got True"),
        ({"speed": float("nan")}, "speed must be a finite number, got nan"),
        ({"speed": 10**400}, r"speed must be a finite number, got 10{56}\.\.\."),
        ({"path": [[0, 0]]}, r"path must be a list of 2 or more, got \[\[0, 0\]\]"),
        ({"path": [[0, 0], [1]]}, r"path\[1\] must be two numbers \[x, y\] in m, got \[1\]"),
        ({"path": [[0, 0], [1, "b"]]}, r"path\[1\] must be a finite number, got 'b'"),
        ({"path": [[0, 0], [1e6, 0]]}, r"path\[1\] must lie within 10000 m"),
        ({"path": [[1, 0], [2, 0]]}, r"path\[0\] must be \[0, 0\]"),
        ({"path": [[0, 0], [1, 0], [1, 0]]}, r"path\[2\] must differ from the point before"),
        ({"path": [[0, 0], [-3, 0]]}, r"floors must reach 1 m to all sides of the path, got none"),
        ({"floors": []}, r"floors must be a list of 1 or more, got \[\]"),
        ({"floors": ["wood"]}, r"floors\[0\] must be a mapping with floor, low, high, got 'wood'"),
        ({"colour": "red"}, "the course must have the fields speed, path, floors, got 'colour'"),
    ],
)
def test_a_bad_value_is_refused_with_its_field_and_what_is_allowed(tmp_path, change, message):
    path = _write(tmp_path, _make_content() | change)
    with pytest.raises(MuteError, match=rf"^{path}: {message}") as error:
        load_course(path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"floor": "lava"}, r"floors\[1\].floor must be one of wood, .*got 'lava'"),
        ({"high": [2, 5]}, r"floors\[1\].high must be above low in x and y"),
        ({"low": [1.5, -1]}, r"floors\[1\] must not overlap floors\[0\], got \[1.5, -1.0\]"),
        ({"low": [2.5, -1]}, r"floors must reach 1 m to all sides of the path, got none at"),
    ],
)
def test_a_bad_rectangle_is_refused(tmp_path, change, message):
    content = _make_content()
    content["floors"][1] |= change
    with pytest.raises(MuteError, match=message):
        load_course(_write(tmp_path, content))


def test_a_missing_field_is_named(tmp_path):
    content = _make_content()
    del content["speed"]
    with pytest.raises(MuteError, match="the course lacks the field speed"):
        load_course(_write(tmp_path, content))


@pytest.mark.parametrize(
    "text",
    [
        "path: [",
        "a: !!python/object:os.system {}",
        "\x00",
        "[" * 5000,
        "speed: 2020-13-45",
        "speed: 0b_",
        "speed: !!int x",
        "speed: !!timestamp x",
        "speed: " + "9" * 5000,
    ],
)
def test_what_is_no_yaml_is_refused_in_one_line(tmp_path, text):
    with pytest.raises(MuteError, match="is no YAML file") as error:
        load_course(_write(tmp_path, text))
    assert "\n" not in str(error.value)


def test_an_empty_file_is_no_course(tmp_path):
    with pytest.raises(MuteError, match="the course must be a mapping with speed, path, floors"):
        load_course(_write(tmp_path, ""))


def test_a_file_that_is_not_there_is_told(tmp_path):
    with pytest.raises(MuteError, match=r"cannot read the course .*none\.yaml: No such file"):
        load_course(tmp_path / "none.yaml")


def test_a_map_is_coloured_by_the_mean_level_of_each_second():
    lines, levels = coloured_stretches(_make_track(41))
    assert [len(line) for line in lines] == [21, 21]
    assert levels.tolist() == [70.0, 90.0]  # means of 60 to 80 and of 80 to 100
    assert np.array_equal(lines[0][-1], lines[1][0])


def test_a_map_shows_the_names_of_the_floors_and_both_ends(tmp_path):
    course = load_course(_write(tmp_path, _make_content()))
    files = draw_map(course, _make_track(41), tmp_path)
    assert [path.name for path in files] == ["course_map.png", "course_map.svg"]
    assert files[0].read_bytes().startswith(b"\x89PNG")
    drawn = files[1].read_text()
    for name in ("wood", "tile", "start", "end", "level (dBA), modelled"):
        assert f"<!-- {name} -->" in drawn  # matplotlib draws letters and keeps the text beside


def test_the_same_walk_makes_the_same_map(tmp_path):
    course = load_course(_write(tmp_path, _make_content()))
    first = draw_map(course, _make_track(41), tmp_path)[1].read_bytes()
    assert draw_map(course, _make_track(41), tmp_path / "again")[1].read_bytes() == first


def test_one_reading_makes_no_map():
    with pytest.raises(ValueError, match="at least two readings, got 1"):
        coloured_stretches(_make_track(1))


def _points_along(course: Course) -> np.ndarray:
    path = np.array(course.path)
    lengths = np.append(0.0, np.linalg.norm(np.diff(path, axis=0), axis=1).cumsum())
    distance = np.arange(0.0, course.length, 0.05)
    return np.stack([np.interp(distance, lengths, column) for column in path.T], axis=1)
