"""Tests of what is recorded to be heard: landings, sliding, effective masses."""

from __future__ import annotations

import dataclasses
import math

import mujoco
import numpy as np
import pytest
import torch

from mute.acoustics.contacts import ContactBlock
from mute.acoustics.recorder import Recorder, effective_mass
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.randomization import RandomizationCfg
from mute.envs.scene import Cone, FloorPatch, SceneCfg


def _make_env(cone: Cone = "elliptic", **scene) -> QuadrupedEnv:
    return QuadrupedEnv(
        QuadrupedEnvCfg(
            num_envs=2,
            num_threads=1,
            decimation=20,
            initial_joint_noise=0.0,
            initial_velocity=0.0,
            random_heading=False,
            scene=SceneCfg(timestep=0.001, foot_forces=True, cone=cone, **scene),
            randomization=RandomizationCfg(enabled=False),
        )
    )


def _walk(env: QuadrupedEnv, steps: int) -> None:
    for _ in range(steps):
        env.step(torch.zeros(env.num_envs, 12))


@pytest.mark.parametrize("height", [0.05, 0.2])
def test_a_dropped_robots_front_feet_land_at_the_speed_of_free_fall(height):
    env = _make_env()
    recorder = Recorder(env)
    _walk(env, 1)  # leaves the ground: the contact before it is no landing
    env.simulation.qpos[0, 2] += height
    env.simulation.qvel[:] = 0.0
    below = float(env.simulation.qpos[0, 2])
    _walk(env, math.ceil(math.sqrt(2.0 * height / 9.81) / 0.02) + 1)
    impacts = recorder.take().impacts
    impacts = impacts.select(impacts.robot == 0)
    # The front feet are the lower ones by a hair, and the blow turns the hind ones down.
    first = [int(np.flatnonzero(impacts.foot == foot)[0]) for foot in range(2)]
    assert below > height
    speeds = impacts.speed[first]
    assert speeds == pytest.approx(math.sqrt(2.0 * 9.81 * height), rel=0.02)
    fall = math.sqrt(2.0 * height / 9.81)
    assert impacts.time[first] == pytest.approx(0.02 + fall, abs=0.003)
    assert impacts.position[first, 2] == pytest.approx(0.0, abs=0.003)


def test_a_landing_has_the_effective_mass_of_the_pose_in_which_the_foot_lands():
    env = _make_env()
    recorder = Recorder(env)
    poses = []
    env.physics_listeners.append(
        lambda: poses.extend(env.simulation.substeps["qpos"].transpose(0, 1).numpy().copy())
    )
    env.simulation.qpos[:, 2] += 0.1
    _walk(env, 9)
    impacts = recorder.take().impacts
    # The step that finds contact began with the positions that the step before ended with.
    before = np.rint(impacts.time / 0.001).astype(int) - 1
    landing = np.array(poses)[before, impacts.robot]
    expected = effective_mass(env.model, mujoco.MjData(env.model), landing, impacts.foot)
    assert impacts.mass == pytest.approx(expected, rel=1e-6)
    assert len(impacts) >= 8
    assert (impacts.mass > 0.2).all()
    assert (impacts.mass < 1.0).all()


def test_the_drop_of_a_robot_that_begins_anew_is_no_impact_and_its_later_landings_are():
    env = _make_env()
    recorder = Recorder(env)
    _walk(env, 10)
    recorder.take()
    env.simulation.qpos[:, 2] += 0.1
    env.simulation.qvel[:] = 0.0
    recorder.restart(np.array([True, False]))
    _walk(env, 40)
    impacts = recorder.take().impacts
    assert set(impacts.robot.tolist()) == {1}
    assert impacts.speed.max() > 1.0
    env.simulation.qpos[:, 2] += 0.1
    _walk(env, 15)
    assert set(recorder.take().impacts.robot.tolist()) == {0, 1}


def test_a_simulation_that_blew_up_is_recorded_at_rest():
    env = _make_env()
    recorder = Recorder(env)
    _walk(env, 10)
    recorder.take()
    env.simulation.qvel[0, 6] = math.nan
    _walk(env, 1)
    assert env.unstable.tolist() == [True, False]
    recorder.restart(env.unstable.numpy(), env.unstable.numpy())
    _walk(env, 3)
    block = recorder.take()
    for name in (
        "friction_power",
        "joint_pos",
        "joint_vel",
        "joint_torque",
        "foot_pos",
        "trunk_pos",
    ):
        assert np.isfinite(getattr(block, name)).all()
    assert not block.joint_vel[:20, 0].any()
    assert block.joint_vel[:20, 1].any()
    assert len(block.part(0, 20).impacts) == 0


