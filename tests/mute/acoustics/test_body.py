"""The robot's shell, and the one number that is fitted, as it is read from its file."""

from __future__ import annotations

import json
import re

import pytest
from places import REPOSITORY

from mute.acoustics.body import CALIBRATION_FILE, SHELL, load_transmissibility
from mute.support.errors import MuteError


@pytest.fixture
def path(tmp_path):
    """Where a test has its calibration."""
    return tmp_path / "calibration.json"


def with_value(value):
    return f'{{"transmissibility": {value}}}'


def test_the_shell_is_a_light_plate_that_hardly_radiates_below_its_first_mode():
    assert SHELL.surface_mass == pytest.approx(3.15)
    assert pytest.approx(190.0, abs=5.0) == SHELL.first_mode
    assert SHELL.critical_frequency > 10e3
    assert 0.02 < SHELL.mobility < 0.04  # a force moves it far more than any floor


def test_the_calibration_that_ships_is_a_share_and_says_what_it_was_fitted_to():
    assert CALIBRATION_FILE.samefile(REPOSITORY / "resources/acoustics/calibration.json")
    content = json.loads(CALIBRATION_FILE.read_text())
    assert load_transmissibility() == content["transmissibility"]
    assert 0.0 < load_transmissibility() < 1.0
    assert content["floor"]
    assert content["reference"]


@pytest.mark.parametrize("value", ["0", "1", "0.042", "4.2e-2"])
def test_a_number_from_0_to_1_is_a_share(path, value):
    path.write_text(with_value(value))
    share = load_transmissibility(path)
    assert share == float(value)
    assert isinstance(share, float)


NO_SHARES = ["-0.01", "1.01", "NaN", "Infinity", "1e999", "true", '"1"', "null", "[1]", "{}"]
LONG = ["1" + "0" * 400, '"' + "x" * 400 + '"']


@pytest.mark.parametrize("value", [*NO_SHARES, *LONG])
def test_what_is_no_share_is_refused_by_its_value_in_one_line(path, value):
    path.write_text(with_value(value))
    with pytest.raises(MuteError, match=r"must be a number in \[0, 1\], got ") as refusal:
        load_transmissibility(path)
    message = str(refusal.value)
    assert message.startswith(f"{path}: transmissibility")
    assert len(message) < len(str(path)) + 100
    assert "\n" not in message


NO_OBJECTS = [b"null", b"[]", b'"transmissibility"', b"{}", b'{"floors": {}}']
NO_JSON = [b"", b"\xff\xfe", b"\x00", b"[" * 100_000, b'{"transmissibility": }']


@pytest.mark.parametrize("content", [*NO_OBJECTS, *NO_JSON, with_value("1" * 5000).encode()])
def test_what_is_no_calibration_is_refused_in_one_line(path, content):
    path.write_bytes(content)
    with pytest.raises(MuteError, match="is no calibration: ") as refusal:
        load_transmissibility(path)
    assert str(path) in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_calibration_without_the_number_names_it(path):
    path.write_text('{"floors": {}}')
    with pytest.raises(MuteError, match="'transmissibility' is missing"):
        load_transmissibility(path)


def test_a_calibration_that_cannot_be_read_is_named_with_the_reason(tmp_path, path):
    with pytest.raises(MuteError, match=f"cannot read .*{re.escape(str(path))}: No such file"):
        load_transmissibility(path)
    with pytest.raises(MuteError, match=f"cannot read .*{re.escape(str(tmp_path))}: Is a dir"):
        load_transmissibility(tmp_path)
