"""Tests that hold the two engines to each other, with the policy of flat ground, on the CPU.

MuJoCo Warp computes in float32 and stops its solver at a tolerance of 1e-6, MuJoCo in float64
and at 1e-8. A foot whose distance to the ground is within rounding of zero touches it a physics
step earlier in one of them, and from there on the two robots differ by what such a step moves. So
states are compared among the robots whose contacts agreed at every physics step, and figures among
all of them.
"""

from __future__ import annotations

import dataclasses

import pytest
import torch
from learning_helpers import NUM_STEPS, differences, make_cfg, make_runner
from places import FLAT_POLICY

from mute.checkpoint import CheckpointError
from mute.controllers import LearnedController, load_policy
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.rewards import reward_term
from mute.envs.sensors import NUM_SHAPES, sensor_slice
from mute.envs.warp_simulation import WarpSimulation
from mute.evaluation.gait import GaitMeter
from mute.evaluation.trials import evaluation_cfg

POLICY = load_policy(FLAT_POLICY)
ENGINES = ("mujoco", "warp")


def _make_env(engine, num_envs):
    """Make robots with physics and observations as in training, and every reward at full weight."""
    cfg = evaluation_cfg(POLICY.cfg.env, num_envs, 30.0, seed=3, randomized=True)
    ramps = {"quiet_ramp": (0.0, 0.0), "lift_ramp": (0.0, 0.0), "guide_ramp": (50.0, 100.0)}
    terms = cfg.rewards.terms | {"diagonal_support": reward_term("diagonal_support", 0.7)}
    rewards = dataclasses.replace(cfg.rewards, phase_source="true", terms=terms, **ramps)
    env = QuadrupedEnv(dataclasses.replace(cfg, engine=engine, num_threads=1, rewards=rewards))
    command = torch.zeros(num_envs, 4)
    command[:, 0] = torch.linspace(-0.6, 0.8, num_envs)
    command[:, 2] = torch.linspace(0.5, -0.5, num_envs)
    command[:, 3] = torch.arange(num_envs) % 5 / 4
    env.set_command(command)
    return env


def _put_at_the_same(one, other):
    """Put an environment to the state of one that has another engine."""
    state = one.state_dict()
    moving = {name: getattr(one.simulation, name).clone() for name in ("qpos", "qvel", "ctrl")}
    state["simulation"] = other.simulation.state_dict() | moving
    other.load_state_dict(state)


def _contacts(env):
    """Return what all contact sensors found at every physics step."""
    columns = sensor_slice(env.model, "FR_foot_contact", 4)
    links = sensor_slice(env.model, "trunk_contact", NUM_SHAPES)
    found = env.simulation.substeps["sensordata"].float()
    return torch.cat((found[:, :, columns], found[:, :, links]), dim=2).flatten(1)


TOLERANCES = {
    "qpos": 5e-4,
    "qvel": 1e-2,
    "foot position": 1e-4,
    "foot velocity": 2e-3,
    "torque": 1e-2,
    "landing speed": 1e-3,
    "phase": 0.0,
    "reward": 2e-5,
}
"""Largest difference after up to 100 control steps: m, rad, m/s, rad/s, N m; about ten times what
was found."""


def _quantities(env, reward):
    """Return what `TOLERANCES` names. Shapes: (num_envs, ...)."""
    data, model = env.simulation.sensordata, env.model
    return {
        "qpos": env.simulation.qpos,
        "qvel": env.simulation.qvel,
        "foot position": data[:, sensor_slice(model, "FR_foot_pos", 4)],
        "foot velocity": data[:, sensor_slice(model, "FR_foot_vel", 4)],
        "torque": env.simulation.actuator_force,
        "landing speed": env.footfalls.landing_speed,
        "phase": env.footfalls.phase,
        "reward": reward.unsqueeze(1),
    }


def test_the_same_actions_from_the_same_state_give_the_same_walk_for_100_control_steps():
    num_envs = 16
    one, other = (_make_env(engine, num_envs) for engine in ENGINES)
    controller = LearnedController(POLICY, num_envs)
    # Every robot begins with a foot at distance zero, where rounding decides: walk off first.
    for _ in range(25):
        one.step(controller.act(one.get_observations()))
    _put_at_the_same(one, other)
    agreed = torch.ones(num_envs, dtype=torch.bool)
    differing: list[float] = []
    for _ in range(100):
        action = controller.act(one.get_observations())
        values = [_quantities(env, env.step(action)[1]) for env in (one, other)]
        differs = _contacts(one) != _contacts(other)
        differing.append(float(differs.float().mean()))
        agreed &= ~differs.any(dim=1)
        for name, tolerance in TOLERANCES.items():
            worst = float((values[0][name] - values[1][name])[agreed].abs().max())
            assert worst <= tolerance, (name, worst)
    assert int(agreed.sum()) >= 0.75 * num_envs
    assert sum(differing) / len(differing) < 0.002


