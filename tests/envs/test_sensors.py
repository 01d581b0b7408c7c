"""Tests of finding what sensors read."""

from __future__ import annotations

import mujoco
import pytest

from envs.scene import SceneCfg, build_scene, make_spec
from envs.sensors import sensor_slice


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return build_scene(SceneCfg())


def test_sensor_slice_names_the_columns(model):
    assert sensor_slice(model, "FR_foot_pos", 4) == slice(0, 12)
    assert sensor_slice(model, "RR_foot_vel", 2) == slice(18, 24)
    assert sensor_slice(model, "trunk_contact", 1) == slice(28, 29)


@pytest.mark.parametrize("count", [0, -1, 27])
def test_sensor_slice_refuses_a_count_that_the_model_cannot_fill(model, count):
    with pytest.raises(ValueError, match=f"count is {count}"):
        sensor_slice(model, "FR_foot_pos", count)


def test_sensor_slice_refuses_an_unknown_sensor(model):
    with pytest.raises(ValueError, match="no such sensor"):
        sensor_slice(model, "FR_toe_pos", 4)


def test_sensor_slice_refuses_sensors_of_another_kind_in_between():
    spec = make_spec(SceneCfg())
    spec.delete(spec.sensor("RL_foot_pos"))  # the fourth from FR_foot_pos on is now a velocity
    with pytest.raises(ValueError, match="not contiguous"):
        sensor_slice(spec.compile(), "FR_foot_pos", 4)
