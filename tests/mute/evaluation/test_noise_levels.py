"""Tests of the noise evaluation: the paper's protocol on the shipped policy, and its files."""

from __future__ import annotations

import dataclasses
import math
import re

import pytest
import torch
from places import SHIPPED_POLICY
from quick_products import use_bfloat16
from scipy import stats

from mute.acoustics import energy, listener
from mute.acoustics.microphone import Microphone
from mute.acoustics.soundscape import SOURCES
from mute.acoustics.sources.fan import FAN_LEVEL
from mute.acoustics.tally import HeardLevels
from mute.controllers import load_policy
from mute.evaluation import noise_levels as noise
from mute.evaluation import noise_probe
from mute.evaluation.noise_levels import NoiseRow, NoiseSetting, measure_noise
from mute.evaluation.noise_probe import NoiseProbe
from mute.rendering.kept_walks import KeptWalks
from mute.support.errors import MuteError
from mute.support.precision import hidden_dtype


def _measure(seed: int, trials: int = 5, seconds: float = 3.0, **options) -> list[NoiseRow]:
    policy = load_policy(SHIPPED_POLICY)
    settings = [NoiseSetting(beta, 0.5) for beta in (0.0, 1.0)]
    return measure_noise(policy, "wood", settings, trials, seconds, seed, **options)


@pytest.fixture(scope="module")
def rows() -> list[NoiseRow]:
    return _measure(seed=1)


def test_the_same_seed_gives_the_same_table(rows):
    assert _measure(seed=1) == rows


def test_robots_differ_unless_they_are_twins_of_the_exact_model(rows):
    exact = _measure(seed=1, nominal=True)
    assert [row.robots for row in (*rows, *exact)] == ["different"] * 2 + ["nominal"] * 2
    # Of five walks a spread is known to a third of itself.
    assert sum(row.mnl_std**2 for row in exact) < sum(row.mnl_std**2 for row in rows)


def test_a_policy_compared_with_itself_differs_by_less_than_its_confidence_interval(rows):
    for first, second in zip(rows, _measure(seed=2), strict=True):
        # Welch: the means differ, but zero lies within the interval of their difference.
        welch = stats.ttest_ind_from_stats(
            *(first.mnl_mean, first.mnl_std, 5), *(second.mnl_mean, second.mnl_std, 5), False
        )
        assert 0.05 < welch.pvalue < 1.0


def test_every_control_step_is_told_and_a_source_can_be_heard_alone_from_afar():
    steps = []
    rows = _measure(
        seed=1,
        trials=1,
        seconds=1.0,
        microphone=Microphone((0.0, 2.0, 0.0), "beside"),
        sources=("fan",),
        on_step=lambda: steps.append(1),
    )
    assert len(steps) == 100  # a second to settle, and one that is measured
    assert all(row.mnl_mean < 55.0 - 6.0 for row in rows)
    assert rows[0].pnl_mean - rows[0].mnl_mean < 1.5


def test_the_levels_of_the_sources_add_up_to_the_whole(rows):
    for row in rows:
        own = [getattr(row, f"laeq_{name}") for name in SOURCES]
        total = 10.0 * math.log10(sum(10.0 ** (0.1 * level) for level in own))
        assert total == pytest.approx(row.laeq_mean, abs=0.5)
        assert row.laeq_fan == pytest.approx(FAN_LEVEL, abs=0.5)
    loud, quiet = rows
    assert loud.laeq_impacts - quiet.laeq_impacts > 3.0
    assert loud.laeq_body - quiet.laeq_body > 3.0


def test_a_source_that_is_not_heard_has_no_level():
    (row,) = _measure(seed=1, trials=1, seconds=0.5, sources=("drive",), from_energies=True)[:1]
    assert math.isnan(row.laeq_impacts)
    assert row.laeq_drive == pytest.approx(row.laeq_mean, abs=1e-6)


def _heard(mnl: float, impacts: float = 60.0, seconds: float = 2.0) -> HeardLevels:
    return HeardLevels(mnl, mnl + 4.0, mnl + 1.0, {"impacts": impacts}, seconds, power=25.0)


