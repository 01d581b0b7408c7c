"""What is measured to compare, and that it is measured once."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from mute.config import TaskCfg
from mute.evaluation.comparison.measurements import FULL, QUICK, Kept, jobs
from mute.evaluation.comparison.walkers import DREAMWAQ, MPC, MUTE, Walker


def _make_walker(method: str, sha256: str = "1") -> Walker:
    driver = SimpleNamespace(
        cfg=TaskCfg(), task=method, iteration=0, quiet_factor=method not in (MPC, DREAMWAQ)
    )
    return Walker(method, cast("Any", driver), f"{method}.pt", sha256)


WALKERS = [_make_walker(MPC), _make_walker(DREAMWAQ), _make_walker(MUTE)]


def test_what_knows_no_quiet_factor_is_measured_at_one_alone():
    wanted = jobs(WALKERS, FULL, ("levels",))
    assert [(job.walker.method, job.surface) for job in wanted] == [
        (method, surface) for method in (MPC, DREAMWAQ, MUTE) for surface in FULL.speeds
    ]
    betas = {job.walker.method: {each.beta for each in job.settings} for job in wanted}
    assert betas == {MPC: {0.0}, DREAMWAQ: {0.0}, MUTE: {0.0, 0.5, 1.0}}
    speeds = {job.surface: {each.command_speed for each in job.settings} for job in wanted}
    assert speeds["wood"] == {0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0}
    assert all(0.5 in asked for asked in speeds.values())


def test_the_quiet_factor_is_swept_in_tenths_for_mute_alone():
    (job,) = jobs(WALKERS, FULL, ("sweep",))
    assert job.walker.method == MUTE
    assert [each.beta for each in job.settings] == [round(0.1 * i, 1) for i in range(11)]
    assert {each.command_speed for each in job.settings} == {0.8}
    assert FULL.trials == 20
    assert FULL.seconds == 10.0


def test_labels_name_beta_where_it_changes_something():
    mpc, dreamwaq, mute = WALKERS
    assert (mpc.label(0.0), dreamwaq.label(0.0)) == ("MPC", "DreamWaQ")
    assert mute.label(0.5) == "MUTE, beta 0.5"
    assert mpc.training_seed is None
    assert mute.training_seed == 0


def _kept(folder: Path, commit: str = "x", calibration: str = "c") -> Kept:
    made_with = {"commit": commit, "machine": "m"}
    return Kept(folder, {"calibration_sha256": calibration} | made_with)


def test_rows_are_read_back_for_the_very_same_measurement_alone(tmp_path):
    kept = _kept(tmp_path)
    (job,) = jobs(WALKERS, QUICK, ("sweep",))
    asked = kept.asked(job, QUICK, 1)
    assert kept.read(asked, job.walker) is None
    rows = kept.write(asked, [{"mnl_mean": 60.0, "beta": 0.5}])
    assert rows == [{"mnl_mean": 60.0, "beta": 0.5, "commit": "x", "machine": "m"}]
    other = dataclasses.replace(job, walker=_make_walker(MUTE, "2"))
    changed = [
        kept.asked(job, QUICK, 2),
        kept.asked(job, QUICK.with_trials(3), 1),
        kept.asked(other, QUICK, 1),
        _kept(tmp_path, calibration="d").asked(job, QUICK, 1),
    ]
    assert all(kept.read(each, job.walker) is None for each in changed)


def test_rows_of_another_commit_tell_theirs_and_have_the_names_that_are_asked_for(tmp_path):
    (job,) = jobs(WALKERS, QUICK, ("sweep",))
    first, later = _kept(tmp_path, "x"), _kept(tmp_path, "y")
    first.write(first.asked(job, QUICK, 1), [{"mnl_mean": 60.0, "beta": 0.5, "label": "old"}])
    named = dataclasses.replace(job.walker, method="no LSTM", name="elsewhere.pt")
    rows = later.read(later.asked(job, QUICK, 1), named)
    assert rows is not None
    (row,) = rows
    assert (row["commit"], row["mnl_mean"]) == ("x", 60.0)
    assert (row["label"], row["policy"]) == ("no LSTM, beta 0.5", "elsewhere.pt")


def test_rows_of_a_tree_that_differs_from_its_commit_are_not_read_back(tmp_path):
    (job,) = jobs(WALKERS, QUICK, ("sweep",))
    dirty = _kept(tmp_path, "x-dirty")
    asked = dirty.asked(job, QUICK, 1)
    dirty.write(asked, [{"beta": 0.5}])
    assert dirty.read(asked, job.walker) is None
    assert _kept(tmp_path).read(asked, job.walker) is None
    assert len(list(tmp_path.iterdir())) == 1  # for who looks for it


@pytest.mark.parametrize("extent", [FULL, QUICK])
def test_no_batch_is_larger_than_a_machine_bears(extent):
    for job in jobs(WALKERS, extent, ("levels", "sweep")):
        assert len(job.settings) * extent.trials <= 512
