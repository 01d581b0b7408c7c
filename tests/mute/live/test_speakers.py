"""Loudspeakers play a walk as it is, in time, and say what is missing before it begins."""

from __future__ import annotations

import sys
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest
import soundfile
from numpy.typing import NDArray
from places import SHIPPED_POLICY

from mute.acoustics.audible_env import audible_cfg
from mute.acoustics.live_sound import LiveSound
from mute.acoustics.metering.sound_level_meter import SoundLevelMeter, measure
from mute.acoustics.metering.wav_levels import open_wav
from mute.controllers import load_policy
from mute.controllers.command import Command
from mute.envs.quadruped_env import QuadrupedEnv
from mute.evaluation.session import Session
from mute.evaluation.trials import evaluation_cfg, from_the_stance
from mute.live import speakers as speakers_module
from mute.live.loudness import FULL_SCALE, Loudness
from mute.live.speakers import Play, Speakers, check_default_output, open_default_output
from mute.support.errors import MuteError

RATE = 48000


class Output:
    """An output that plays when it is told to, and keeps what it was given."""

    latency = 0.025

    def __init__(self) -> None:
        self.given: list[NDArray[np.float32]] = []
        self.calls: list[str] = []
        self._play: Play | None = None

    def open(self, sample_rate: int, play: Play) -> Output:
        assert sample_rate == RATE
        self._play = play
        return self

    def pull(self, frames: int, late: bool = False) -> None:
        assert self._play is not None
        stereo = np.full((frames, 2), np.nan, dtype=np.float32)
        self._play(stereo[:, 0], late)  # a part of what a device has, and not in one piece
        self.given.append(stereo[:, 0].copy())

    def stop(self) -> None:
        self.calls.append("stop")
        self.pull(4800)

    def close(self) -> None:
        self.calls.append("close")


def _walk(surface: str) -> Session:
    policy = load_policy(SHIPPED_POLICY)
    cfg = from_the_stance(evaluation_cfg(policy.cfg.env, 1, 60.0, seed=0))
    env = QuadrupedEnv(audible_cfg(cfg, surface))
    return Session(env, policy.controller(env.cfg), Command(0.6, 0.0, 0.0, 0.5))


def test_a_walk_is_played_whole_and_has_its_level(tmp_path):
    session, output = _walk("carpet"), Output()
    pressure: list[NDArray[np.float32]] = []
    with Speakers(output.open) as speakers:

        def play(block: NDArray[np.float32]) -> None:
            pressure.append(block)
            speakers.play(block)

        session.followers.append(LiveSound(session.env, "carpet", play, RATE))
        for _ in range(200):
            session.step()
            for frames in (256, 512, 192):  # a control step, in blocks of a device
                output.pull(frames)
    assert output.calls == ["stop", "close"]
    assert speakers.gaps == 0
    assert speakers.latency < 0.1
    assert "gaps" not in speakers.summary()
    played = np.concatenate(output.given)
    path = tmp_path / "played.wav"
    soundfile.write(path, played[np.flatnonzero(played)[0] :], RATE, subtype="FLOAT")
    with open_wav(path) as wav:
        heard = np.concatenate([block for block in wav.blocks()], axis=1)[:, : 4 * RATE]
    meter = SoundLevelMeter(RATE)
    meter.update(np.concatenate(pressure)[None])
    expected, found = meter.result()[0], measure(heard * FULL_SCALE, RATE)[0]
    assert expected.mnl > 60.0
    assert found.mnl == pytest.approx(expected.mnl, abs=0.1)
    assert found.laeq == pytest.approx(expected.laeq, abs=0.1)


class _Running(Output):
    """An output that asks by itself, as a device does, until it is stopped."""

    def open(self, sample_rate: int, play: Play) -> _Running:
        super().open(sample_rate, play)
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()
        return self

    def _run(self) -> None:
        while not self._stopped.wait(0.005):
            self.pull(240)

    def stop(self) -> None:
        self._stopped.set()
        self._thread.join()


def test_what_waits_at_the_end_is_played_before_the_output_is_stopped(monkeypatch):
    monkeypatch.setattr(speakers_module, "_LONGEST_END", 30.0)  # a busy machine takes its time
    output = _Running()
    tone = 0.5 * np.sin(0.1 * np.arange(2400))
    with Speakers(output.open) as speakers:
        speakers.play(tone)
    played = np.concatenate(output.given)
    begin = np.flatnonzero(played)[0]
    expected = Loudness(RATE).play(tone)
    np.testing.assert_allclose(played[begin : begin + 2399], expected[1:], atol=1e-6)
    assert speakers.gaps == 0