def _row_of(monkeypatch, levels: list[HeardLevels]) -> NoiseRow:
    monkeypatch.setattr(noise.Listener, "levels", lambda _: levels)
    return _measure(seed=1, trials=len(levels) // 2, seconds=0.02, from_energies=True)[0]


def test_a_trial_without_a_level_leaves_the_others_theirs(monkeypatch):
    mute = HeardLevels(math.nan, math.nan, math.nan, {"impacts": math.nan}, 0.0, math.nan)
    row = _row_of(monkeypatch, [_heard(68.0), _heard(68.2), mute, _heard(68.1)] * 2)
    assert (row.trials, row.trials_heard) == (4, 3)
    assert row.mnl_mean == pytest.approx(68.1)
    assert row.pnl_mean == pytest.approx(72.1)
    assert row.laeq_mean == pytest.approx(69.1)
    assert row.mnl_std == pytest.approx(0.1)
    assert row.mnl_ci95 == pytest.approx(4.303 * 0.1 / 3**0.5, rel=1e-3)  # t of 2 degrees
    assert row.power == 25.0


def test_a_source_that_is_silent_in_one_trial_keeps_the_level_of_the_others_energy(monkeypatch):
    row = _row_of(monkeypatch, [_heard(60.0, 60.0), _heard(60.0, -math.inf)] * 2)
    assert row.laeq_impacts == pytest.approx(60.0 - 3.01, abs=0.01)
    assert math.isnan(row.laeq_fan)  # not among what is heard


def test_a_setting_of_which_nothing_is_heard_has_no_level(monkeypatch):
    mute = HeardLevels(math.nan, math.nan, math.nan, {"impacts": math.nan}, 0.0, math.nan)
    row = _row_of(monkeypatch, [mute, mute])
    assert row.trials_heard == 0
    assert all(math.isnan(value) for value in (row.mnl_mean, row.pnl_mean, row.laeq_impacts))
    assert math.isnan(row.power)


def test_power_is_the_work_of_all_trials_over_their_time(monkeypatch):
    half = dataclasses.replace(_heard(60.0), seconds=1.0, power=10.0)
    assert _row_of(monkeypatch, [half, _heard(60.0)] * 2).power == pytest.approx(20.0)


def test_a_probe_of_a_training_is_near_the_table_and_draws_no_random_number(rows):
    policy = load_policy(SHIPPED_POLICY)
    before = torch.get_rng_state()
    levels = NoiseProbe().measure(policy)
    assert torch.equal(torch.get_rng_state(), before)
    expected = {f"Noise/level_beta_{row.beta:g}": row.mnl_mean for row in rows}
    assert levels == pytest.approx(expected, abs=2.0)  # other robots


def test_a_probe_walks_in_full_precision_whatever_the_training_computes_in(monkeypatch):
    asked = []

    def note(*_, **__) -> list[NoiseRow]:
        asked.append(hidden_dtype(torch.device("cpu")))
        return []

    use_bfloat16(monkeypatch)
    monkeypatch.setattr(noise_probe, "measure_noise", note)
    NoiseProbe().measure(load_policy(SHIPPED_POLICY))
    assert asked == [torch.float32]
    assert hidden_dtype(torch.device("cpu")) == torch.bfloat16


def test_a_training_that_measures_no_noise_needs_no_calibration(monkeypatch):
    def fail() -> None:
        raise MuteError("no calibration")

    policy = load_policy(SHIPPED_POLICY)
    monkeypatch.setattr(energy, "load_transmissibility", fail)
    probe = NoiseProbe()
    with pytest.raises(MuteError, match="no calibration"):
        probe.measure(policy)


def test_a_probe_leaves_out_the_robots_that_keep_falling(monkeypatch):
    mute = HeardLevels(math.nan, math.nan, math.nan, {}, 0.0, math.nan)
    levels = [_heard(68.0), mute, _heard(69.0), mute, mute, mute, mute, mute]
    monkeypatch.setattr(noise.Listener, "levels", lambda _: levels)
    monkeypatch.setattr(noise_probe, "_SECONDS", 0.02)
    policy = load_policy(SHIPPED_POLICY)
    assert NoiseProbe().measure(policy) == {"Noise/level_beta_0": pytest.approx(68.5)}


def test_a_policy_that_acts_between_the_physics_steps_has_no_level():
    policy = load_policy(SHIPPED_POLICY)
    policy.cfg.env.scene = dataclasses.replace(policy.cfg.env.scene, timestep=0.0051)
    assert NoiseProbe().measure(policy) == {}


def test_clipped_samples_are_told_with_their_file(tmp_path, monkeypatch):
    monkeypatch.setattr(listener, "WAV_FULL_SCALE", 0.01)
    told = []
    keep = KeptWalks({0: tmp_path / "loud.wav"}, on_note=told.append)
    _measure(seed=1, trials=1, seconds=0.5, keep=keep)
    (note,) = told
    assert re.fullmatch(rf"{tmp_path}/loud.wav: [1-9]\d+ samples are clipped", note)


def test_a_quiet_walk_is_quieter_than_a_loud_one_and_both_are_louder_than_the_fan(rows):
    loud, quiet = rows
    assert (loud.beta, quiet.beta) == (0.0, 1.0)
    assert 55.0 < quiet.mnl_mean < loud.mnl_mean - 1.0
    for row in rows:
        assert row.mnl_mean < row.pnl_mean
        assert row.fall_rate == 0.0


def test_the_cost_of_transport_is_power_over_weight_and_speed(rows):
    for row in rows:
        assert row.cost_of_transport == pytest.approx(
            row.power / (125.0 * row.speed_mean), rel=0.01
        )
