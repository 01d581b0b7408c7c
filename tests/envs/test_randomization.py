"""Tests of the physics that differs between robots."""

from __future__ import annotations

import dataclasses
import math

import pytest
import torch

from mute.envs.batch_simulation import BatchSimulation
from mute.envs.randomization import (
    KNOWN,
    PHYSICS_DIM,
    RandomizationCfg,
    full_randomization,
    randomize_physics,
)
from mute.envs.scene import FloorPatch, SceneCfg, build_scene
from mute.envs.sensors import RobotSensors
from mute.envs.terrain import TerrainCfg, kind_of_robot

MODEL = build_scene(SceneCfg())
TRUNK = MODEL.body("trunk").id
NUM_ENVS = 8
FIELDS = (
    "geom_friction",
    "body_mass",
    "body_inertia",
    "body_ipos",
    "actuator_gainprm",
    "actuator_biasprm",
    "dof_frictionloss",
    "actuator_forcerange",
    "dof_armature",
    "geom_solref",
)
DELAYED = build_scene(SceneCfg(longest_delay=0.02))


def _randomize(seed=0, model=MODEL, **given):
    simulation = BatchSimulation(model, NUM_ENVS, num_threads=1)
    generator = torch.Generator().manual_seed(seed)
    return simulation, randomize_physics(simulation, RandomizationCfg(**given), generator)


def _of_model(name):
    return torch.from_numpy(getattr(MODEL, name).copy()).double()


def _assert_within(values, low, high):
    """Check the bounds, and that there are as many values as draws."""
    assert low <= values.min()
    assert values.max() <= high
    assert values.unique().numel() == values.numel()


def test_every_robot_draws_one_factor_on_the_friction_of_all_there_is():
    simulation, _ = _randomize(friction_factor=(0.3, 0.9))
    factor = simulation.field("geom_friction")[:, :, 0].double() / _of_model("geom_friction")[:, 0]
    torch.testing.assert_close(factor, factor[:, :1].expand_as(factor))
    _assert_within(factor[:, 0], 0.3, 0.9)


def test_floors_side_by_side_keep_what_they_differ_by():
    slippery = FloorPatch((-3.0, -3.0), (3.0, 3.0), 0.2, (0.02, 1.0))
    rough = FloorPatch((3.0, -3.0), (9.0, 3.0), 0.9, (0.02, 1.0))
    model = build_scene(SceneCfg(floor_patches=(slippery, rough)))
    simulation = BatchSimulation(model, NUM_ENVS, num_threads=1)
    cfg = RandomizationCfg(friction_factor=(0.5, 1.5))
    randomize_physics(simulation, cfg, torch.Generator().manual_seed(0))
    patches = [geom for geom in range(model.ngeom) if model.geom_bodyid[geom] == 0][-2:]
    friction = simulation.field("geom_friction")[:, patches, 0].double()
    _assert_within(friction[:, 0], 0.1, 0.3)
    torch.testing.assert_close(friction[:, 1], 4.5 * friction[:, 0])


def test_mass_is_added_to_the_trunk_alone_and_its_inertia_grows_alike():
    simulation, _ = _randomize(added_mass=(-0.5, 1.5))
    added = simulation.field("body_mass").double() - _of_model("body_mass")
    _assert_within(added[:, TRUNK], -0.5, 1.5)
    others = torch.arange(MODEL.nbody) != TRUNK
    assert (added[:, others] == 0.0).all()
    ratio = 1.0 + added[:, TRUNK] / _of_model("body_mass")[TRUNK]
    inertia = simulation.field("body_inertia").double()
    expected = _of_model("body_inertia").repeat(NUM_ENVS, 1, 1)
    expected[:, TRUNK] *= ratio.unsqueeze(1)
    torch.testing.assert_close(inertia, expected)


def test_the_trunks_centre_of_mass_is_offset_along_every_axis():
    simulation, _ = _randomize(com_offset=(-0.02, 0.03))
    offset = simulation.field("body_ipos").double() - _of_model("body_ipos")
    _assert_within(offset[:, TRUNK], -0.02, 0.03)


