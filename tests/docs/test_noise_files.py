"""The files of levels in the docs are of the policy and of the calibration that ship."""

from __future__ import annotations

import json

import pytest
from places import REPOSITORY, SHIPPED_POLICY

from mute.acoustics.body import CALIBRATION_FILE
from mute.support.provenance import file_sha256

_NOISE = REPOSITORY / "docs" / "noise"


@pytest.mark.parametrize(
    "name",
    ["noise_about.json", "sweep_speed_about.json", "sweep_beta_about.json", "walk.json"],
)
def test_levels_are_of_the_policy_and_the_calibration_that_ship(name):
    told = json.loads((_NOISE / name).read_text())
    assert told["policy_sha256"] == file_sha256(SHIPPED_POLICY)
    assert told["calibration_sha256"] == file_sha256(CALIBRATION_FILE)
    assert not told["commit"].endswith("-dirty")
