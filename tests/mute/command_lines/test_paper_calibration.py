"""The constant in use, the one that DreamWaQ would give, and how the report tells of both."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import Any, cast

import pytest
from dreamwaq_helpers import write_dreamwaq_policy
from places import RESOURCES, SHIPPED_POLICY

from mute.command_lines import paper_calibration
from mute.command_lines.calibrate import CalibrationArgs
from mute.command_lines.paper_calibration import constant_in_use, dreamwaqs_constants
from mute.command_lines.paper_walkers import find_walkers
from mute.config import TaskCfg
from mute.controllers import load_policy
from mute.evaluation.comparison.measurements import FULL, QUICK, Kept
from mute.evaluation.comparison.walkers import DREAMWAQ, MUTE, Walker
from mute.support.errors import MuteError

_ORIGIN = {"calibration_sha256": "c", "commit": "x", "machine": "m"}


def _walker(method: str, sha256: str) -> Walker:
    driver = SimpleNamespace(cfg=TaskCfg(), task=method, iteration=0, quiet_factor=method == MUTE)
    return Walker(method, cast("Any", driver), f"{sha256}.pt", sha256)


WALKERS = [_walker(DREAMWAQ, "1"), _walker(DREAMWAQ, "2"), _walker(MUTE, "3")]


@pytest.fixture
def fits(monkeypatch) -> list[CalibrationArgs]:
    """Take the place of the fit; return what was fitted, in order."""
    done: list[CalibrationArgs] = []

    def fitted(asked, driver) -> dict[str, Any]:
        done.append(asked)
        levels = {"target_mnl": 73.51, "mnl": 73.51, "mnl_ci95": 0.2, "pnl": 80.0}
        return levels | {"transmissibility": 0.05, "floor": asked.floor, "robots": asked.trials}

    monkeypatch.setattr(paper_calibration, "fitted", fitted)
    return done


def test_the_constant_that_ships_says_what_it_is_fitted_to():
    saved = json.loads((RESOURCES / "acoustics" / "calibration.json").read_text())
    used = constant_in_use()
    assert used["transmissibility"] == saved["transmissibility"]
    assert used["label"] == {"mute": "MUTE, beta 0", "dreamwaq": "DreamWaQ"}[saved["reference"]]
    assert used["floor"] == saved["floor"]
    assert used["policy_sha256"] == saved["policy"]["sha256"]


def test_a_calibration_that_does_not_say_is_used_without(tmp_path):
    path = tmp_path / "calibration.json"
    path.write_text('{"transmissibility": 0.1, "reference": "spot"}')
    expected = {"transmissibility": 0.1, "label": None, "floor": None, "policy_sha256": None}
    assert constant_in_use(path) == expected


def test_dreamwaqs_alone_are_fitted_each_once_on_wood_to_the_papers_row(tmp_path, fits):
    kept = Kept(tmp_path, _ORIGIN)
    rows = dreamwaqs_constants(WALKERS, FULL, 3, kept, measured=True, anew=False)
    assert [(row["policy"], row["transmissibility"]) for row in rows] == [
        ("1.pt", 0.05),
        ("2.pt", 0.05),
    ]
    assert {row["commit"] for row in rows} == {"x"}
    first = fits[0]
    assert (first.reference, first.floor, first.speed) == ("dreamwaq", "wood", 0.5)
    assert (first.trials, first.seconds, first.seed) == (64, 3.0, 3)
    # Another constant in use changes nothing of what would fit.
    kept = Kept(tmp_path, _ORIGIN | {"calibration_sha256": "d"})
    assert dreamwaqs_constants(WALKERS, FULL, 3, kept, measured=True, anew=False) == rows
    assert dreamwaqs_constants(WALKERS, FULL, 3, kept, measured=False, anew=True) == rows
    assert len(fits) == 2
    assert dreamwaqs_constants(WALKERS, FULL, 4, kept, measured=False, anew=False) == []
    assert len(fits) == 2
    dreamwaqs_constants(WALKERS, FULL, 3, kept, measured=True, anew=True)
    assert len(fits) == 4


def test_a_policy_that_cannot_be_fitted_is_told_and_ends_nothing(tmp_path, monkeypatch):
    def fitted(*_: Any) -> dict[str, Any]:
        raise MuteError("1.pt falls on wood")

    monkeypatch.setattr(paper_calibration, "fitted", fitted)
    kept = Kept(tmp_path, _ORIGIN)
    (row,) = dreamwaqs_constants(WALKERS[:1], QUICK, 1, kept, measured=True, anew=False)
    assert (row["transmissibility"], row["reason"]) == (None, "1.pt falls on wood")


def test_a_policy_is_really_walked_and_fitted(tmp_path):
    policy = load_policy(SHIPPED_POLICY)
    walker = Walker(DREAMWAQ, policy, str(SHIPPED_POLICY), "1")
    kept = Kept(tmp_path, _ORIGIN)
    (row,) = dreamwaqs_constants([walker], QUICK, 1, kept, measured=True, anew=False)
    assert row["mnl"] == pytest.approx(73.51, abs=0.02)
    # It is MUTE's, whose level is lower with the constant in use, so that more must be heard.
    assert constant_in_use()["transmissibility"] < row["transmissibility"] < 1.0


def test_of_one_that_only_stands_it_is_told_that_no_constant_fits(tmp_path):
    path = write_dreamwaq_policy(tmp_path / "dreamwaq.pt")
    walkers = find_walkers([], [path], [], mpc=False)
    kept = Kept(tmp_path, _ORIGIN)
    (row,) = dreamwaqs_constants(walkers, QUICK, 1, kept, measured=True, anew=False)
    assert row["transmissibility"] is None
    assert row["reason"].startswith("wood: no share of a foot's force gives 73.51 dB")