def test_gains_scale_by_joint_and_stay_those_of_a_position_actuator():
    simulation, _ = _randomize(gain_scale=(0.8, 1.2))
    gain = simulation.field("actuator_gainprm")[:, :, 0].double()
    bias = simulation.field("actuator_biasprm").double()
    _assert_within(gain / _of_model("actuator_gainprm")[:, 0], 0.8, 1.2)
    _assert_within(bias[:, :, 2] / _of_model("actuator_biasprm")[:, 2], 0.8, 1.2)
    # Another stiffness on the position than on the set point would move the joint's rest.
    torch.testing.assert_close(bias[:, :, 1], -gain)


def test_dry_friction_brakes_the_joints_and_not_the_trunk():
    simulation, _ = _randomize(friction_loss=(0.1, 0.5))
    loss = simulation.field("dof_frictionloss")
    _assert_within(loss[:, 6:], 0.1, 0.5)
    assert (loss[:, :6] == 0.0).all()


def test_the_torque_of_all_motors_of_a_robot_scales_by_one_factor():
    simulation, _ = _randomize(motor_strength=(0.5, 1.5), gain_scale=(1.0, 1.0))
    simulation.reset(torch.ones(NUM_ENVS, dtype=torch.bool))
    limits = simulation.field("actuator_forcerange")[:, :, 1].double()
    strength = limits / _of_model("actuator_forcerange")[:, 1]
    torch.testing.assert_close(strength, strength[:, :1].expand_as(strength))
    _assert_within(strength[:, 0], 0.5, 1.5)
    for offset, of_one in ((0.1, 0.1 * _of_model("actuator_gainprm")[:, 0]), (10.0, limits[0])):
        simulation.ctrl[:] = simulation.qpos[:, 7:] + offset
        simulation.forward()
        expected = of_one * strength if offset < 1.0 else limits
        torch.testing.assert_close(simulation.actuator_force, expected.float())


def test_heavier_rotors_turn_more_slowly_and_the_trunk_has_none():
    speeds = []
    for factor in (1.0, 4.0):
        simulation, _ = _randomize(armature=(factor, factor), gain_scale=(1, 1))
        simulation.field("dof_frictionloss")[:] = 0.0
        simulation.reset(torch.ones(NUM_ENVS, dtype=torch.bool))
        simulation.qpos[:, 2] += 1.0  # in the air
        simulation.ctrl[:] = simulation.qpos[:, 7:] + 0.1
        simulation.step()
        speeds.append(simulation.qvel[:, 6:])
    assert (speeds[1] > 0.0).all()
    assert (speeds[1] < 0.85 * speeds[0]).all()
    simulation, _ = _randomize(armature=(0.8, 1.2))
    armature = simulation.field("dof_armature").double()
    _assert_within(armature[:, 6:] / _of_model("dof_armature")[6:], 0.8, 1.2)
    assert (armature[:, :6] == 0.0).all()


def test_the_floors_time_constant_goes_with_the_inverse_root_of_its_stiffness():
    simulation, _ = _randomize(floor_stiffness=(0.25, 1.5))
    solref = simulation.field("geom_solref").double()
    floor = torch.from_numpy(MODEL.geom_bodyid == 0)
    own = _of_model("geom_solref").expand_as(solref)
    assert torch.equal(solref[:, ~floor], own[:, ~floor])
    assert torch.equal(solref[:, floor, 1], own[:, floor, 1])
    _assert_within((own[:, floor, 0] / solref[:, floor, 0]).square()[:, 0], 0.25, 1.5)


def test_no_floor_is_stiffer_than_the_physics_steps_can_show():
    simulation, _ = _randomize(floor_stiffness=(100.0, 100.0))
    solref = simulation.field("geom_solref")[:, MODEL.geom("floor").id].double()
    shortest = torch.full((NUM_ENVS,), 2.0 * MODEL.opt.timestep, dtype=torch.float64)
    torch.testing.assert_close(solref[:, 0], shortest)


def test_robots_sink_deeper_into_a_softer_floor():
    heights = []
    for factor in (0.25, 1.0):
        simulation, _ = _randomize(
            floor_stiffness=(factor, factor),
            added_mass=(0, 0),
            com_offset=(0, 0),
            gain_scale=(1, 1),
        )
        heights.append(_standing(simulation).qpos[:, 2])
    assert (heights[1] - heights[0] > 1e-4).all()


