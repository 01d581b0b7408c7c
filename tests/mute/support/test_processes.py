"""Tests of work in a process of its own."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys

import pytest
from places import REPOSITORY

from mute.support.errors import MuteError
from mute.support.processes import call_apart, peak_memory_mb

_PEAKS = """
from mute.support.processes import peak_memory_mb
before = peak_memory_mb()
held = bytearray(200 << 20)
print(before, peak_memory_mb())
"""

_PROGRAM = """
import os
import signal
import sys
import threading

from mute.support.errors import run_cli
from mute.support.processes import call_apart

def work(seconds):
    print("working", os.getpid(), flush=True)
    threading.Event().wait(seconds)
    return seconds

if __name__ == "__main__":
    run_cli(lambda: print("result", call_apart(work, float(sys.argv[1]))))
"""


def _start(folder, seconds: str) -> subprocess.Popen[str]:
    """Start a program that works apart, in a session that takes Ctrl-C as in a terminal."""
    program = folder / "program.py"
    program.write_text(_PROGRAM)
    previous = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        return subprocess.Popen(
            [sys.executable, str(program), seconds],
            env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
    finally:
        signal.signal(signal.SIGINT, previous)


def test_it_returns_what_the_function_returns():
    assert call_apart(math.fmod, 7.0, 4.0) == 3.0


def test_what_fails_is_told_in_one_line():
    with pytest.raises(MuteError) as caught:
        call_apart(math.sqrt, -1.0)
    assert str(caught.value) == "the measurement failed: math domain error"


def test_a_process_that_is_killed_is_told_in_one_line():
    with pytest.raises(MuteError, match=r"^the measurement failed: .*terminated abruptly[^\n]*$"):
        call_apart(signal.raise_signal, signal.SIGKILL)


def test_the_environment_reaches_the_process(monkeypatch):
    monkeypatch.setenv("OMP_WAIT_POLICY", "passive")
    assert call_apart(os.getenv, "OMP_WAIT_POLICY") == "passive"


def test_its_peak_of_memory_is_that_of_the_work_alone():
    mine = bytearray(300 << 20)
    assert call_apart(peak_memory_mb) < 0.7 * peak_memory_mb()
    assert len(mine) > 0


def test_a_function_of_the_program_itself_runs_and_what_it_prints_is_no_output(tmp_path):
    process = _start(tmp_path, "0")
    out, errors = process.communicate(timeout=120)
    assert (process.returncode, out) == (0, "result 0.0\n")
    assert errors.startswith("working ")


def test_ctrl_c_ends_the_work_in_one_line(tmp_path):
    process = _start(tmp_path, "1000")
    assert process.stderr is not None
    child = int(process.stderr.readline().split()[1])
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=120)
    assert (process.returncode, errors) == (130, "interrupted\n")
    with pytest.raises(ProcessLookupError):
        os.kill(child, 0)


def test_the_work_ends_where_nobody_waits_for_it_any_more(tmp_path):
    process = _start(tmp_path, "1000")
    assert process.stderr is not None
    process.stderr.readline()
    process.kill()
    process.communicate(timeout=120)  # until the work, which has the same streams, is gone too
    assert process.returncode == -signal.SIGKILL


def test_the_peak_of_memory_is_the_processs_own_in_megabytes():
    mine = bytearray(300 << 20)  # what starts a process is larger than it
    command = [sys.executable, "-c", _PEAKS]
    run = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=True)
    before, after = map(float, run.stdout.split())
    assert len(mine) > 0
    assert 1.0 < before < 100.0
    assert after - before == pytest.approx(200.0, abs=20.0)
