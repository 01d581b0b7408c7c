"""Betas are compared at one actual speed."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import pytest
from standing import Standing

from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.evaluation.gait import Gait
from mute.evaluation.matched_speed import figures_at_speed, level_at_speed, sweep_beta_at_speed
from mute.evaluation.trials import evaluation_cfg


def _make_env(num_envs=2, seconds=1.0):
    cfg = evaluation_cfg(QuadrupedEnvCfg(num_threads=1), num_envs, seconds, seed=0)
    return QuadrupedEnv(cfg)


def _make_gait(**given):
    zeros: dict[str, Any] = {field.name: 0.0 for field in dataclasses.fields(Gait)}
    return Gait(**(zeros | given))


def test_figures_at_a_speed_are_interpolated_between_the_nearest_speeds():
    gaits = [
        _make_gait(speed=0.6, landing_speed_mean=0.4),
        _make_gait(speed=0.4, landing_speed_mean=0.2),
        _make_gait(speed=0.8, landing_speed_mean=1.0),
    ]
    assert figures_at_speed(gaits, 0.45)["landing_speed_mean"] == pytest.approx(0.25)
    assert figures_at_speed(gaits, 0.7)["landing_speed_mean"] == pytest.approx(0.7)


def test_figures_at_a_speed_that_no_gait_reaches_are_nan():
    figures = figures_at_speed([_make_gait(speed=0.1), _make_gait(speed=0.2)], 0.5)
    assert all(math.isnan(value) for value in figures.values())


def test_a_sweep_needs_a_robot_for_every_pair_of_beta_and_speed():
    with pytest.raises(ValueError, match="num_envs must be >= 12"):
        sweep_beta_at_speed(_make_env(4), Standing(4), 0.5, [0.0, 1.0], 5)


def test_a_robot_that_stands_matches_no_walking_speed():
    rows = sweep_beta_at_speed(_make_env(6), Standing(6), 0.5, [0.25], 60)
    assert rows[0]["beta"] == 0.25
    assert math.isnan(rows[0]["landing_speed_mean"])


def test_a_level_is_read_off_between_the_actual_speeds_that_enclose_it():
    walks = [(0.6, 64.0), (0.4, 60.0), (0.45, math.nan)]
    assert level_at_speed(walks, 0.5) == pytest.approx(62.0)
    assert math.isnan(level_at_speed(walks, 0.7))
    assert math.isnan(level_at_speed([], 0.5))