def test_an_output_that_asks_no_more_is_not_waited_for_long():
    output = Output()
    begin = time.monotonic()
    with Speakers(output.open) as speakers:
        speakers.play(np.ones(2400, dtype=np.float32))
    assert 0.1 < time.monotonic() - begin < 5.0
    assert output.calls == ["stop", "close"]


def test_gaps_are_counted_and_told():
    output = Output()
    with Speakers(output.open) as speakers:
        speakers.play(np.zeros(1920, dtype=np.float32))
        for _ in range(3):
            output.pull(960)
        output.pull(960)
        speakers.play(np.zeros(3840, dtype=np.float32))
        output.pull(960)
        output.pull(960, late=True)
    assert speakers.gaps == 2
    assert "2 gaps of 0.04 s in all" in speakers.summary()


def test_a_device_that_is_late_before_anything_is_played_is_no_gap():
    output = Output()
    with Speakers(output.open) as speakers:
        output.pull(960, late=True)
    assert speakers.gaps == 0


def test_the_output_is_closed_though_a_walk_fails():
    output = Output()
    with pytest.raises(KeyboardInterrupt), Speakers(output.open):
        raise KeyboardInterrupt
    assert output.calls == ["stop", "close"]


# -- sounddevice -----------------------------------------------------------------------------------


class _PortAudioError(Exception):
    pass


class _Library(SimpleNamespace):
    """What is used of sounddevice, on a machine with a device, or with none."""

    PortAudioError = _PortAudioError

    def __init__(self, channels: int = 32, refused: str | None = None) -> None:
        super().__init__()
        self.channels, self.refused = channels, refused
        self.opened: list[dict] = []
        self.started = 0

    def query_devices(self, kind: str) -> dict:
        assert kind == "output"
        if not self.channels:
            raise _PortAudioError("Error querying device -1")
        return {"name": "default", "max_output_channels": self.channels}

    def check_output_settings(self, **settings: object) -> None:
        if self.refused:
            raise _PortAudioError(self.refused)

    def OutputStream(self, **settings: object) -> _Library:  # noqa: N802
        self.check_output_settings()
        self.opened.append(settings)
        return self

    def start(self) -> None:
        self.started += 1


@pytest.fixture
def library(monkeypatch) -> _Library:
    library = _Library()
    monkeypatch.setitem(sys.modules, "sounddevice", library)
    return library


@pytest.mark.parametrize("channels", [1, 2, 32])
def test_the_default_device_plays_on_its_first_two_channels(library, channels):
    library.channels = channels
    check_default_output()
    assert not library.opened
    told: list[bool] = []

    def play(out: NDArray[np.float32], late: bool) -> None:
        told.append(late)
        out[:] = 0.25

    assert open_default_output(RATE, play) is library
    (settings,) = library.opened
    assert library.started == 1
    assert settings["samplerate"] == RATE
    assert settings["channels"] == min(channels, 2)
    out = np.zeros((64, settings["channels"]), dtype=np.float32)
    settings["callback"](out, 64, None, SimpleNamespace(output_underflow=True))
    settings["callback"](out, 64, None, SimpleNamespace(output_underflow=False))
    assert told == [True, False]
    np.testing.assert_array_equal(out, 0.25)


@pytest.mark.parametrize("begin", [check_default_output, Speakers])
def test_a_machine_without_a_device_is_told(library, begin):
    library.channels = 0
    with pytest.raises(MuteError, match=r"^--sound: this machine has no device that plays sound$"):
        begin()


@pytest.mark.parametrize("begin", [check_default_output, Speakers])
def test_a_device_that_refuses_is_told_in_a_line(library, begin):
    library.refused = "Invalid sample rate\n[PaErrorCode -9997]"
    with pytest.raises(MuteError) as told:
        begin()
    expected = "--sound: default does not play: Invalid sample rate [PaErrorCode -9997]"
    assert str(told.value) == expected


@pytest.mark.parametrize("begin", [check_default_output, Speakers])
def test_a_missing_library_is_told_with_what_to_install(monkeypatch, begin):
    monkeypatch.setitem(sys.modules, "sounddevice", None)
    with pytest.raises(
        MuteError, match=r"needs the library sounddevice .*pip install 'mute\[sound"
    ):
        begin()


def test_a_missing_portaudio_is_told_with_what_to_install(monkeypatch, tmp_path):
    (tmp_path / "sounddevice.py").write_text("raise OSError('PortAudio library not found')\n")
    monkeypatch.delitem(sys.modules, "sounddevice", raising=False)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(MuteError, match=r"PortAudio library not found\); .*libportaudio2"):
        check_default_output()
