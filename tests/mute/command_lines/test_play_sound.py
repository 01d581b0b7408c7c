"""`play.py --sound` is refused where nothing can be heard, and says how the playing went."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray
from standing import Standing

from mute.acoustics.audible_env import audible_cfg
from mute.acoustics.microphone import Microphone
from mute.acoustics.soundscape import SOURCES
from mute.command_lines.play import PlayArgs, main
from mute.command_lines.play_sound import check_sound, played_aloud
from mute.controllers.command import Command
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.evaluation.session import Session
from mute.evaluation.trials import evaluation_cfg
from mute.live.speakers import Play
from mute.support.errors import MuteError


@pytest.mark.parametrize(
    "words", [("--viewer", "none"), ("--video", "walk.mp4"), ("--viewer", "none", "--json")]
)
def test_a_walk_that_nobody_watches_is_not_played(words):
    with pytest.raises(
        MuteError, match="--sound plays a walk that is watched, so not with --video"
    ):
        main(["--sound", *words])


def test_a_walk_without_a_window_is_not_played(monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(MuteError, match="--sound plays a walk while it is watched, and no window"):
        main(["--sound", "--policy", "nothing.pt"])


def test_a_machine_that_cannot_play_is_told_before_anything_else(monkeypatch):
    monkeypatch.setitem(sys.modules, "sounddevice", None)
    with pytest.raises(MuteError, match=r"pip install 'mute\[sound\]'"):
        check_sound(True)

    class NoDeviceError(Exception):
        pass

    def query_devices(kind: str) -> None:
        raise NoDeviceError

    library = SimpleNamespace(PortAudioError=NoDeviceError, query_devices=query_devices)
    monkeypatch.setitem(sys.modules, "sounddevice", library)
    with pytest.raises(MuteError, match="this machine has no device"):
        check_sound(True)


def test_a_walk_that_is_heard_is_on_a_floor():
    assert PlayArgs(sound=True).floor == "wood"
    assert PlayArgs(sound=True, surface="tile").floor == "tile"
    assert PlayArgs().floor is None


class _Output:
    """An output that asks for a control step's samples when it is told to."""

    latency = 0.02

    def __init__(self) -> None:
        self.heard: list[NDArray[np.float32]] = []
        self._play: Play | None = None
        self.closed = False

    def open(self, sample_rate: int, play: Play) -> _Output:
        self._play, self._frames = play, sample_rate // 50
        return self

    def pull(self) -> None:
        assert self._play is not None
        out = np.zeros(self._frames, dtype=np.float32)
        self._play(out, False)
        self.heard.append(out)

    def stop(self) -> None:
        pass

    def close(self) -> None:
        self.closed = True


def _session() -> Session:
    cfg = evaluation_cfg(QuadrupedEnvCfg(num_threads=1), 1, seconds=60.0, seed=0)
    return Session(QuadrupedEnv(audible_cfg(cfg, "tile")), Standing(), Command(0.0, 0.0, 0.0, 0.5))


def test_a_walk_is_played_step_by_step_and_told_of_at_the_end(capsys):
    session, output = _session(), _Output()
    with played_aloud(session, "tile", 0, Microphone(), SOURCES, output.open):
        for _ in range(20):
            session.step()
            output.pull()
    session.step()
    assert not session.followers
    assert output.closed
    assert np.count_nonzero(np.concatenate(output.heard)) > 15 * 960
    line = capsys.readouterr().err
    assert line == "loudspeakers: heard 60 ms after it was walked\n"


def test_an_interrupt_closes_the_output_and_is_told_of_too(capsys):
    session, output = _session(), _Output()
    with (
        pytest.raises(KeyboardInterrupt),
        played_aloud(session, "tile", 0, Microphone(), ("fan",), output.open),
    ):
        session.step()
        raise KeyboardInterrupt
    assert output.closed
    assert not session.followers
    assert capsys.readouterr().err.startswith("loudspeakers: nothing was heard")
