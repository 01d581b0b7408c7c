"""What is told of ground is what the exam wrote."""

from __future__ import annotations

import re

import pytest

from mute.command_lines.card_terrain import terrain_figures, terrain_speed
from mute.evaluation.reliability.figures import Figure, Target
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
    "contact_time_mae_clock": 0.021,
    "phase_mae": 0.123,
    "phase_mae_clock": 0.2,
}
MEASURED = {
    "options": " --episodes 7",
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
    assert "`python evaluate.py terrain --episodes 7 --out docs/terrain`" in part
    assert "beta 0.5, 0.4 m/s, 7 robots" in part
    assert "12 s, on a machine" in part
    assert re.search(
        r"^\| stairs \| 2 \| 0\.4 \| 25% \| 50% \| 60% \| 31 \| 42 \| 53 \| 25 \| 21 \| 0\.12 \| "
        r"0\.20 \|$",
        part,
        re.M,
    )
    assert re.search(r"^\| ice \| 87.5% \| 90% \|$", part, re.M)
    assert "0.80 ± 0.12 m/s over 3 robots" in part
    assert "Of 3 robots, 66% walk" in part


def test_it_says_in_how_many_rows_the_estimator_is_better():
    worse = CROSSING | {"height_rmse": 0.05, "contact_time_mae": 0.01, "phase_mae": 0.3}
    part = terrain_figures(MEASURED | {"crossings": [CROSSING, worse]})
    assert "Of these 2 rows" in part
    assert "level at the feet in 1, than the mean map in 2, and than both in 1" in part
    assert "than the clock's in 1, its phase in 1." in part
    blind = {name: value for name, value in CROSSING.items() if name != "height_rmse"}
    assert "Of these 1 rows" in terrain_figures(MEASURED | {"crossings": [CROSSING, blind]})


def test_ten_minutes_at_random_are_told_with_their_spread_over_seeds():
    rows = [
        {"robots": 4, "minutes": 10.0, "seed": seed, "velocity_rmse": 0.1 * seed,
         "yaw_rate_rmse": 0.2}
        for seed in (1, 2, 3)
    ]  # fmt: skip
    part = terrain_figures(MEASURED | {"tracking": rows})
    assert "4 robots with each of 3 seeds are 0.200 ± 0.100 m/s and 0.200 ± 0.000 rad/s" in part


def test_targets_are_told_by_seed_with_who_meets_them():
    def seed(number, share, push):
        own = [
            Figure("crossings", "flat: get across", share, "share", Target(at_least=0.99)),
            Figure("pushes", "largest push, mean", push, "m/s", Target(at_least=1.0)),
        ]
        return {"trained_seed": number, "figures": [figure.as_dict() for figure in own]}

    part = terrain_figures(MEASURED, [seed(0, 1.0, 1.5), seed(1, 0.98, 1.7)])
    assert "By the seeds 0, 1" in part
    row = "| crossings | flat: get across | 100.0 %, 98.0 % | 99.0 ± 1.4 | >= 99.0 % | 1 of 2 |"
    assert row in part.splitlines()
    assert "1.60 ± 0.14 | >= 1 m/s | 2 of 2 |" in part


def test_what_was_not_measured_is_not_told():
    part = terrain_figures(MEASURED)
    assert "largest push" not in part
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
    part = terrain_speed(measured | {"timestep": 0.01})
    assert "physics steps of 10 ms" in part
    assert "`python -m benchmarks.terrain --turns 3 --out docs/terrain/speed.json`" in part
    lines = part.splitlines()
    assert "| flat | 9,000 | 100% | 0.0% |" in lines
    assert "| rough | 8,123 | 90% [85%, 92%] | 3.2% |" in lines
