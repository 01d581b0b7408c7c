"""Tests of the physics that differs between robots."""

from __future__ import annotations

import math

import pytest
import torch

from mute.envs.batch_simulation import BatchSimulation
from mute.envs.randomization import PHYSICS_DIM, RandomizationCfg, randomize_physics
from mute.envs.scene import FloorPatch, SceneCfg, build_scene

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
)


def _randomize(seed=0, **given):
    simulation = BatchSimulation(MODEL, NUM_ENVS, num_threads=1)
    generator = torch.Generator().manual_seed(seed)
    known = randomize_physics(simulation, RandomizationCfg(**given), generator)
    return simulation, known


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


def test_what_the_critic_knows_is_the_draw_scaled_to_one():
    simulation, known = _randomize(
        friction_factor=(0.5, 1.5), added_mass=(-1.0, 1.0), com_offset=(-0.02, 0.02)
    )
    floor = MODEL.geom("floor").id
    factor = simulation.field("geom_friction")[:, floor, 0].double() / 0.8
    added = simulation.field("body_mass")[:, TRUNK].double() - _of_model("body_mass")[TRUNK]
    offset = simulation.field("body_ipos")[:, TRUNK].double() - _of_model("body_ipos")[TRUNK]
    expected = torch.cat(
        ((2.0 * (factor - 1.0)).unsqueeze(1), added.unsqueeze(1), offset / 0.02), dim=1
    )
    assert known.shape == (NUM_ENVS, PHYSICS_DIM)
    assert known.dtype == torch.float32
    torch.testing.assert_close(known, expected.float(), atol=1e-5, rtol=1e-5)


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
    simulation, known = _randomize(friction_factor=(0.7, 0.7), added_mass=(0, 0), com_offset=(0, 0))
    friction = simulation.field("geom_friction")[:, :, 0].double()
    torch.testing.assert_close(friction[0], 0.7 * _of_model("geom_friction")[:, 0])
    assert (known == 0.0).all()


def test_switched_off_every_robot_is_the_model_as_it_is():
    simulation, known = _randomize(enabled=False)
    assert torch.equal(known, torch.zeros(NUM_ENVS, PHYSICS_DIM))
    for name in FIELDS:
        value = simulation.field(name).double()
        assert torch.equal(value, _of_model(name).expand_as(value)), name


def test_the_seed_decides_the_physics():
    first, known = _randomize(seed=1)
    same, same_known = _randomize(seed=1)
    _, other_known = _randomize(seed=2)
    assert torch.equal(known, same_known)
    assert all(torch.equal(first.field(name), same.field(name)) for name in FIELDS)
    assert (known != other_known).all()


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("friction_factor", (1.0, 0.5)),
        ("friction_factor", (-0.1, 0.5)),
        ("added_mass", (1.0, 0.0)),
        ("com_offset", (0.1, -0.1)),
        ("gain_scale", (-1.0, 1.0)),
        ("friction_loss", (-0.1, 0.1)),
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
