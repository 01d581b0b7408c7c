"""Tests of the protocol of `mute.envs.simulation`, which every engine is held to."""

from __future__ import annotations

import functools
import math

import pytest
import torch
from mujoco.batch import SimulationError

from mute.envs.batch_simulation import BatchSimulation
from mute.envs.engines import make_simulation
from mute.envs.scene import SceneCfg, build_scene, make_spec
from mute.envs.sensors import sensor_slice
from mute.envs.simulation import Engine

MODEL = build_scene(SceneCfg())
_ARENA = 38_000
"""Memory of a simulation, bytes."""

LIVE = ("qpos", "qvel", "ctrl", "sensordata", "actuator_force")


def _make_standing(num_envs=2, engine: Engine = "mujoco"):
    """Make robots that hold the standing pose."""
    simulation = make_simulation(MODEL, num_envs, num_threads=1, engine=engine)
    simulation.reset(torch.ones(num_envs, dtype=torch.bool))
    simulation.forward()
    simulation.ctrl[:] = simulation.qpos[:, 7:]
    return simulation


@pytest.fixture(params=["mujoco", "warp"])
def make_standing(request):
    return functools.partial(_make_standing, engine=request.param)


def _tensors(simulation, index):
    return {name: getattr(simulation, name)[index].clone() for name in LIVE}


def _assert_same(left, right):
    for name in LIVE:
        assert torch.equal(left[name], right[name]), name


def test_tensors_have_the_shapes_of_the_model(make_standing):
    simulation = make_standing(3)
    shapes = {name: getattr(simulation, name).shape for name in LIVE}
    widths = (MODEL.nq, MODEL.nv, MODEL.nu, MODEL.nsensordata, MODEL.nu)
    assert shapes == dict(zip(LIVE, [(3, width) for width in widths], strict=True))


@pytest.mark.parametrize("name", ["qpos", "qvel", "sensordata", "actuator_force"])
def test_a_tensor_that_was_kept_shows_the_next_step(make_standing, name):
    simulation = make_standing()
    simulation.step()
    kept = getattr(simulation, name)
    before = kept.clone()
    simulation.ctrl += 0.2
    simulation.step(2)
    assert not torch.equal(kept, before)
    assert kept is getattr(simulation, name)


def test_a_written_position_moves_the_sensors_of_its_robot_alone(make_standing):
    simulation = make_standing()
    height = sensor_slice(MODEL, "FR_foot_pos", 1).stop - 1
    before = simulation.sensordata[:, height].clone()
    simulation.qpos[1, 2] += 0.5
    simulation.forward()
    assert simulation.sensordata[0, height] == before[0]
    assert simulation.sensordata[1, height].item() == pytest.approx(before[1].item() + 0.5)


def test_a_written_velocity_is_integrated(make_standing):
    simulation = make_standing()
    simulation.qpos[:, 2] += 1.0
    simulation.qvel[1, 0] = 1.0
    simulation.step(10)
    assert simulation.qpos[0, 0].item() == pytest.approx(0.0, abs=2e-3)
    assert simulation.qpos[1, 0].item() == pytest.approx(10 * 0.005, abs=2e-3)


def test_a_written_set_point_pulls_its_joint(make_standing):
    simulation = make_standing()
    simulation.qpos[:, 2] += 1.0
    simulation.ctrl[1, 1] += 0.3
    simulation.step()
    assert simulation.actuator_force[0, 1].item() == pytest.approx(0.0, abs=1e-4)
    assert simulation.actuator_force[1, 1].item() == pytest.approx(20.0 * 0.3, rel=1e-3)


def test_forward_of_a_mask_leaves_the_others_readings_as_they_are(make_standing):
    simulation = make_standing()
    before = simulation.sensordata.clone()
    simulation.qpos[:, 2] += 0.5
    simulation.forward(torch.tensor([True, False]))
    assert not torch.equal(simulation.sensordata[0], before[0])
    assert torch.equal(simulation.sensordata[1], before[1])


def test_each_robot_slides_on_its_own_friction(make_standing):
    simulation = make_standing()
    simulation.field("geom_friction")[0, :, 0] = 0.05
    simulation.field("geom_friction")[1, :, 0] = 1.0
    simulation.qvel[:, 1] = 0.5
    simulation.step(20)
    slippery, rough = simulation.qpos[:, 1].tolist()
    # 0.1 s at 0.5 m/s; friction of 0.05 g takes 2.5 mm at most.
    assert 0.0475 <= slippery <= 0.05
    assert 0.05 - rough > 5.0 * (0.05 - slippery)


