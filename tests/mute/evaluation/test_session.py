"""A walk can be steered, measured and begun anew."""

from __future__ import annotations

import pytest
import torch
from standing import Standing

from mute.controllers.command import Command
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.evaluation.session import Session
from mute.evaluation.trials import evaluation_cfg


def _make_session() -> Session:
    cfg = evaluation_cfg(QuadrupedEnvCfg(num_threads=1), 2, seconds=10.0, seed=0)
    return Session(QuadrupedEnv(cfg), Standing(2), Command(0.5, 0.0, 0.0, 0.5), 0.1)


def test_a_new_command_is_observed_and_measured_from_the_next_step_on():
    session = _make_session()
    for _ in range(50):
        session.step()
    session.recent_gait()
    session.set_command(Command(2.0, 0.0, 0.0, 0.25))
    assert session.env.get_observations()["policy"][0, -1] == pytest.approx(0.25)
    for _ in range(10):
        session.step()
    # A robot that stands makes the error of the whole command.
    assert session.recent_gait().velocity_error_sq == pytest.approx(4.0, abs=0.3)


def test_a_robot_that_falls_goes_on_with_the_same_command_and_no_past():
    session = _make_session()
    session.set_command(Command(0.3, 0.1, -0.2, 0.9))
    session.env.simulation.qpos[1, 3:7] = torch.tensor((0.0, 1.0, 0.0, 0.0))  # on its back
    session.step()
    expected = torch.tensor((0.3, 0.1, -0.2, 0.9))
    torch.testing.assert_close(session.env.commands.command, expected.expand(2, 4))
    controller = session.controller
    assert isinstance(controller, Standing)
    forgotten = controller.resets[-1]
    assert forgotten is not None
    assert forgotten.tolist() == [False, True]
    assert session.gait().fall_rate == 0.5


def test_a_restart_forgets_figures_and_time_but_not_the_command():
    session = _make_session()
    session.set_command(Command(0.1, 0.2, 0.3, 0.4))
    session.env.simulation.qpos[0, 3:7] = torch.tensor((0.0, 1.0, 0.0, 0.0))
    session.step()
    session.restart()
    assert session.seconds == 0.0
    assert session.gait().fall_rate == 0.0
    expected = torch.tensor((0.1, 0.2, 0.3, 0.4))
    torch.testing.assert_close(session.env.commands.command[0], expected)
