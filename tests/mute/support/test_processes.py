"""Tests of work in a process of its own."""

from __future__ import annotations

import subprocess
import sys

import pytest
from places import REPOSITORY

from mute.support.errors import MuteError
from mute.support.processes import call_apart

_PEAKS = """
from mute.support.processes import peak_memory_mb
before = peak_memory_mb()
held = bytearray(200 << 20)
print(before, peak_memory_mb())
"""


def test_what_fails_is_told():
    with pytest.raises(MuteError, match=r"(?s)the measurement failed: .*no_such_function"):
        call_apart("json", "no_such_function", 1)


def test_the_peak_of_memory_is_the_processs_own_in_megabytes():
    mine = bytearray(300 << 20)  # what starts a process is larger than it
    command = [sys.executable, "-c", _PEAKS]
    run = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=True)
    before, after = map(float, run.stdout.split())
    assert len(mine) > 0
    assert 1.0 < before < 100.0
    assert after - before == pytest.approx(200.0, abs=20.0)
