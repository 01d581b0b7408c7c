"""What is told of ground is what the exam wrote."""

from __future__ import annotations

import re

import pytest

from mute.command_lines.card_terrain import terrain_figures, terrain_speed
from mute.support.errors import MuteError

CROSSING = {
    "kind": "stairs",
    "level": 2,
    "speed": 0.4,
    "episodes": 7,
    "success": 0.25,
    "falls": 0.5,
    "made": 0.6,
    "height_rmse": 0.031,
    "height_rmse_flat": 0.042,
    "height_rmse_mean": 0.053,
    "contact_time_mae": 0.025,
    "contact_time_mae_clock": None,
}
MEASURED = {
    "beta": 0.5,
    "seconds": 12.0,
    "machine": "a machine",
    "crossings": [CROSSING],
    "hardships": [{"hardship": "ice", "robots": 7, "survived": 0.875, "made": 0.9}],
}
PUSHES = [{"robots": 3, "largest": 0.8, "deviation": 0.12, "still_up": 0.0}]
WALK = [
    {"robots": 3, "minutes": 30.0, "survived": 0.66, "velocity_rmse": 0.2, "yaw_rate_rmse": 0.3}
]


def test_every_figure_is_there_in_units_that_are_read():
    part = terrain_figures(MEASURED | {"pushes": PUSHES, "walk": WALK})
    assert "beta 0.5, 0.4 m/s, 7 robots" in part
    assert "12 s, on a machine" in part
    assert re.search(
        r"^\| stairs \| 2 \| 0\.4 \| 25% \| 50% \| 60% \| 31 \| 42 \| 53 \| 25 \| - \|$", part, re.M
    )
    assert re.search(r"^\| ice \| 87.5% \| 90% \|$", part, re.M)
    assert "0.80 ± 0.12 m/s over 3 robots" in part
    assert "Of 3 robots, 66% walk" in part


def test_what_was_not_measured_is_not_told():
    part = terrain_figures(MEASURED)
    assert "push" not in part
    assert "random" not in part


@pytest.mark.parametrize("missing", ["crossings", "hardships"])
def test_an_exam_without_its_tables_is_refused(missing):
    with pytest.raises(MuteError, match=f"has no {missing}"):
        terrain_figures(MEASURED | {missing: []})


def test_speed_is_told_beside_that_on_flat_ground():
    rates = [
        {"ground": "flat", "steps_per_second": 9e3, "speed": 1.0, "speed_low": 1.0,
         "speed_high": 1.0, "map_share": 1e-4},
        {"ground": "rough", "steps_per_second": 8123.4, "speed": 0.9, "speed_low": 0.85,
         "speed_high": 0.92, "map_share": 0.0321},
    ]  # fmt: skip
    measured = {"options": " --turns 3", "num_envs": 8, "turns": 3, "machine": "m", "rates": rates}
    part = terrain_speed(measured)
    assert "`python -m benchmarks.terrain --turns 3 --out docs/terrain/speed.json`" in part
    lines = part.splitlines()
    assert "| flat | 9,000 | 100% | 0.0% |" in lines
    assert "| rough | 8,123 | 90% [85%, 92%] | 3.2% |" in lines