def test_a_standing_robot_makes_no_impact_and_does_not_slide():
    env = _make_env()
    recorder = Recorder(env)
    _walk(env, 60)
    recorder.take()
    _walk(env, 5)
    block = recorder.take()
    assert len(block.impacts) == 0
    assert block.friction_power.max() == 0.0


def test_a_robot_that_is_pushed_along_the_floor_loses_its_energy_to_friction():
    env = _make_env(floor_friction=0.2)
    recorder = Recorder(env)
    _walk(env, 60)
    recorder.take()
    env.simulation.qvel[0, 1] = 0.5
    _walk(env, 25)
    power = recorder.take().friction_power
    energy = power.sum(axis=(0, 2)) * 0.001
    kinetic = 0.5 * float(env.model.body_mass.sum()) * 0.5**2
    # The legs take up some of it, and store a part that slides back.
    assert 0.4 * kinetic < energy[0] < 1.2 * kinetic
    assert energy[1] < 0.01


def test_blocks_tile_the_recording_whatever_their_length():
    whole, parts = (Recorder(_make_env()) for _ in range(2))
    taken = []
    for recorder, chunks in ((whole, [9]), (parts, [1, 3, 5])):
        env = recorder._env
        env.simulation.qpos[:, 2] += 0.1
        for chunk in chunks:
            _walk(env, chunk)
            taken.append(recorder.take())
    one, *many = taken
    for name in ("friction_power", "foot_pos", "floor", "joint_torque", "trunk_quat"):
        joined = np.concatenate([getattr(block, name) for block in many])
        np.testing.assert_allclose(getattr(one, name), joined, rtol=1e-6, atol=1e-9)
    for name in ("time", "robot", "foot", "speed", "mass", "position"):
        joined = np.concatenate([getattr(block.impacts, name) for block in many])
        np.testing.assert_allclose(getattr(one.impacts, name), joined, atol=1e-9)
    assert [block.start for block in many] == pytest.approx([0.0, 0.02, 0.08])
    assert many[-1].end == pytest.approx(one.end) == pytest.approx(0.18)
    assert len(one.impacts) >= 4


def _assert_same_block(one: ContactBlock, other: ContactBlock) -> None:
    for name in (
        "friction_power",
        "foot_pos",
        "joint_pos",
        "joint_vel",
        "joint_torque",
        "trunk_pos",
    ):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    for name in ("time", "robot", "foot", "speed", "mass", "position"):
        np.testing.assert_array_equal(getattr(one.impacts, name), getattr(other.impacts, name))


def test_several_recorders_of_an_environment_hear_each_what_one_alone_would():
    env, twin = _make_env(), _make_env()
    first, second, alone = Recorder(env), Recorder(env), Recorder(twin)
    for each in (env, twin):
        each.simulation.qpos[:, 2] += 0.1
        _walk(each, 9)
    block = alone.take()
    assert len(block.impacts) >= 8
    for recorder in (first, second):
        _assert_same_block(recorder.take(), block)
    second.close()
    second.close()  # once more is no mistake, and ends no other
    for each in (env, twin):
        _walk(each, 2)
    _assert_same_block(first.take(), alone.take())
    with pytest.raises(ValueError, match="no physics step"):
        second.take()


def test_one_robot_alone_is_recorded_as_among_the_others():
    blocks = []
    for robots in (None, slice(1, 2)):
        env = _make_env()
        recorder = Recorder(env, robots=robots)
        env.simulation.qpos[:, 2] += torch.tensor((0.1, 0.05))
        _walk(env, 8)
        blocks.append(recorder.take())
    everyone, alone = blocks
    assert alone.num_robots == 1
    for name in (
        "friction_power",
        "foot_pos",
        "joint_pos",
        "joint_vel",
        "joint_torque",
        "trunk_pos",
    ):
        theirs = getattr(everyone, name)[:, 1]
        np.testing.assert_allclose(getattr(alone, name)[:, 0], theirs, rtol=1e-6, atol=1e-9)
    own = everyone.impacts.select(everyone.impacts.robot == 1)
    assert len(own) >= 4
    assert (alone.impacts.robot == 0).all()
    for name in ("time", "foot", "speed", "mass", "position"):
        theirs = getattr(own, name)
        np.testing.assert_allclose(getattr(alone.impacts, name), theirs, rtol=1e-6, atol=1e-9)


