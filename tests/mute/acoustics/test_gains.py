"""Tests of the gains that ship, and of reading them from a file that is damaged."""

from __future__ import annotations

import json

import pytest
from places import REPOSITORY

from mute.acoustics.floors import FLOORS
from mute.acoustics.gains import load_gains
from mute.support.errors import MuteError


def with_gains(value):
    """Return a calibration in which every floor has a gain, as it stands in the file."""
    content = json.dumps({"floors": {name: {"gain": "here"} for name in FLOORS}})
    return content.replace('"here"', value)


@pytest.mark.parametrize("value", ["1", "0.5", "2e3"])
def test_a_positive_number_is_a_gain(tmp_path, value):
    path = tmp_path / "gains.json"
    path.write_text(with_gains(value))
    assert load_gains(path) == dict.fromkeys(FLOORS, float(value))


@pytest.mark.parametrize(
    "value",
    ["0", "-1", "NaN", "Infinity", "1e999", "1" + "0" * 400, "true", '"1"', "null", "[1]"],
)
def test_what_is_no_gain_is_refused_with_its_floor(tmp_path, value):
    path = tmp_path / "gains.json"
    path.write_text(with_gains(value))
    with pytest.raises(MuteError, match=r"the gain of wood must be a number > 0, got ") as refusal:
        load_gains(path)
    assert str(refusal.value).startswith(f"{path}: ")
    assert len(str(refusal.value)) < len(str(path)) + 90


@pytest.mark.parametrize(
    "content",
    [b"\xff\xfe", b"\x00", b"null", b"[]", b"[" * 100_000, with_gains("1" * 5000).encode()],
)
def test_a_file_that_is_no_json_of_floors_is_refused_in_one_line(tmp_path, content):
    path = tmp_path / "gains.json"
    path.write_bytes(content)
    with pytest.raises(MuteError, match="is no calibration: ") as refusal:
        load_gains(path)
    assert str(path) in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_the_shipped_calibration_has_every_floor_and_where_it_comes_from():
    content = json.loads((REPOSITORY / "resources/acoustics/calibration.json").read_text())
    assert load_gains().keys() == FLOORS.keys() == content["floors"].keys()
    for floor in content["floors"].values():
        assert floor["source"]
        if "target_mnl" in floor:
            assert floor["mnl"] == pytest.approx(floor["target_mnl"], abs=0.02)
    assert content["command"].startswith("python -m mute.acoustics.calibration ")


@pytest.mark.parametrize(
    ("content", "word"),
    [
        ("", "no calibration"),
        ("{}", "'floors' is missing"),
        ('{"floors": {"wood": {"gain": 1}}}', "'carpet' is missing"),
        (
            json.dumps({"floors": {key: {"gain": -1.0} for key in FLOORS}}),
            "wood must be a number > 0",
        ),
    ],
)
def test_a_broken_calibration_is_refused_in_one_line(content, word, tmp_path):
    path = tmp_path / "calibration.json"
    path.write_text(content)
    with pytest.raises(MuteError, match=word) as caught:
        load_gains(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
