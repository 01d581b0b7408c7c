"""The walk in a window, of which a stand-in takes what is shown."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from types import SimpleNamespace

import mujoco
import mujoco.viewer
import pytest
from standing import Standing

from mute.controllers.command import Command
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.evaluation.session import Session
from mute.live.gamepad import Gamepad, PadState
from mute.live.window import watch

_UP = 265


class _Viewer:
    """What `launch_passive` returns, as far as a walk goes."""

    def __init__(self, data: mujoco.MjData, press: Callable[[int], None]) -> None:
        self.cam = SimpleNamespace()
        self.user_scn = SimpleNamespace(ngeom=0)
        self.press = press
        self.places: list[float] = []
        self.texts: list[tuple] = []
        self.closed = False
        self._data = data

    def is_running(self) -> bool:
        return not self.closed

    def lock(self) -> contextlib.AbstractContextManager[None]:
        return contextlib.nullcontext()

    def set_texts(self, texts: tuple) -> None:
        self.texts.append(texts)

    def sync(self) -> None:
        self.places.append(float(self._data.qpos[0]))
        self.press(_UP)

    def close(self) -> None:
        self.closed = True


class _Pad:
    """A gamepad whose right bumper is pressed once."""

    def __init__(self) -> None:
        self._left = [PadState("pad"), PadState("pad", buttons=frozenset({5}))]

    def read(self) -> list[PadState | str | None]:
        return [self._left.pop(0)] if self._left else []


@pytest.fixture
def opened(monkeypatch) -> list[_Viewer]:
    viewers: list[_Viewer] = []

    def launch(_model, data, key_callback, **_options) -> _Viewer:
        viewers.append(_Viewer(data, key_callback))
        return viewers[-1]

    monkeypatch.setattr(mujoco.viewer, "launch_passive", launch)
    return viewers


def _make_session() -> Session:
    env = QuadrupedEnv(QuadrupedEnvCfg(num_envs=1, num_threads=1))
    return Session(env, Standing(), Command(0.0, 0.0, 0.0, 0.5))


def test_keys_and_a_gamepad_steer_and_the_robot_is_shown_where_it_is(opened):
    session, told = _make_session(), []
    watch(session, 50, lambda: {"speed": "1 m/s"}, gamepad=Gamepad(_Pad(), told.append))
    [viewer] = opened
    assert viewer.closed
    assert session.steps == len(viewer.places) == 50
    # The last key comes after the last step.
    assert session.command.vx == pytest.approx(min(0.1 * 49, 2.0))
    assert session.command.beta == pytest.approx(0.6)
    assert told == ["the gamepad pad drives"]
    assert viewer.places[-1] == pytest.approx(float(session.env.simulation.qpos[0, 0]))
    assert viewer.texts == [(None, None, "speed", "1 m/s")]


def test_start_again_does_not_shift_the_end(opened):
    session = _make_session()
    restarts = iter([False, True])

    class Restless(Gamepad):
        def steer(self, session: Session) -> None:
            if next(restarts, False):
                session.restart()

    watch(session, 10, dict, gamepad=Restless(_Pad(), print))
    assert session.steps == 9
    assert len(opened[0].places) == 10