def test_each_robot_has_its_own_gains(make_standing):
    simulation = make_standing()
    simulation.field("actuator_gainprm")[0] = 0.0
    simulation.field("actuator_biasprm")[0] = 0.0
    simulation.ctrl += 0.1
    simulation.step()
    assert (simulation.actuator_force[0] == 0.0).all()
    assert (simulation.actuator_force[1] > 1.0).all()


def test_a_field_begins_as_the_model_has_it(make_standing):
    mass = make_standing().field("body_mass")
    expected = torch.from_numpy(MODEL.body_mass).to(mass.dtype).expand_as(mass)
    assert torch.equal(mass, expected)


def test_a_reset_puts_the_masked_robots_to_the_keyframe_and_touches_no_other(make_standing):
    simulation, twin = make_standing(), make_standing()
    for each in (simulation, twin):
        each.ctrl += 0.3
        each.step(7)
    keyframe = torch.from_numpy(MODEL.key_qpos[0]).float()
    simulation.reset(torch.tensor([True, False]))
    simulation.forward(torch.tensor([True, False]))
    assert torch.equal(simulation.qpos[0], keyframe)
    assert (simulation.qvel[0] == 0.0).all()
    _assert_same(_tensors(simulation, 1), _tensors(twin, 1))
    for each in (simulation, twin):
        each.step(7)
    _assert_same(_tensors(simulation, 1), _tensors(twin, 1))


