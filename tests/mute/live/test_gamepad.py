"""A gamepad steers the robots as it does on the page, and one that is lost lets them stand."""

from __future__ import annotations

import math

import pytest
from standing import Standing

from mute.controllers.command import Command
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.evaluation.session import Session
from mute.live.gamepad import Gamepad, PadState, Pull, pull, without_slack
from mute.live.keys import press

A, B, X, LB, RB, START = 0, 1, 2, 4, 5, 7
"""Buttons in GLFW's standard layout."""


class _Source:
    """Gives the states that were put in."""

    def __init__(self) -> None:
        self._events: list[PadState | str | None] = []

    def put(self, *events: PadState | str | None) -> None:
        self._events += events

    def read(self) -> list[PadState | str | None]:
        given, self._events = self._events, []
        return given


class _Driven:
    """A walk with a gamepad."""

    def __init__(self) -> None:
        env = QuadrupedEnv(QuadrupedEnvCfg(num_envs=1, num_threads=1))
        self.session = Session(env, Standing(), Command(0.5, 0.0, 0.2, 0.5))
        self.told: list[str] = []
        self._source = _Source()
        self._gamepad = Gamepad(self._source, self.told.append)

    def ask(self, *events: PadState | str | None) -> Command:
        """Let events come, and return what the robots are asked then."""
        self._source.put(*events)
        self._gamepad.steer(self.session)
        return self.session.command


@pytest.fixture
def driven() -> _Driven:
    return _Driven()


def _state(x: float = 0.0, y: float = 0.0, turn: float = 0.0, *buttons: int) -> PadState:
    return PadState("pad", (x, y, turn, 0.0, -1.0, -1.0), frozenset(buttons))


@pytest.mark.parametrize(
    ("share", "pulled"),
    [
        (0.0, 0.0),
        (0.12, 0.0),
        (-0.12, 0.0),
        (0.56, 0.5),
        (-0.56, -0.5),
        (1.0, 1.0),
        (-1.0, -1.0),
        (1.01, 1.0),
        (math.nan, 0.0),
        (math.inf, 0.0),
    ],
)
def test_the_slack_of_a_stick_is_let_be_and_the_rest_is_even(share, pulled):
    assert without_slack(share) == pytest.approx(pulled)


@pytest.mark.parametrize(
    ("axes", "expected"),
    [
        ((0.0, -1.0, 0.0, 0.0, -1.0, -1.0), Pull(forward=1.0)),
        ((0.0, 1.0, 0.0, 0.0, -1.0, -1.0), Pull(forward=-1.0)),
        ((-1.0, 0.0, 0.0, 0.0, -1.0, -1.0), Pull(left=1.0)),
        ((0.0, 0.0, -1.0, 0.0, -1.0, -1.0), Pull(turn=1.0)),
        ((0.0, 0.0, 0.0, 1.0, 1.0, 1.0), Pull()),  # its other way, and the triggers
        ((0.05, -0.1, 0.11, 0.0, -1.0, -1.0), Pull()),
        ((0.0, -1.0), Pull(forward=1.0)),
        ((), Pull()),
    ],
)
def test_sticks_ask_for_shares_forward_to_the_left_and_of_a_turn(axes, expected):
    asked = pull(axes)
    assert asked == expected
    assert all(math.copysign(1.0, part) == 1.0 or part for part in vars(asked).values())  # no -0.0


def test_a_pulled_stick_asks_for_a_share_of_the_trained_speeds(driven):
    trained = driven.session.env.cfg.commands
    command = driven.ask(_state(x=1.0, y=-0.56, turn=-1.0))
    assert command == Command(
        round(0.5 * trained.lin_vel_x[1], 2), trained.lin_vel_y[0], trained.ang_vel_z[1], 0.5
    )
    assert driven.told == ["the gamepad pad drives"]


