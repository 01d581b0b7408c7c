"""What is measured to compare, and that it is measured once."""

from __future__ import annotations

import dataclasses
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


def test_rows_are_read_back_for_the_very_same_measurement_alone(tmp_path):
    kept = Kept(tmp_path, {"calibration_sha256": "c", "commit": "x"})
    (job,) = jobs(WALKERS, QUICK, ("sweep",))
    asked = kept.asked(job, QUICK, 1)
    assert kept.read(asked) is None
    kept.write(asked, [{"mnl_mean": 60.0}])
    assert Kept(tmp_path, {"calibration_sha256": "c", "commit": "x"}).read(asked) == [
        {"mnl_mean": 60.0}
    ]
    other = dataclasses.replace(job, walker=_make_walker(MUTE, "2"))
    changed = [
        kept.asked(job, QUICK, 2),
        kept.asked(job, QUICK.with_trials(3), 1),
        kept.asked(other, QUICK, 1),
        Kept(tmp_path, {"calibration_sha256": "d", "commit": "x"}).asked(job, QUICK, 1),
        Kept(tmp_path, {"calibration_sha256": "c", "commit": "y"}).asked(job, QUICK, 1),
    ]
    assert all(kept.read(each) is None for each in changed)


@pytest.mark.parametrize("extent", [FULL, QUICK])
def test_no_batch_is_larger_than_a_machine_bears(extent):
    for job in jobs(WALKERS, extent, ("levels", "sweep")):
        assert len(job.settings) * extent.trials <= 512
