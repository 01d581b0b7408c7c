"""Keys of the window change what the robots are asked to do."""

from __future__ import annotations

import pytest
import torch
from standing import Standing

from mute.controllers.command import Command
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.evaluation.session import Session
from mute.live.keys import press

UP, DOWN, LEFT, RIGHT = 265, 264, 263, 262  # GLFW's codes


@pytest.fixture
def session() -> Session:
    env = QuadrupedEnv(QuadrupedEnvCfg(num_envs=1, num_threads=1))
    return Session(env, Standing(), Command(0.5, 0.0, 0.0, 0.5))


@pytest.mark.parametrize(
    ("key", "expected"),
    [
        (UP, Command(0.6, 0.0, 0.0, 0.5)),
        (DOWN, Command(0.4, 0.0, 0.0, 0.5)),
        (LEFT, Command(0.5, 0.0, 0.1, 0.5)),
        (RIGHT, Command(0.5, 0.0, -0.1, 0.5)),
        (ord("Q"), Command(0.5, 0.1, 0.0, 0.5)),
        (ord("E"), Command(0.5, -0.1, 0.0, 0.5)),
        (ord("B"), Command(0.5, 0.0, 0.0, 0.6)),
        (ord("V"), Command(0.5, 0.0, 0.0, 0.4)),
        (ord(" "), Command(0.0, 0.0, 0.0, 0.5)),
        (ord("X"), Command(0.5, 0.0, 0.0, 0.5)),
    ],
)
def test_a_key_changes_the_command_of_the_robots(session, key, expected):
    press(session, key)
    assert session.command == expected
    torch.testing.assert_close(session.env.commands.command[0], expected.tensor())


def test_keys_stay_within_the_limits_and_come_back_to_exactly_zero(session):
    for _ in range(30):
        press(session, UP)
    assert session.command.vx == 2.0
    for _ in range(20):
        press(session, DOWN)
    assert session.command.vx == 0.0
    for _ in range(9):
        press(session, ord("B"))
    assert session.command.beta == 1.0


def test_the_restart_key_begins_anew_with_the_same_command(session):
    press(session, UP)
    session.step()
    press(session, ord("R"))
    assert session.steps == 0
    assert session.command == Command(0.6, 0.0, 0.0, 0.5)


def test_the_space_bar_stops_the_robots_and_lets_them_go_on(session):
    press(session, RIGHT)
    press(session, ord(" "))
    assert session.command == Command(0.0, 0.0, 0.0, 0.5)
    press(session, ord(" "))
    assert session.command == Command(0.5, 0.0, -0.1, 0.5)
