"""A walk can be steered, measured and begun anew."""

from __future__ import annotations

import math

import pytest
import torch
from standing import Standing

from mute.controllers.command import Command
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.evaluation.session import Session
from mute.evaluation.trials import evaluation_cfg


def _make_session(stand_time: float = 0.0) -> Session:
    cfg = evaluation_cfg(QuadrupedEnvCfg(num_threads=1), 2, seconds=10.0, seed=0)
    command = Command(0.5, 0.0, 0.0, 0.5)
    return Session(QuadrupedEnv(cfg), Standing(2), command, 0.1, stand_time=stand_time)


def _asked(session: Session) -> list[float]:
    """Return the forward command and the beta that the first robot observes."""
    observed = session.env.get_observations()["policy"][0, -4:].tolist()
    return [round(observed[0], 6), round(observed[3], 6)]


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


def test_a_push_changes_the_velocity_along_the_heading_and_to_its_left():
    session = _make_session()
    env = session.env
    before = env.simulation.qvel[:, :2].clone()
    session.push(0.3, -0.4)
    change = (env.simulation.qvel[:, :2] - before).float()
    ahead = env.heading
    across = torch.stack((-ahead[:, 1], ahead[:, 0]), dim=1)
    close = torch.testing.assert_close
    close((change * ahead).sum(dim=1), torch.full((2,), 0.3))
    close((change * across).sum(dim=1), torch.full((2,), -0.4))
    assert (ahead - torch.tensor([1.0, 0.0])).abs().max() > 0.1  # not the world's axes


def test_what_drives_can_be_changed_while_it_walks():
    session = _make_session()
    session.step()
    other = Standing(2)
    session.drive_with(other)
    session.step()
    assert session.controller is other
    assert other.resets[0] is None  # it begins without a past
    assert session.steps == 2


def _walk(session: Session, steps: int) -> None:
    for _ in range(steps):
        session.step()


def test_figures_are_of_all_commands_and_of_one_driver():
    session = _make_session()
    _walk(session, 20)
    assert session.gait().velocity_error_sq == pytest.approx(0.25, abs=0.2)
    session.set_command(Command(2.0, 0.0, 0.0, 0.5))
    _walk(session, 20)
    assert 1.0 < session.gait().velocity_error_sq < 3.5
    assert session.figures_from == 0.0
    session.drive_with(Standing(2))
    assert math.isnan(session.gait().speed)
    assert session.figures_from == pytest.approx(0.8)
    session.restart()
    assert session.figures_from == 0.0


def test_another_driver_is_not_judged_by_what_the_one_before_did():
    session = _make_session()
    _walk(session, 130)
    assert session.verdict().too_slow == 2
    session.drive_with(Standing(2))
    assert session.verdict().judged == 0


class _Follower:
    """Notes what it is told, and how old the first robot is then, in control steps."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self.told: list[tuple[str, int]] = []

    def follow(self) -> None:
        self.told.append(("step", int(self._session.env.episode_length_buf[0])))

    def restart(self) -> None:
        self.told.append(("restart", int(self._session.env.episode_length_buf[0])))


def test_who_follows_a_walk_is_told_of_each_step_and_of_a_restart_before_it():
    session = _make_session()
    follower = _Follower(session)
    session.followers.append(follower)
    session.step()
    session.step()
    session.restart()
    session.step()
    assert follower.told == [("step", 1), ("step", 2), ("restart", 2), ("step", 1)]


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


def test_a_robot_stands_before_it_gets_the_command_and_again_after_a_fall():
    session = _make_session(stand_time=0.1)
    forward = []
    for step in range(16):
        if step == 8:
            session.env.simulation.qpos[1, 3:7] = torch.tensor((0.0, 1.0, 0.0, 0.0))
        asked = []
        act = session.controller.act

        def note(observations, act=act, asked=asked):
            asked.append(observations["policy"][:, -4:].clone())
            return act(observations)

        session.controller.act = note
        session.step()
        session.controller.act = act
        forward.append(asked[0][:, 0].tolist())
    assert [first for first, _ in forward] == [0.0] * 5 + [0.5] * 11
    # The second falls in the step of index 8.
    assert [second for _, second in forward] == [0.0] * 5 + [0.5] * 4 + [0.0] * 5 + [0.5] * 2


def test_a_command_that_comes_while_robots_stand_waits_for_them():
    session = _make_session(stand_time=0.1)
    session.step()
    session.set_command(Command(0.8, 0.0, 0.0, 0.9))
    assert _asked(session) == [0.0, 0.9]
    for _ in range(5):
        session.step()
    assert _asked(session) == [0.8, 0.9]


def test_stop_and_go_comes_back_to_the_command_before_with_the_beta_of_now():
    session = _make_session()
    session.set_command(Command(0.3, 0.1, -0.2, 0.5))
    session.stop_or_go()
    assert session.command == Command(0.0, 0.0, 0.0, 0.5)
    session.set_command(session.command.changed(beta=0.2))
    session.stop_or_go()
    assert session.command == Command(0.3, 0.1, -0.2, 0.7)


def test_a_robot_that_stands_did_not_do_what_it_was_asked_until_it_is_asked_to_stand():
    session = _make_session()
    session.set_command(Command(0.0, 0.0, 0.0, 0.5))
    for _ in range(130):
        session.step()
    assert session.verdict().share == 1.0
    session.set_command(Command(0.5, 0.0, 0.0, 0.5))
    for _ in range(130):
        session.step()
    assert (session.verdict().share, session.verdict().too_slow) == (0.0, 2)
    session.restart()
    assert session.verdict().judged == 0