def test_readings_are_current_after_a_reset_and_a_forward_pass(make_standing):
    simulation = make_standing()
    expected = simulation.sensordata.clone()
    simulation.ctrl += 0.3
    simulation.step(7)
    simulation.reset(torch.tensor([True, True]))
    simulation.forward()
    assert torch.equal(simulation.sensordata, expected)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("qvel", 1e6),
        ("qvel", 300.0),
        ("qvel", math.nan),
        ("qvel", math.inf),
        ("qpos", math.nan),
        ("qpos", 1e12),
    ],
)
def test_a_simulation_that_blows_up_is_found_and_no_other_is_touched(
    make_standing, name, value, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its log of warnings into the working directory
    simulation, twin = make_standing(3), make_standing(3)
    getattr(simulation, name)[1, 1] = value
    simulation.step()
    twin.step()
    assert simulation.unstable().tolist() == [False, True, False]
    simulation.reset(simulation.unstable())
    assert not simulation.unstable().any()
    simulation.ctrl[1] = twin.ctrl[1]
    for each in (simulation, twin):
        each.step(5)
    for index in (0, 2):
        _assert_same(_tensors(simulation, index), _tensors(twin, index))
    assert not simulation.unstable().any()
    assert all(value.isfinite().all() for value in _tensors(simulation, 1).values())


def test_a_simulation_stays_unstable_until_it_is_reset(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    simulation = _make_standing()
    simulation.qpos[0, 0] = math.nan
    simulation.step()
    # MuJoCo has put it to its initial state by now and goes on as if nothing had been.
    simulation.step(3)
    assert simulation.qpos.isfinite().all()
    assert simulation.unstable().tolist() == [True, False]


def _make_in_a_small_arena():
    """Make two robots that stand, in memory that holds the contacts of their feet and few more."""
    spec = make_spec(SceneCfg(), pictured=False)
    spec.memory = _ARENA
    simulation = BatchSimulation(spec.compile(), 2, num_threads=1)
    simulation.reset(torch.ones(2, dtype=torch.bool))
    simulation.ctrl[:] = simulation.qpos[:, 7:]
    simulation.step()
    assert not simulation.unstable().any()
    return simulation


def test_lost_contacts_make_a_simulation_unstable(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    simulation = _make_in_a_small_arena()
    simulation.qpos[1, 2] = 0.0
    simulation.step()
    assert simulation.unstable().tolist() == [False, True]


def test_an_engine_error_is_an_unstable_simulation_and_stops_nothing():
    simulation, twin = (_make_in_a_small_arena() for _ in range(2))
    simulation.qpos[0, 2] = 0.1  # belly and legs in the ground: 16 contacts
    simulation.step()
    with pytest.raises(SimulationError, match="ncon = 16"):
        simulation._batch.step(ids=[0])
    twin.step()
    assert simulation.unstable().tolist() == [True, False]
    _assert_same(_tensors(simulation, 1), _tensors(twin, 1))
    simulation.reset(torch.tensor([True, False]))
    assert not simulation.unstable().any()


def test_a_simulation_with_an_engine_error_records_where_it_was_before_the_call():
    simulation = _make_in_a_small_arena()
    simulation.record("qpos", "qvel")
    simulation.step(8)
    simulation.qpos[0, 2], simulation.qvel[0, 2] = 0.2, -6.0  # it fails on the way down
    before = simulation.qpos[0].double()
    simulation.step(8)
    assert simulation.unstable().tolist() == [True, False]
    for row in simulation.substeps["qpos"][0]:
        torch.testing.assert_close(row, before, rtol=0.0, atol=1e-6)
    falling = simulation.substeps["qvel"][:, :, 2]
    assert (falling[0] == -6.0).all()
    assert torch.equal(simulation.substeps["qpos"][1, -1].float(), simulation.qpos[1])


def test_an_engine_error_of_a_forward_pass_leaves_what_the_last_step_recorded():
    simulation = _make_in_a_small_arena()
    simulation.record("qpos", "qvel")
    simulation.ctrl += 0.2
    simulation.step(4)
    before = {name: rows.clone() for name, rows in simulation.substeps.items()}
    assert not torch.equal(before["qpos"][0, 0], before["qpos"][0, -1])
    simulation.qpos[0, 2] = 0.1  # belly and legs in the ground: 16 contacts
    simulation.forward()
    assert simulation.unstable().tolist() == [True, False]
    for name, rows in before.items():
        assert torch.equal(simulation.substeps[name], rows), name


def test_a_loaded_state_continues_bit_for_bit(make_standing):
    simulation = make_standing()
    simulation.field("geom_friction")[1, :, 0] = 0.3
    simulation.field("body_mass")[0, 1] += 1.0
    simulation.set_const()
    simulation.ctrl += 0.2
    simulation.step(9)
    state = simulation.state_dict()
    simulation.step(9)
    twin = make_standing()
    twin.load_state_dict(state)
    twin.step(9)
    for index in range(2):
        _assert_same(_tensors(twin, index), _tensors(simulation, index))


def test_a_state_that_is_loaded_over_a_simulation_that_blew_up_is_stable_again(
    make_standing, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    simulation, twin = make_standing(), make_standing()
    simulation.ctrl += 0.2
    simulation.step(3)
    state = simulation.state_dict()
    simulation.qpos[0, 1], simulation.qvel[1, 2] = math.nan, 1e9
    simulation.step(2)
    assert simulation.unstable().all()
    for each in (simulation, twin):
        each.load_state_dict(state)
    assert not simulation.unstable().any()
    for each in (simulation, twin):
        each.step(4)
    assert not simulation.unstable().any()
    for index in range(2):
        _assert_same(_tensors(simulation, index), _tensors(twin, index))


def test_what_was_written_since_the_last_call_is_part_of_a_saved_state():
    simulation, twin = _make_standing(), _make_standing()
    simulation.step(3)
    simulation.ctrl += 0.3
    simulation.qvel[0, 0] += 0.5
    twin.load_state_dict(simulation.state_dict())
    for each in (simulation, twin):
        each.step(2)
    for index in range(2):
        _assert_same(_tensors(twin, index), _tensors(simulation, index))


def test_a_state_of_another_mujoco_is_refused(make_standing):
    simulation = make_standing()
    state = simulation.state_dict()
    state["mujoco"] = torch.tensor([4, 7, 1])
    with pytest.raises(ValueError, match=r"MuJoCo 4\.7\.1, this is"):
        simulation.load_state_dict(state)


def test_a_state_that_tells_no_version_of_mujoco_is_refused_as_an_earlier_ones(make_standing):
    simulation = make_standing()
    state = {name: value for name, value in simulation.state_dict().items() if name != "mujoco"}
    with pytest.raises(ValueError, match="earlier version") as error:
        simulation.load_state_dict(state)
    assert "\n" not in str(error.value)


def test_a_state_of_another_patch_of_this_mujoco_is_loaded(make_standing):
    simulation = make_standing()
    state = simulation.state_dict()
    state["mujoco"][2] += 1
    simulation.qpos[:, 2] += 0.5
    simulation.load_state_dict(state)
    assert torch.equal(simulation.qpos, state["qpos"])


def test_a_saved_state_does_not_change_afterwards(make_standing):
    simulation = make_standing()
    simulation.field("body_mass")
    state = simulation.state_dict()
    kept = {name: value.clone() for name, value in state.items()}
    simulation.field("body_mass")[:] *= 2.0
    simulation.step(3)
    assert all(torch.equal(state[name], value) for name, value in kept.items())


def test_a_state_of_another_number_of_robots_is_refused(make_standing):
    with pytest.raises(ValueError, match="num_envs"):
        make_standing(3).load_state_dict(make_standing(2).state_dict())


@pytest.mark.parametrize("num_steps", [1, 4])
def test_one_call_records_what_each_of_its_steps_left(make_standing, num_steps):
    single, several = make_standing(), make_standing()
    several.record("sensordata", "qpos")
    several.record("qpos", "actuator_force")
    names = ("sensordata", "qpos", "actuator_force")
    for call in range(4):
        for simulation in (single, several):
            simulation.ctrl += 0.1
        left: dict[str, list[torch.Tensor]] = {name: [] for name in names}
        for _ in range(num_steps):
            single.step()
            for name in names:
                left[name].append(getattr(single, name).clone())
        several.step(num_steps)
        assert set(several.substeps) == set(names)
        for name, rows in left.items():
            expected = torch.stack(rows, dim=1)
            assert torch.equal(several.substeps[name].float(), expected), (call, name)
            assert (expected != 0.0).any()
            assert num_steps == 1 or not torch.equal(expected[:, 0], expected[:, -1])


def test_what_is_recorded_follows_the_number_of_steps(make_standing):
    simulation = make_standing(3)
    simulation.record("qvel")
    for num_steps in (2, 5, 2):
        simulation.step(num_steps)
        assert simulation.substeps["qvel"].shape == (3, num_steps, MODEL.nv)
        assert torch.equal(simulation.substeps["qvel"][:, -1].float(), simulation.qvel)


def test_what_is_written_to_one_robot_leaves_the_others_their_double_precision():
    simulation, twin = (_make_standing(2) for _ in range(2))
    for each in (simulation, twin):
        each.ctrl += 0.2
        each.step(5)
    simulation.qvel[0, 0] += 0.5
    simulation.qpos[0, 2] += 0.1
    for each in (simulation, twin):
        each.step()
    state, other = (each.state_dict()["integration"] for each in (simulation, twin))
    assert not torch.equal(state[0], other[0])
    assert torch.equal(state[1], other[1])
    assert not torch.equal(state[1], state[1].float().double())


def test_positions_alone_make_the_sensors_of_positions_current():
    simulation = _make_standing()
    columns = sensor_slice(MODEL, "FR_foot_pos", 4)
    before = simulation.sensordata[:, columns].clone()
    simulation.qpos[:, 2] += 0.25
    simulation.forward(torch.tensor([False, True]), "positions")
    raised = simulation.sensordata[:, columns] - before
    assert (raised[0] == 0.0).all()
    torch.testing.assert_close(raised[1, 2::3], torch.full((4,), 0.25), atol=1e-6, rtol=0.0)


def test_a_field_of_a_model_with_other_shapes_is_refused_and_nothing_is_written(make_standing):
    simulation = make_standing()
    simulation.field("body_mass")
    friction = simulation.field("geom_friction")
    own = tuple(friction.shape)
    state = simulation.state_dict()
    state["field/body_mass"] = state["field/body_mass"] + 1.0
    state["field/geom_friction"] = torch.ones(2, MODEL.ngeom + 4, 3, dtype=friction.dtype)
    before = simulation.field("body_mass").clone()
    with pytest.raises(ValueError, match="geom_friction") as error:
        simulation.load_state_dict(state)
    assert str(error.value) == (
        f"simulation field 'geom_friction' has shape (2, {MODEL.ngeom + 4}, 3), "
        f"this model needs {own}"
    )
    assert torch.equal(simulation.field("body_mass"), before)


def test_set_points_of_each_physics_step_are_those_of_as_many_steps(make_standing):
    simulation, other = make_standing(2), make_standing(2)
    simulation.record("qpos")
    generator = torch.Generator().manual_seed(0)
    ctrl = simulation.ctrl[:, None] + 0.3 * torch.rand(2, 4, 12, generator=generator)
    simulation.step(4, ctrl)
    for step in range(4):
        other.ctrl[:] = ctrl[:, step]
        other.step()
    assert torch.equal(simulation.qpos, other.qpos)
    assert torch.equal(simulation.ctrl, ctrl[:, -1])
    assert torch.equal(simulation.substeps["qpos"][:, -1].float(), simulation.qpos)
    simulation.step()  # the last ones hold
    other.step()
    assert torch.equal(simulation.qpos, other.qpos)
