"""Walks that are kept as sound and as film: what is left of those that end early, or not at all."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from mute.acoustics.files.writing import WavWriter
from mute.acoustics.listener import SAMPLE_RATE, WAV_FULL_SCALE
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.rendering.kept_walks import KeptWalks, filming
from mute.support.errors import MuteError


@pytest.fixture(scope="module")
def env() -> QuadrupedEnv:
    return QuadrupedEnv(QuadrupedEnvCfg(num_envs=2, num_threads=1))


@pytest.fixture(autouse=True)
def _no_pictures(monkeypatch):
    """Films are opened without anything that renders."""
    renderer = SimpleNamespace(close=lambda: None)
    monkeypatch.setattr("mute.rendering.video._make_renderer", lambda model: (renderer, True))


@pytest.mark.parametrize("stopped", [False, True])
def test_what_never_began_leaves_no_file_and_is_told(env, tmp_path, stopped):
    wav, film, notes = tmp_path / "walk.wav", tmp_path / "walk.mp4", []

    wanted = KeptWalks({0: wav}, {0: film}, notes.append)

    def walk():
        with filming(env, wanted, start=1.0) as films:
            WavWriter(films.sounds[0], SAMPLE_RATE, WAV_FULL_SCALE).close()
            films.record()  # of a tenth of the time after which the film begins
            if stopped:
                raise KeyboardInterrupt

    if stopped:
        with pytest.raises(KeyboardInterrupt):
            walk()
    else:
        walk()
    assert notes == [
        f"{wav} is not written: the walk ended before its sound began",
        f"{film} is not written: the walk ended before it began",
    ]
    assert (list(tmp_path.iterdir()), wanted.kept) == ([], [])


def test_a_second_film_that_cannot_be_made_leaves_nothing_of_the_first(env, tmp_path):
    (tmp_path / "file").write_text("")
    first, second, notes = tmp_path / "first.mp4", tmp_path / "file" / "second.mp4", []
    wanted = filming(env, KeptWalks({}, {0: first, 1: second}, notes.append), start=1.0)
    with pytest.raises(MuteError, match=r"--video: cannot write .*second\.mp4"), wanted:
        pass
    assert list(tmp_path.iterdir()) == [tmp_path / "file"]
    assert notes == []