def test_each_impact_and_foot_has_the_floor_it_stands_on():
    patches = (
        FloorPatch((-3.0, -3.0), (0.0, 3.0), 0.8, (0.02, 1.0)),
        FloorPatch((0.0, -3.0), (3.0, 3.0), 0.8, (0.02, 1.0)),
    )
    env = _make_env(floor_patches=patches)
    recorder = Recorder(env, lambda xy: (xy[..., 0] > 0.0).astype(np.int8))
    env.simulation.qpos[:, 2] += 0.05
    _walk(env, 8)
    block = recorder.take()
    # Front feet stand before the trunk's centre, hind feet behind it.
    assert (block.floor[..., :2] == 1).all()
    assert (block.floor[..., 2:] == 0).all()
    assert set(zip(block.impacts.foot.tolist(), block.impacts.floor.tolist(), strict=True)) == {
        (0, 1), (1, 1), (2, 0), (3, 0)
    }  # fmt: skip


def test_a_block_of_nothing_and_an_environment_without_forces_are_refused():
    env = _make_env()
    with pytest.raises(ValueError, match="no physics step"):
        Recorder(env).take()
    cfg = dataclasses.replace(env.cfg, scene=SceneCfg(timestep=0.001))
    with pytest.raises(ValueError, match="foot_forces"):
        Recorder(QuadrupedEnv(cfg))


def test_with_pyramidal_cones_no_foot_is_known_to_slide():
    env = _make_env(floor_friction=0.2, cone="pyramidal")
    recorder = Recorder(env)
    _walk(env, 60)
    env.simulation.qvel[0, 1] = 0.5
    _walk(env, 25)
    assert recorder.take().friction_power.max() == 0.0


def test_recording_changes_nothing_of_what_is_saved():
    env = _make_env()
    before = set(env.state_dict()["simulation"])
    Recorder(env)
    assert set(env.state_dict()["simulation"]) == before


def test_each_robot_slides_where_its_own_friction_on_its_floor_is_used_up():
    slippery = FloorPatch((-3.0, -3.0), (3.0, 3.0), 0.1, (0.02, 1.0))
    rough = FloorPatch((3.0, -3.0), (9.0, 3.0), 0.8, (0.02, 1.0))
    env = _make_env(floor_patches=(rough, slippery))
    env.simulation.field("geom_friction")[1, :, 0] *= 8.0
    recorder = Recorder(env, lambda xy: (xy[..., 0] > 3.0).astype(np.int8))
    _walk(env, 60)
    recorder.take()
    env.simulation.qvel[:, 1] = 0.2
    _walk(env, 10)
    power = recorder.take().friction_power.sum(axis=(0, 2)) * 0.001
    # At 0.2 m/s the legs give way by less than the rough floor holds: one robot's feet creep.
    assert power[0] > 0.02
    assert power[1] == 0.0
    env.simulation.qpos[0, 0] += 6.0
    _walk(env, 30)
    recorder.take()
    env.simulation.qvel[:, 1] = 0.2
    _walk(env, 10)
    assert recorder.take().friction_power[:, 0].max() == 0.0


_BODY = """
<mujoco>
  <worldbody>
    <body pos="0 0 1">
      {joint}
      <inertial pos="0 0 0" mass="0.7" diaginertia="0.01 0.02 0.03"/>
      <site name="FR_foot" pos="{at} 0 0"/>
      <site name="FL_foot"/><site name="RR_foot"/><site name="RL_foot"/>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.mark.parametrize(
    ("joint", "at", "expected"),
    [
        ("<freejoint/>", 0.0, 0.7),
        # A free body struck off its centre turns away: 1/m + r^2/I.
        ("<freejoint/>", 0.1, 1.0 / (1.0 / 0.7 + 0.1**2 / 0.02)),
        # On a hinge: I / r^2, the rotor's inertia included.
        ("<joint type='hinge' axis='0 1 0' armature='0.005'/>", 0.2, 0.025 / 0.2**2),
    ],
)
def test_the_effective_mass_is_that_of_the_closed_form(joint, at, expected):
    model = mujoco.MjModel.from_xml_string(_BODY.format(joint=joint, at=at))
    data = mujoco.MjData(model)
    mass = effective_mass(model, data, data.qpos[None].copy(), np.array([0]))
    assert mass == pytest.approx([expected], rel=1e-9)


def test_a_standing_go1_meets_the_floor_with_less_than_its_weight_and_more_than_its_shank():
    env = _make_env()
    poses = env.simulation.qpos.numpy().astype(float)[[0, 0, 0, 0]]
    mass = effective_mass(env.model, mujoco.MjData(env.model), poses, np.arange(4))
    assert (mass > 0.35).all()
    assert (mass < 0.75).all()
    assert mass[0] == pytest.approx(mass[1], rel=0.02)
