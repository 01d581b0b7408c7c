"""The controller stands, trots and turns as it is asked to, on robots that differ and see badly."""

from __future__ import annotations

import dataclasses

import pytest
import torch

from mute.acoustics.audible_env import audible_cfg
from mute.controllers.mpc import MpcCfg, MpcController
from mute.controllers.mpc.driver import MpcDriver
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.evaluation.trials import evaluation_cfg, from_the_stance
from mute.evaluation.usual_robots import robots_cfg

COMMANDS = [
    (0.0, 0.0, 0.0),
    (0.1, 0.0, 0.0),
    (0.5, 0.0, 0.0),
    (1.0, 0.0, 0.0),
    (-0.3, 0.0, 0.0),
    (0.0, 0.4, 0.0),
    (0.0, -0.4, 0.0),
    (0.0, 0.0, 1.0),
    (1.0, 0.0, 1.0),
    (0.5, 0.4, 0.0),
    (0.8, -0.3, -0.8),
]


def _env(robots: int, seconds: float) -> QuadrupedEnv:
    """Return robots that differ, see with noise, and begin in their stance."""
    cfg = from_the_stance(robots_cfg(MpcDriver(), robots, seconds, seed=1))
    return QuadrupedEnv(dataclasses.replace(cfg, num_threads=1))


def _walk(
    env: QuadrupedEnv, controller: MpcController, command: torch.Tensor, steps: int
) -> torch.Tensor:
    """Walk, and return (v_x, v_y, w_z) of each robot over the second half. Shape: (robots, 3)."""
    env.set_command(command)
    moved = []
    for _ in range(steps):
        env.step(controller.act(env.get_observations()))
        assert not bool(env.fallen.any())
        moved.append(torch.cat((env.base_lin_vel[:, :2], env.base_ang_vel[:, 2:]), dim=1))
    return torch.stack(moved[steps // 2 :]).mean(dim=0)


def test_it_walks_at_what_it_is_asked_for_and_then_stands_still():
    each = 1
    command = torch.tensor([(*command, 0.0) for command in COMMANDS] * each)
    env = _env(len(command), 20.0)
    env.autoreset = False
    controller = MpcController(env.cfg)
    moved = _walk(env, controller, command, 200)
    # In curves it slides outwards somewhat.
    curve = command[:, :2].norm(dim=1) * command[:, 2].abs()
    assert bool(((moved - command[:, :3]).abs().amax(dim=1) < 0.09 + 0.2 * curve).all())
    _walk(env, controller, torch.zeros(4), 100)
    speeds = []
    for _ in range(25):
        env.step(controller.act(env.get_observations()))
        speeds.append(env.joint_vel.abs().mean(dim=1))
        assert bool(env.footfalls.contact.all())
    assert float(torch.stack(speeds).mean(dim=0).max()) < 0.05
    assert float(env.projected_gravity[:, :2].norm(dim=1).max()) < 0.09  # 5 degrees
    assert float((env.base_pos[:, 2] - 0.3).abs().max()) < 0.03


def test_it_walks_on_a_hard_floor_and_at_its_rate_of_physics():
    cfg = audible_cfg(robots_cfg(MpcDriver(), 4, 5.0, seed=1), "wood")
    env = QuadrupedEnv(dataclasses.replace(from_the_stance(cfg), num_threads=1))
    moved = _walk(env, MpcController(env.cfg), torch.tensor((0.5, 0.0, 0.0, 0.0)), 100)
    assert float((moved[:, 0] - 0.5).abs().max()) < 0.1


def test_a_robot_that_measured_nonsense_is_itself_again_once_it_begins_anew():
    env = _env(2, 5.0)
    controller = MpcController(env.cfg)
    _walk(env, controller, torch.tensor((0.5, 0.0, 0.0, 0.0)), 10)
    broken = env.get_observations().clone()
    broken["policy"][0] = torch.nan
    controller.act(broken)
    controller.reset(torch.tensor([True, False]))
    assert bool(controller.act(env.get_observations()).isfinite().all())


@pytest.mark.parametrize("speed", [0.0, 0.5])
def test_it_survives_pushes_of_half_a_metre_a_second(speed):
    env = _env(8, 20.0)
    env.autoreset = False
    controller = MpcController(env.cfg)
    command = torch.tensor((speed, 0.0, 0.0, 0.0))
    _walk(env, controller, command, 75)
    angle = torch.linspace(0.0, 5.5, 8)
    env.simulation.qvel[:, :2] += 0.5 * torch.stack((angle.cos(), angle.sin()), dim=1)
    moved = _walk(env, controller, command, 200)
    assert float((moved[:, :2] - command[:2]).abs().max()) < 0.08


def test_the_true_velocity_is_taken_where_it_is_asked_for():
    env = _env(4, 5.0)
    controller = MpcController(env.cfg, MpcCfg(true_velocity=True))
    moved = _walk(env, controller, torch.tensor((0.5, 0.0, 0.0, 0.0)), 150)
    assert float((moved[:, 0] - 0.5).abs().max()) < 0.04


def test_robots_that_begin_anew_have_no_past():
    env = _env(2, 5.0)
    controller, other = MpcController(env.cfg), MpcController(env.cfg)
    _walk(env, controller, torch.tensor((0.5, 0.0, 0.0, 0.0)), 40)
    env.reset(torch.tensor([True, False]))
    controller.reset(torch.tensor([True, False]))
    observations = env.get_observations()
    fresh, known = other.act(observations), controller.act(observations)
    torch.testing.assert_close(known[0], fresh[0], rtol=0.0, atol=1e-6)
    assert float((known[1] - fresh[1]).abs().max()) > 0.01


def test_it_acts_in_every_physics_step_of_whatever_environment():
    exact = evaluation_cfg(MpcDriver().cfg.env, 1, 5.0, 1)
    scene = dataclasses.replace(exact.scene, timestep=0.002)
    env = QuadrupedEnv(dataclasses.replace(exact, scene=scene, decimation=10))
    controller = MpcController(env.cfg)
    assert controller.act(env.get_observations()).shape == (1, 10, 12)
    moved = _walk(env, controller, torch.tensor((0.5, 0.0, 0.0, 0.0)), 150)
    assert float(moved[0, 0]) == pytest.approx(0.5, abs=0.05)


def test_settings_out_of_their_range_are_refused():
    with pytest.raises(ValueError, match=r"mpc\.gait_period"):
        MpcCfg(gait_period=0.0)


def test_its_robots_are_those_of_the_default_task():
    assert isinstance(MpcDriver().cfg.env, QuadrupedEnvCfg)
    assert MpcDriver().cfg.env.observations.sensors
