"""Tests of the ffmpeg that writes films."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from mute.command_lines import evaluate, play
from mute.rendering.encoder import ffmpeg_program
from mute.support.errors import MuteError


def test_the_ffmpeg_that_is_found_encodes_films(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delenv("IMAGEIO_FFMPEG_EXE", raising=False)
    found = ffmpeg_program()
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", found)
    assert ffmpeg_program() == found


def test_a_program_that_is_not_there_is_blamed_on_the_variable_that_names_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    program = tmp_path / "absent"
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(program))
    told = f"^--video: IMAGEIO_FFMPEG_EXE={program} cannot be run: No such file or directory; unset"
    with pytest.raises(MuteError, match=told):
        ffmpeg_program()


def test_a_program_without_the_encoders_is_told_with_what_it_lacks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    program = tmp_path / "ffmpeg"
    program.write_text("#!/bin/sh\necho ' A....D aac  AAC'\n")
    program.chmod(0o755)
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(program))
    with pytest.raises(MuteError, match=f"EXE={program} is no ffmpeg that encodes libx264; unset"):
        ffmpeg_program()


@pytest.mark.parametrize(
    ("main", "words"),
    [
        (play.main, ["--seconds", "0.1", "--viewer", "none"]),
        (evaluate.main, ["noise", "--surface", "wood", "--beta", "0", "--trials", "1"]),
    ],
)
def test_a_film_is_refused_before_the_walk_where_nothing_can_write_it(
    main: Callable[[Sequence[str]], int],
    words: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", "/absent")
    with pytest.raises(MuteError, match=r"^--video: IMAGEIO_FFMPEG_EXE=/absent cannot be run"):
        main([*words, "--video", "walk.mp4"])
    assert list(tmp_path.rglob("*.mp4")) == []
