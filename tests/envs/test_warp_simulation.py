"""Tests of the engine on MuJoCo Warp, beside the protocol's own in `test_simulation`.

All run on the CPU, through the same graphs that a GPU would replay.
"""

from __future__ import annotations

import importlib
import math

import mujoco
import numpy as np
import pytest
import torch

from mute.envs.batch_simulation import BatchSimulation
from mute.envs.engines import make_simulation
from mute.envs.randomization import RandomizationCfg, randomize_physics
from mute.envs.scene import SceneCfg, build_scene
from mute.envs.warp_simulation import WarpSimulation

MODEL = build_scene(SceneCfg())


def _make_standing(num_envs=2):
    simulation = WarpSimulation(MODEL, num_envs)
    simulation.reset(torch.ones(num_envs, dtype=torch.bool))
    simulation.forward()
    simulation.ctrl[:] = simulation.qpos[:, 7:]
    return simulation


def test_the_engine_follows_the_device_unless_it_is_named():
    assert isinstance(make_simulation(MODEL, 1), BatchSimulation)
    assert isinstance(make_simulation(MODEL, 1, engine="warp"), WarpSimulation)
    assert isinstance(make_simulation(MODEL, 1, "cuda", engine="mujoco"), BatchSimulation)


@pytest.mark.parametrize("device", ["cuda", "cuda:1", "mps"])
def test_a_device_that_is_not_there_is_refused(monkeypatch, device):
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 0)
    with pytest.raises(ValueError, match=device):
        make_simulation(MODEL, 2, device=device)


def test_without_the_package_one_line_says_what_to_install(monkeypatch):
    def not_installed(name):
        raise ImportError(name)

    monkeypatch.setattr(importlib, "import_module", not_installed)
    with pytest.raises(ValueError, match=r"pip install 'mute\[gpu\]'") as error:
        WarpSimulation(MODEL, 1)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("scene", "field"),
    [
        ({"ground_boxes": 1}, "env.terrain.kind"),
        ({"longest_delay": 0.02}, "env.randomization.action_delay"),
    ],
)
def test_ground_of_boxes_and_late_motors_are_refused_with_the_field_and_a_way_out(scene, field):
    with pytest.raises(ValueError, match=rf"env\.engine 'mujoco', or leave {field}") as error:
        WarpSimulation(build_scene(SceneCfg(**scene)), 1)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("engines", [("mujoco", "warp"), ("warp", "mujoco")])
def test_a_state_of_the_other_engine_is_refused(engines):
    one, other = (make_simulation(MODEL, 1, engine=engine) for engine in engines)
    with pytest.raises(ValueError, match=f"not of the engine '{engines[0]}'"):
        one.load_state_dict(other.state_dict())


def test_tensors_are_the_engines_own_memory():
    simulation = _make_standing()
    for name in ("qpos", "qvel", "ctrl", "sensordata", "actuator_force"):
        tensor = getattr(simulation, name)
        assert tensor.data_ptr() == getattr(simulation._data, name).ptr
        assert tensor.dtype == torch.float32
    assert simulation.field("body_mass").data_ptr() == simulation._model.body_mass.ptr


def test_a_simulation_that_blew_up_stays_unstable_until_it_is_reset():
    simulation = _make_standing()
    simulation.qpos[0, 0] = math.nan
    simulation.step(4)
    assert simulation.unstable().tolist() == [True, False]
    simulation.reset(torch.tensor([True, False]))
    simulation.ctrl[0] = simulation.qpos[0, 7:]
    simulation.step(4)
    assert not simulation.unstable().any()


def test_lost_contacts_make_a_simulation_unstable_and_a_solver_at_its_limit_does_not():
    simulation = _make_standing(3)
    overflow = importlib.import_module("mujoco_warp").OverflowType
    flags = [overflow.NARROWPHASE, overflow.LS_ITERATIONS | overflow.ITERATIONS, overflow.NEFC]
    simulation._state["overflow"][:] = torch.tensor([int(flag) for flag in flags])
    assert simulation.unstable().tolist() == [True, False, True]
    simulation.reset(simulation.unstable())
    assert not simulation.unstable().any()