def test_feet_slide_further_on_a_slippery_floor():
    ways = []
    for factor in (0.2, 1.5):
        simulation, _ = _randomize(friction_factor=(factor, factor))
        simulation.reset(torch.ones(NUM_ENVS, dtype=torch.bool))
        simulation.ctrl[:] = simulation.qpos[:, 7:]
        simulation.qvel[:, 0] = 0.5
        simulation.forward()
        sensors = RobotSensors(simulation)
        before = sensors.foot_pos[:, :, 0].clone()
        simulation.step(20)
        ways.append((sensors.foot_pos[:, :, 0] - before).mean(dim=1))
    assert (ways[0] > 2.0 * ways[1]).all()


def test_a_centre_of_mass_further_ahead_loads_the_front_legs():
    loads = []
    for offset in (-0.02, 0.02):
        simulation, _ = _randomize(com_offset=(offset, offset), gain_scale=(1, 1))
        knees = _standing(simulation).actuator_force[:, 2::3]
        loads.append(knees[:, :2].sum(dim=1) / knees.sum(dim=1))
    assert (loads[1] - loads[0] > 0.02).all()


def test_a_joint_stays_where_dry_friction_is_greater_than_the_torque():
    simulation, _ = _randomize(friction_loss=(0.4, 0.5), gain_scale=(1, 1))
    simulation.reset(torch.ones(NUM_ENVS, dtype=torch.bool))
    simulation.qpos[:, 2] += 1.0  # in the air, where legs fall with the trunk
    torque = torch.tensor((0.2, 2.0)).repeat(4)[:NUM_ENVS, None]
    kp = float(MODEL.actuator_gainprm[0, 0])
    simulation.ctrl[:] = simulation.qpos[:, 7:] + torque / kp
    simulation.step(4)
    moved = simulation.qvel[:, 6:].abs()
    assert float(moved[0::2].max()) < 0.05
    assert float(moved[1::2].min()) > 0.5


def test_set_points_come_as_late_as_a_robots_delay_says():
    simulation, _ = _randomize(model=DELAYED, action_delay=(0.0, 0.02), friction_loss=(0, 0))
    delay = simulation.field("actuator_delay").double()
    torch.testing.assert_close(delay, delay[:, :1].expand_as(delay))
    _assert_within(delay[:, 0], 0.0, 0.02)
    simulation.reset(torch.ones(NUM_ENVS, dtype=torch.bool))
    simulation.record("actuator_force")
    simulation.ctrl[:] = simulation.qpos[:, 7:] + 1.0
    simulation.step(8)
    arrived = simulation.substeps["actuator_force"][:, :, 0] > 5.0
    steps = torch.ceil(delay[:, 0] / MODEL.opt.timestep)
    assert arrived.long().argmax(dim=1).tolist() == steps.tolist()


def test_a_reset_robot_has_no_set_points_from_before_on_the_way():
    simulation, _ = _randomize(model=DELAYED, action_delay=(0.02, 0.02), gain_scale=(1, 1))
    everyone = torch.ones(NUM_ENVS, dtype=torch.bool)
    simulation.reset(everyone)
    stand = simulation.qpos[:, 7:].clone()
    simulation.ctrl[:] = stand + 1.0
    simulation.step(8)
    again = torch.arange(NUM_ENVS) % 2 == 0
    simulation.reset(again)
    simulation.ctrl[:] = stand - 1.0
    simulation.record("actuator_force")
    simulation.step(4)
    first = simulation.substeps["actuator_force"][:, 0]
    assert float(first[again].abs().max()) < 1e-6  # at rest in the stance, and asked for it
    assert (first[~again].abs().amax(dim=1) > 1.0).all()


def test_full_randomization_leaves_nothing_that_robots_have_alike():
    cfg = full_randomization()
    ranges = {name: value for name, value in vars(cfg).items() if isinstance(value, tuple)}
    assert all(low < high for low, high in ranges.values()), ranges
    assert ranges["added_mass"] == (-1.0, 3.0)
    assert ranges["action_delay"] == (0.0, 0.02)
    assert ranges["friction_factor"][0] * SceneCfg().floor_friction == pytest.approx(0.3)
    others = {"enabled", "everything_share", "push_interval", "push_velocity"}
    assert set(vars(cfg)) == set(ranges) | others
    simulation, drawn = _randomize(model=DELAYED, **vars(cfg))
    for name in (*FIELDS, "actuator_delay"):
        rows = simulation.field(name).reshape(NUM_ENVS, -1)
        assert len(rows.unique(dim=0)) == NUM_ENVS, name
    assert drawn.encoder_offset.unique().numel() == NUM_ENVS * 12