def test_a_stick_that_rests_leaves_the_command_to_the_keys(driven):
    before = driven.session.command
    assert driven.ask(_state()) == before
    press(driven.session, 265)  # the arrow up
    assert driven.ask(_state(x=0.05)) == before.changed(vx=0.1)


def test_a_stick_that_is_let_go_asks_to_stand_once(driven):
    driven.ask(_state(y=-1.0))
    assert driven.ask(_state()).stands
    press(driven.session, 265)
    assert driven.ask().vx == 0.1


def test_a_stick_that_is_held_goes_before_the_keys(driven):
    asked = driven.ask(_state(y=-1.0))
    press(driven.session, 264)
    assert driven.session.command != asked
    assert driven.ask() == asked  # though nothing new came


def test_a_button_counts_when_it_is_pressed_and_not_while_it_is_held(driven):
    going = driven.session.command
    assert driven.ask(_state(0, 0, 0, A)).stands
    assert driven.ask(_state(0, 0, 0, A)).stands
    assert driven.ask(_state(0.01, 0, 0, A)).stands
    assert driven.ask(_state(), _state(0, 0, 0, A)) == going


def test_a_stop_holds_until_the_sticks_were_let_go(driven):
    pulled = driven.ask(_state(y=-1.0))
    assert driven.ask(_state(0, -1.0, 0, A)).stands
    assert driven.ask(_state(y=-0.8)).stands
    assert driven.ask().stands
    assert driven.ask(_state()).stands
    assert driven.ask(_state(y=-1.0)) == pulled


def test_to_go_on_leaves_a_held_stick_in_charge(driven):
    driven.ask(_state(), _state(0, 0, 0, A))
    pulled = driven.ask(_state(y=-1.0))
    driven.ask(_state(0, -1.0, 0, A), _state(y=-1.0))
    assert driven.ask(_state(0, -1.0, 0, A)).vx > 0.0
    assert driven.ask(_state(y=-1.0)).stands is False
    assert pulled.vx > 0.0


def test_bumpers_change_beta_within_its_limits(driven):
    assert driven.ask(_state(0, 0, 0, RB)).beta == 0.6
    assert driven.ask(_state(), _state(0, 0, 0, LB)).beta == 0.5
    for _ in range(8):
        driven.ask(_state(), _state(0, 0, 0, RB))
    assert driven.session.command == Command(0.5, 0.0, 0.2, 1.0)


def test_pushes_go_to_one_side_and_the_other_in_turn(driven):
    env = driven.session.env
    heading = env.heading[0]
    left = (-float(heading[1]), float(heading[0]))
    for side in (1.0, -1.0, 1.0):
        before = env.simulation.qvel[0, :2].clone()
        driven.ask(_state(), _state(0, 0, 0, X))
        change = (env.simulation.qvel[0, :2] - before).tolist()
        assert change == pytest.approx([side * part for part in left], abs=1e-5)


def test_start_begins_anew_and_other_buttons_do_nothing(driven):
    driven.session.step()
    before = driven.session.command
    assert driven.ask(_state(0, 0, 0, B, 3, 6, 8, 14)) == before
    assert driven.session.steps == 1
    driven.ask(_state(0, 0, 0, START))
    assert driven.session.steps == 0
    assert driven.session.command == before


def test_a_lost_gamepad_lets_the_robots_stand_and_is_told_in_a_line(driven):
    driven.ask(_state(y=-1.0))
    command = driven.ask(None)
    assert command == Command(0.0, 0.0, 0.0, 0.5)
    assert driven.told[1:] == ["the gamepad pad is gone: the robot stands; keys go on"]
    press(driven.session, 265)
    assert driven.ask().vx == 0.1  # the stick is not remembered
    driven.ask(_state(0, 0, 0, RB))
    assert driven.told[2:] == ["the gamepad pad drives"]
    assert driven.session.command.beta == 0.6


def test_a_gamepad_that_never_drove_cannot_be_lost(driven):
    before = driven.session.command
    assert driven.ask(None, "no gamepad can be read") == before
    assert driven.told == ["no gamepad can be read"]
