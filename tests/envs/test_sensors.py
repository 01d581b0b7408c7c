"""Tests of finding what sensors read."""

from __future__ import annotations

import math

import mujoco
import pytest
import torch

from mute.envs.batch_simulation import BatchSimulation
from mute.envs.footfall import FootfallCfg, Footfalls
from mute.envs.scene import LEGS, SceneCfg, build_scene, make_spec
from mute.envs.sensors import RobotSensors, sensor_slice


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


def test_the_robots_sensors_follow_the_engine_and_every_physics_step_of_it():
    num_steps = 4
    several, single = (BatchSimulation(build_scene(SceneCfg()), num_envs=2) for _ in range(2))
    tilt = 0.05
    for simulation in (several, single):
        simulation.reset(torch.ones(2, dtype=torch.bool))
        simulation.qpos[:, 2] += torch.tensor([0.0, 0.1])  # one stands, the other drops
        # onto its right feet
        simulation.qpos[1, 3:5] = torch.tensor([math.cos(tilt), math.sin(tilt)])
        simulation.forward()
    sensors, now = RobotSensors(several), RobotSensors(single)
    in_part = False
    for _ in range(20):
        seen = []
        for _ in range(num_steps):
            single.step()
            seen.append((now.foot_vel[..., 2].clone(), now.foot_contact.clone()))
        several.step(num_steps)
        foot_vel_z, foot_contact = (torch.stack(part) for part in zip(*seen, strict=True))
        assert torch.equal(sensors.foot_vel_z_substeps.float(), foot_vel_z)
        assert torch.equal(sensors.foot_contact_substeps.float(), foot_contact)
        in_part |= 0 < int(foot_contact[:, 1].sum()) < foot_contact[:, 1].numel()
        _check_against_mujoco(several, sensors)
    assert in_part  # feet, robots and times differ in their contacts


def test_a_robot_that_stands_loads_its_feet_with_its_weight_and_one_that_lands_with_more():
    simulation = BatchSimulation(build_scene(SceneCfg(foot_forces=True)), num_envs=2)
    simulation.reset(torch.ones(2, dtype=torch.bool))
    simulation.qpos[1, 2] += 0.1
    simulation.ctrl[:] = simulation.qpos[:, 7:]
    simulation.forward()
    sensors = RobotSensors(simulation)
    load, most = torch.zeros(2), torch.zeros(2)
    for _ in range(100):
        simulation.step(4)
        assert sensors.foot_load is not None
        load = sensors.foot_load.sum(dim=1)
        most = torch.maximum(most, load)
    assert load == pytest.approx([1.0, 1.0], abs=0.02)
    assert most[1] > 1.3 * most[0]


def test_the_last_velocity_before_a_control_step_comes_first():
    feet = Footfalls(FootfallCfg(), 1, timestep=0.005, decimation=2)
    contacts = torch.zeros(2, 1, 4)
    first, second = torch.randn(2, 2, 1, 4)
    feet.record(first, contacts)
    assert torch.equal(feet.vel_z, torch.cat((torch.zeros(1, 1, 4), first)))
    feet.record(second, contacts)
    assert torch.equal(feet.vel_z, torch.cat((first[-1:], second)))
    other = Footfalls(FootfallCfg(), 1, timestep=0.005, decimation=2)
    other.load_state_dict(feet.state_dict())
    assert torch.equal(other.vel_z, feet.vel_z)
    feet.reset(torch.tensor([True]), torch.zeros(1, 4))
    assert not bool(feet.vel_z.any())


def test_without_force_sensors_there_is_no_load(model):
    assert RobotSensors(BatchSimulation(model, num_envs=1)).foot_load is None


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