def _standing(simulation: BatchSimulation) -> BatchSimulation:
    """Return the same simulation with robots that have come to rest in the stance."""
    simulation.reset(torch.ones(NUM_ENVS, dtype=torch.bool))
    simulation.ctrl[:] = simulation.qpos[:, 7:]
    simulation.step(200)
    return simulation


def test_what_the_critic_knows_is_the_draw_scaled_to_one():
    simulation, drawn = _randomize(
        model=DELAYED,
        friction_factor=(0.5, 1.5),
        added_mass=(-1.0, 1.0),
        com_offset=(-0.02, 0.02),
        motor_strength=(0.9, 1.1),
        action_delay=(0.0, 0.02),
    )
    floor = MODEL.geom("floor").id
    factor = simulation.field("geom_friction")[:, floor, 0].double() / 0.8
    added = simulation.field("body_mass")[:, TRUNK].double() - _of_model("body_mass")[TRUNK]
    offset = simulation.field("body_ipos")[:, TRUNK].double() - _of_model("body_ipos")[TRUNK]
    force, delay = (
        simulation.field(name).double().reshape(NUM_ENVS, MODEL.nu, -1)[:, 0, -1]
        for name in ("actuator_forcerange", "actuator_delay")
    )
    strength = force / MODEL.actuator_forcerange[0, 1]
    expected = {
        "friction_factor": 2.0 * (factor - 1.0),
        "added_mass": added,
        "com_offset": offset / 0.02,
        "motor_strength": 10.0 * (strength - 1.0),
        "action_delay": 100.0 * (delay - 0.01),
    }
    assert tuple(expected) == KNOWN
    columns = torch.cat([value.reshape(NUM_ENVS, -1) for value in expected.values()], dim=1)
    assert drawn.known.shape == (NUM_ENVS, PHYSICS_DIM)
    assert drawn.known.dtype == torch.float32
    torch.testing.assert_close(drawn.known, columns.float(), atol=1e-5, rtol=1e-5)


def test_a_heavier_robot_weighs_more():
    simulation, _ = _randomize(
        added_mass=(1.0, 1.0), com_offset=(0, 0), gain_scale=(1, 1), friction_loss=(0, 0)
    )
    plain = BatchSimulation(MODEL, NUM_ENVS, num_threads=1)
    forces = []
    for each in (simulation, plain):
        each.reset(torch.ones(NUM_ENVS, dtype=torch.bool))
        each.ctrl[:] = each.qpos[:, 7:]
        each.step(200)
        # The knees carry the weight.
        forces.append(each.actuator_force[:, 2::3].sum(dim=1))
    ratio = float((MODEL.body_mass.sum() + 1.0) / MODEL.body_mass.sum())
    torch.testing.assert_close(
        forces[0] / forces[1], torch.full((NUM_ENVS,), ratio), atol=0.05, rtol=0.0
    )


def test_an_empty_range_gives_the_value_itself_and_tells_the_critic_nothing():
    simulation, drawn = _randomize(friction_factor=(0.7, 0.7), added_mass=(0, 0), com_offset=(0, 0))
    friction = simulation.field("geom_friction")[:, :, 0].double()
    torch.testing.assert_close(friction[0], 0.7 * _of_model("geom_friction")[:, 0])
    assert (drawn.known == 0.0).all()


def test_switched_off_every_robot_is_the_model_as_it_is():
    simulation, drawn = _randomize(enabled=False)
    assert torch.equal(drawn.known, torch.zeros(NUM_ENVS, PHYSICS_DIM))
    assert torch.equal(drawn.encoder_offset, torch.zeros(NUM_ENVS, 12))
    assert drawn.imu is None
    for name in FIELDS:
        value = simulation.field(name).double()
        assert torch.equal(value, _of_model(name).expand_as(value)), name


def test_the_seed_decides_the_physics():
    every = dataclasses.asdict(full_randomization())
    (first, drawn), (same, again) = (_randomize(1, DELAYED, **every) for _ in range(2))
    _, other = _randomize(2, DELAYED, **every)
    assert all(torch.equal(first.field(name), same.field(name)) for name in FIELDS)
    assert drawn.imu is not None
    assert again.imu is not None
    assert other.imu is not None
    for one, as_well, differs in (
        (drawn.known, again.known, other.known),
        (drawn.encoder_offset, again.encoder_offset, other.encoder_offset),
        (drawn.imu, again.imu, other.imu),
    ):
        assert torch.equal(one, as_well)
        assert (one != differs).all()