def test_forward_of_a_mask_leaves_all_that_the_others_continue_from_as_it_is():
    # At its limit of one iteration the solver of a forward pass raises a flag of every simulation.
    model = build_scene(SceneCfg())
    model.opt.iterations = 1
    simulation, twin = (WarpSimulation(model, 2) for _ in range(2))
    for each in (simulation, twin):
        each.reset(torch.ones(2, dtype=torch.bool))
        each.qvel[:, 2] = -1.0
    simulation.forward(torch.tensor([True, False]))
    assert simulation._state["overflow"][0] != 0
    for num_steps in (0, 5):
        for each in (simulation, twin):
            each.step(num_steps)
        for name, own in simulation._state.items():
            assert torch.equal(own[1], twin._state[name][1]), (num_steps, name)


def test_no_posture_has_more_contacts_than_there_is_room_for():
    num_envs = 64
    simulation = _make_standing(num_envs)
    # Flat on the ground and into it, belly up, belly down and on every side.
    generator = torch.Generator().manual_seed(0)
    simulation.qpos[:, 2] = 0.04 * torch.rand(num_envs, generator=generator) - 0.02
    simulation.qpos[:, 3:7] = torch.randn(num_envs, 4, generator=generator)
    simulation.qpos[:, 3:7] /= simulation.qpos[:, 3:7].norm(dim=1, keepdim=True)
    simulation.field("dof_frictionloss")[:] = 0.1
    simulation.step()
    data = simulation._data
    contacts, rows = int(data.nacon.numpy()[0]), int(data.nefc.numpy().max())
    assert 10 * num_envs < contacts <= data.naconmax
    assert 60 < rows <= data.njmax
    lost = simulation._state["overflow"] & ~simulation._harmless
    assert (lost == 0).all()


def test_a_field_that_comes_after_the_first_step_is_heeded():
    simulation = _make_standing()
    simulation.step()
    simulation.field("actuator_gainprm")[0] = 0.0
    simulation.field("actuator_biasprm")[0] = 0.0
    simulation.ctrl += 0.1
    simulation.step()
    assert (simulation.actuator_force[0] == 0.0).all()
    assert (simulation.actuator_force[1] > 1.0).all()


def test_a_field_that_all_simulations_share_is_refused():
    with pytest.raises(ValueError, match="geom_bodyid"):
        WarpSimulation(MODEL, 2).field("geom_bodyid")


def test_constants_follow_the_masses_as_mujoco_has_them():
    simulation = _make_standing(3)
    added = (0.0, 1.0, 3.0)
    trunk = MODEL.body("trunk").id
    simulation.field("body_mass")[:, trunk] += torch.tensor(added)
    simulation.field("body_ipos")[:, trunk, 0] += 0.1 * torch.tensor(added)
    simulation.set_const()
    for index, mass in enumerate(added):
        expected = build_scene(SceneCfg())
        expected.body_mass[trunk] += mass
        expected.body_ipos[trunk, 0] += 0.1 * mass
        mujoco.mj_setConst(expected, mujoco.MjData(expected))
        for name in ("body_subtreemass", "body_invweight0", "dof_invweight0"):
            value = getattr(simulation._model, name).numpy()[index]
            np.testing.assert_allclose(value, getattr(expected, name), rtol=1e-4)


def test_both_engines_draw_the_same_physics():
    engines = [make_simulation(MODEL, 4, engine=engine) for engine in ("mujoco", "warp")]
    generators = [torch.Generator().manual_seed(5) for _ in engines]
    known = [
        randomize_physics(simulation, RandomizationCfg(), generator).known
        for simulation, generator in zip(engines, generators, strict=True)
    ]
    assert torch.equal(*known)
    for name in ("geom_friction", "body_mass", "body_inertia", "body_ipos", "actuator_gainprm"):
        one, other = (simulation.field(name) for simulation in engines)
        torch.testing.assert_close(one.float(), other.float())