def _figures(engine):
    """Return what robots do in 1000 control steps: gait, and every reward's mean per second."""
    num_envs, steps = 32, 1000
    env = _make_env(engine, num_envs)
    controller = LearnedController(POLICY, num_envs)
    meter = GaitMeter(env)
    rewards: dict[str, float] = {}
    for _ in range(steps):
        _, _, dones, extras = env.step(controller.act(env.get_observations()))
        controller.reset(dones)
        meter.update(env.commands.command, dones)
        for name, value in extras["log"].items():
            if name.startswith("Reward/"):
                rewards[name] = rewards.get(name, 0.0) + float(value) / steps
    return meter.gait().as_dict(), rewards


def test_both_engines_walk_alike_over_1000_control_steps():
    (gait, rewards), (other_gait, other_rewards) = (_figures(engine) for engine in ENGINES)
    assert gait["stride_frequency"] > 0.8  # they do walk
    assert gait["fall_rate"] == gait["unstable"] == 0
    # Commands forwards and backwards leave a mean speed of 6 cm/s, of which 5 % is little.
    assert other_gait.pop("speed") == pytest.approx(gait.pop("speed"), abs=0.005)
    # Landing speeds, apexes, share of contact, power: within 5 %, or 0.001 of their units.
    assert other_gait == pytest.approx(gait, rel=0.05, abs=1e-3)
    # Every reward: within 10 %, or 0.001 of about 1 a second.
    assert other_rewards == pytest.approx(rewards, rel=0.1, abs=1e-3)


def test_a_training_on_warp_that_is_resumed_is_the_one_that_was_not_interrupted(tmp_path):
    whole, resumed = (make_runner(tmp_path / name, engine="warp") for name in ("one", "other"))
    assert isinstance(whole.env.env.simulation, WarpSimulation)
    whole.train()
    resumed.load(str(tmp_path / "one" / "model_0.pt"))
    resumed.train()
    assert whole.env.env.step_count == 2 * NUM_STEPS
    assert differences(resumed.env.state_dict(), whole.env.state_dict()) == []
    assert all(value.isfinite().all() for value in whole.alg.actor.parameters())


def test_a_training_cannot_be_resumed_with_the_other_engine(tmp_path):
    make_runner(tmp_path, iterations=1).train()
    other = make_runner(None, engine="warp")
    with pytest.raises(CheckpointError, match="not of the engine 'warp'"):
        other.load(str(tmp_path / "model_0.pt"))


def test_a_training_of_the_engine_of_an_earlier_version_says_that_its_policy_alone_goes_on(
    tmp_path,
):
    runner = make_runner(tmp_path, iterations=1)
    runner.train()
    path = tmp_path / "model_0.pt"
    saved = torch.load(path, weights_only=True)
    state = saved["env"]["env"]["simulation"]
    # It told no version, had shapes that are only to be seen, and kept readings in its state.
    del state["mujoco"]
    state["field/geom_friction"] = torch.ones(len(state["qpos"]), 84, 3, dtype=torch.float64)
    state["integration"] = torch.nn.functional.pad(state["integration"], (0, 100))
    torch.save(saved, path)
    with pytest.raises(
        CheckpointError, match=r"engine of an earlier version.*play and export"
    ) as e:
        make_runner(None).load(str(path))
    assert "\n" not in str(e.value)


def test_no_tensor_is_left_to_the_default_device_so_that_all_lie_with_the_engine(tmp_path):
    # A tensor on the device `meta` holds nothing: to compute with it fails, as does mixing devices.
    with torch.device("meta"):
        env = QuadrupedEnv(make_cfg().env)
        env.load_state_dict(env.state_dict())
    runner = make_runner(tmp_path)
    with torch.device("meta"):
        assert runner.train()
    tensors = [value for value in vars(env).values() if isinstance(value, torch.Tensor)]
    assert len(tensors) > 10
    assert all(value.device == env.device for value in tensors)