def test_what_all_robots_have_as_the_model_has_it_changes_no_other_draw():
    plain, drawn = _randomize()
    wide, other = _randomize(encoder_offset=(-0.02, 0.02), imu_tilt=(-0.03, 0.03))
    assert torch.equal(drawn.known, other.known)
    assert all(torch.equal(plain.field(name), wide.field(name)) for name in FIELDS)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("friction_factor", (1.0, 0.5)),
        ("friction_factor", (-0.1, 0.5)),
        ("added_mass", (1.0, 0.0)),
        ("com_offset", (0.1, -0.1)),
        ("gain_scale", (-1.0, 1.0)),
        ("friction_loss", (-0.1, 0.1)),
        ("motor_strength", (0.0, 1.0)),
        ("armature", (1.2, 0.8)),
        ("floor_stiffness", (0.0, 1.0)),
        ("action_delay", (-0.01, 0.0)),
        ("encoder_offset", (0.1, -0.1)),
        ("imu_tilt", (math.nan, 0.0)),
        ("friction_factor", (0.5, math.inf)),
        ("com_offset", (math.nan, 0.0)),
        ("added_mass", (-math.inf, 0.0)),
        ("added_mass", (-5.204, 0.0)),
        ("push_interval", -1.0),
        ("push_interval", math.nan),
        ("push_velocity", -0.1),
        ("push_velocity", math.nan),
        ("push_velocity", math.inf),
    ],
)
def test_a_bad_field_is_refused_by_name(field, value):
    with pytest.raises(ValueError, match=f"randomization.{field}"):
        RandomizationCfg(**{field: value})


def test_the_trunk_may_lose_all_but_a_little_of_its_mass():
    # The bound above is the mass of the model.
    assert MODEL.body_mass[TRUNK] == pytest.approx(5.204)
    simulation, _ = _randomize(added_mass=(-5.2, -5.2))
    mass = simulation.field("body_mass")[:, TRUNK].double()
    torch.testing.assert_close(mass, torch.full_like(mass, 0.004), atol=1e-6, rtol=0.0)


def test_a_share_of_the_robots_differs_in_everything_and_the_others_as_usual():
    count = 200
    simulation = BatchSimulation(DELAYED, count, num_threads=1)
    cfg = RandomizationCfg(everything_share=0.25, added_mass=(0.1, 0.2), friction_loss=(0.0, 0.0))
    drawn = randomize_physics(simulation, cfg, torch.Generator().manual_seed(0))
    delay = simulation.field("actuator_delay")[:, 0].double()
    differs = delay > 0.0
    assert int(differs.sum()) == count // 4
    added = simulation.field("body_mass")[:, TRUNK].double() - MODEL.body_mass[TRUNK]
    assert added[~differs].min() >= 0.1 and added[~differs].max() <= 0.2
    assert added[differs].min() < -0.5 and added[differs].max() > 2.5
    for values in (
        drawn.encoder_offset.abs().sum(dim=1),
        simulation.field("dof_frictionloss")[:, 6:].sum(dim=1),
        (simulation.field("dof_armature").double() - _of_model("dof_armature"))[:, 6:].abs().sum(1),
    ):
        assert torch.equal(values.cpu() > 0.0, differs)
    # What the critic knows is told on one scale: a delay of nothing is -1.
    known = drawn.known[:, KNOWN.index("action_delay") + 2].double()
    torch.testing.assert_close(known, delay / 0.01 - 1.0)


def test_robots_that_differ_in_everything_are_on_every_kind_of_ground():
    cfg = RandomizationCfg(everything_share=0.5)
    simulation = BatchSimulation(DELAYED, 1024, num_threads=1)
    randomize_physics(simulation, cfg, torch.Generator().manual_seed(0))
    differs = simulation.field("actuator_delay")[:, 0] > 0.0
    kinds = kind_of_robot(TerrainCfg(kind="indoor"), 1024)
    for name in set(kinds):
        of_kind = torch.tensor([kind == name for kind in kinds])
        assert float(differs[of_kind].double().mean()) == pytest.approx(0.5, abs=0.1)
