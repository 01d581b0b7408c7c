"""Streams whose reader goes away: commands end quietly, and work that keeps files goes on."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from places import REPOSITORY

_PROGRAM = """
import sys
from pathlib import Path
from mute.support.errors import run_cli
from mute.support.streams import patient_output

def quick():
    for number in range(100_000):
        print("line", number)

def patient():
    with patient_output():
        for number in range(100_000):
            print("line", number, flush=True)
        Path(sys.argv[2]).write_text("whole")

def numbers():
    print([Path(sys.argv[2]).open("w").fileno() > 2, sys.stdout is not None], file=sys.stderr)

run_cli(globals()[sys.argv[1]])
"""


def _run(
    name: str, path: Path | str = "", output: int | None = None, shell: str = ""
) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", _PROGRAM, name, str(path)]
    if shell:
        command = ["sh", "-c", f'exec "$@" {shell}', "sh", *command]
    return subprocess.run(
        command, cwd=REPOSITORY, stdout=output, stderr=subprocess.PIPE, text=True, timeout=60
    )


@pytest.fixture
def closed_pipe():
    reader, writer = os.pipe()
    os.close(reader)
    yield writer
    os.close(writer)


def test_a_command_ends_quietly_where_its_reader_is_gone(closed_pipe):
    run = _run("quick", output=closed_pipe)
    assert (run.returncode, run.stderr) == (141, "")


def test_work_that_keeps_files_goes_on_where_its_reader_is_gone(tmp_path, closed_pipe):
    run = _run("patient", tmp_path / "file", closed_pipe)
    assert (run.returncode, run.stderr) == (0, "")
    assert (tmp_path / "file").read_text() == "whole"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
def test_output_that_finds_a_full_disk_is_told_in_one_line(tmp_path):
    with open("/dev/full", "w") as full:
        run = _run("quick", output=full.fileno())
        assert run.returncode == 2
        assert run.stderr == "error: cannot write the output: No space left on device\n"
        run = _run("patient", tmp_path / "file", full.fileno())
    assert run.returncode == 0
    assert run.stderr == "warning: cannot write standard output: No space left on device\n"
    assert (tmp_path / "file").read_text() == "whole"


def test_a_stream_that_was_closed_from_the_start_takes_no_files_number(tmp_path):
    run = _run("numbers", tmp_path / "file", shell="<&- >&-")
    assert (run.returncode, run.stderr) == (0, "[True, True]\n")
