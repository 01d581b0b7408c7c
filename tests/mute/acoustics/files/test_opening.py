"""Tests of recordings that come through a pipe."""

from __future__ import annotations

import contextlib
import os
import threading
from pathlib import Path

import numpy as np
import pytest
from wav_helpers import RATE, integers, packed, tone, wav_bytes

from mute.acoustics.files import opening
from mute.acoustics.files.reading import read_wav
from mute.support.errors import MuteError

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
CONTENT = wav_bytes(1, 16, packed(integers(tone(0.1), 16), 2), rate=RATE, promised=0xFFFFFFFF)


@pytest.fixture
def pipe(tmp_path):
    """A function that sends bytes through a named pipe and returns its path."""
    path = tmp_path / "pipe"
    os.mkfifo(path)
    threads = []

    def send(content: bytes) -> Path:
        def write() -> None:
            with contextlib.suppress(BrokenPipeError):  # the reader has had enough
                path.write_bytes(content)

        threads.append(threading.Thread(target=write))
        threads[-1].start()
        return path

    yield send
    for thread in threads:
        thread.join()


def test_a_recording_through_a_pipe_is_read_to_its_end(pipe):
    samples, rate = read_wav(pipe(CONTENT))
    assert rate == RATE
    np.testing.assert_allclose(samples, [tone(0.1)], atol=2.0**-16)


def test_a_pipe_that_begins_otherwise_is_refused_before_it_ends(pipe, monkeypatch):
    monkeypatch.setattr(opening, "_MOST_PIPED", 100)  # which would be told instead
    with pytest.raises(MuteError, match="not a WAV file"):
        read_wav(pipe(b"The robot was loud.\n" * 100))


@pytest.mark.parametrize("content", [b"", CONTENT[:3]])
def test_a_pipe_that_ends_at_once_is_refused_in_one_line(pipe, content):
    with pytest.raises(MuteError, match=r"empty file|not a WAV file"):
        read_wav(pipe(content))


def test_a_pipe_without_end_is_refused(pipe, monkeypatch):
    monkeypatch.setattr(opening, "_MOST_PIPED", len(CONTENT) - 1)
    with pytest.raises(MuteError, match=rf"more than {len(CONTENT) - 1} bytes"):
        read_wav(pipe(CONTENT))


def test_a_disk_without_room_for_a_pipe_is_told_in_one_line(pipe, monkeypatch, tmp_path):
    monkeypatch.setattr(opening.tempfile, "tempdir", str(tmp_path / "nowhere"))
    with pytest.raises(MuteError, match="cannot be read through: No such file or directory"):
        read_wav(pipe(CONTENT))
