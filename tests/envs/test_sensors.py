"""Tests of finding what sensors read."""

from __future__ import annotations

import math

import mujoco
import pytest
import torch

from mute.envs.batch_simulation import BatchSimulation
from mute.envs.scene import LEGS, SceneCfg, build_scene, make_spec
from mute.envs.sensors import RobotSensors, past_readings, sensor_slice


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
    samples = 4
    simulation = BatchSimulation(build_scene(SceneCfg(), foot_samples=samples), num_envs=2)
    simulation.reset(torch.ones(2, dtype=torch.bool))
    simulation.qpos[:, 2] += torch.tensor([0.0, 0.1])  # one stands, the other drops
    tilt = 0.05
    simulation.qpos[1, 3:5] = torch.tensor([math.cos(tilt), math.sin(tilt)])  # onto its right feet
    simulation.forward()
    sensors = RobotSensors(simulation)
    in_part = False
    for _ in range(20):
        seen = []
        for _ in range(samples):  # a ring begins with its oldest reading after whole rounds
            simulation.step()
            seen.append((sensors.foot_vel[..., 2].clone(), sensors.foot_contact.clone()))
        foot_vel_z, foot_contact = (torch.stack(part) for part in zip(*seen, strict=True))
        assert torch.equal(sensors.foot_vel_z_history, foot_vel_z)
        assert torch.equal(sensors.foot_contact_history, foot_contact)
        in_part |= 0 < int(foot_contact[:, 1].sum()) < foot_contact[:, 1].numel()
        _check_against_mujoco(simulation, sensors)
    assert in_part  # feet, robots and times differ in their contacts


@pytest.mark.parametrize(("first", "count", "size"), [("FL_foot_vel", 2, 3), ("RL_foot_vel", 1, 3)])
def test_past_readings_of_some_sensors_are_theirs(first, count, size):
    simulation = BatchSimulation(build_scene(SceneCfg(), foot_samples=2), num_envs=1)
    simulation.qpos[:, 2] += 0.2
    simulation.qvel[:, 3:6] = torch.tensor([1.0, 2.0, 3.0])  # every foot moves as none other does
    past, now = past_readings(simulation, first, count), []
    for _ in range(2):
        simulation.step()
        now.append(simulation.sensordata[:, sensor_slice(simulation.model, first, count)].clone())
    assert torch.equal(past, torch.stack(now).view(2, 1, count, size))
    assert past[1].unique().numel() == count * size


def test_past_readings_of_a_sensor_that_keeps_none_are_refused(model):
    with pytest.raises(ValueError, match="'FR_foot_vel': the sensor keeps no past readings"):
        past_readings(BatchSimulation(model, num_envs=1), "FR_foot_vel", 4)


@pytest.mark.parametrize("another", [lambda marks: marks[::-1], lambda marks: 0.0 * marks])
def test_a_mujoco_that_keeps_past_readings_otherwise_is_refused_and_not_misread(
    another, monkeypatch
):
    write = mujoco.mj_initSensorHistory

    def write_otherwise(model, data, sensor, times, values, phase):
        write(model, data, sensor, times, another(values).copy(), phase)

    monkeypatch.setattr(mujoco, "mj_initSensorHistory", write_otherwise)
    simulation = BatchSimulation(build_scene(SceneCfg(), foot_samples=4), num_envs=1)
    with pytest.raises(ValueError, match=f"MuJoCo {mujoco.__version__} keeps .* another order"):
        RobotSensors(simulation)


def _check_against_mujoco(simulation, sensors):
    data = mujoco.MjData(simulation.model)
    for robot in range(2):
        data.sensordata[:] = simulation.sensordata[robot]
        for i, leg in enumerate(LEGS):
            for quantity in ("foot_pos", "foot_vel", "foot_contact"):
                reading = getattr(sensors, quantity)[robot, i].flatten().tolist()
                assert reading == data.sensor(f"{leg}_{quantity}").data.tolist()
        shapes = [
            float(data.sensor(i).data[0])
            for i in range(simulation.model.nsensor)
            if data.sensor(i).name.endswith("_contact") and "foot" not in data.sensor(i).name
        ]
        assert sensors.shape_contact[robot].tolist() == shapes
        assert sensors.trunk_contact[robot].tolist() == shapes[:2]
