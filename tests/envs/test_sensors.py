"""Tests of finding what sensors read."""

from __future__ import annotations

import mujoco
import pytest
import torch

from envs.scene import LEGS, SceneCfg, build_scene, make_spec
from envs.sensors import RobotSensors, sensor_slice
from envs.simulation import BatchSimulation


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


def test_the_robots_sensors_follow_the_engine_and_keep_its_last_physics_steps():
    samples = 3
    simulation = BatchSimulation(build_scene(SceneCfg(), foot_samples=samples), num_envs=2)
    simulation.reset(torch.ones(2, dtype=torch.bool))
    simulation.qpos[:, 2] += torch.tensor([0.0, 1.0])  # one lands from where it stands, one falls
    simulation.forward()
    sensors = RobotSensors(simulation)
    seen = []
    for _ in range(33 * samples):  # a ring begins with its oldest reading after whole rounds
        simulation.step()
        seen.append((sensors.foot_vel[..., 2].clone(), sensors.foot_contact.clone()))
    foot_vel_z, foot_contact = (torch.stack(part) for part in zip(*seen[-samples:], strict=True))
    assert torch.equal(sensors.foot_vel_z_history, foot_vel_z)
    assert torch.equal(sensors.foot_contact_history, foot_contact)
    _check_against_mujoco(simulation, sensors)


def _check_against_mujoco(simulation, sensors):
    for robot in range(2):
        data = mujoco.MjData(simulation.model)
        data.sensordata[:] = simulation.sensordata[robot]
        for i, leg in enumerate(LEGS):
            for quantity in ("foot_pos", "foot_vel", "foot_contact"):
                reading = getattr(sensors, quantity)[robot, i].flatten().tolist()
                assert reading == data.sensor(f"{leg}_{quantity}").data.tolist()
        assert sensors.trunk_contact.shape == (2, 2)
        assert sensors.link_contact[robot, 0] == data.sensor("trunk_contact").data[0]
