"""Tests of how the programs start, each in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from places import REPOSITORY

PROGRAMS = {
    "mute.export": "--policy",
    "mute.acoustics.meter": "--calibration",
    "mute.acoustics.calibration": "--reference",
    "mute.benchmark": "--rollouts",
    "mute.card": "--noise",
    "mute.release": "--checkpoint",
}
"""Modules for `python -m`, and an option of each."""


def _run(*arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=REPOSITORY,
        env=os.environ | variables,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize("module", PROGRAMS)
def test_a_program_shows_its_options_in_a_narrow_pipe_that_takes_ascii_alone(module: str):
    result = _run("-m", module, "--help", PYTHONIOENCODING="ascii", LC_ALL="C", COLUMNS="40")
    assert (result.returncode, result.stderr) == (0, "")
    assert PROGRAMS[module] in result.stdout
    options = [line for line in result.stdout.splitlines() if line.startswith(" ")]
    assert max(map(len, options)) <= 40


def test_a_character_that_the_output_lacks_costs_no_figures():
    code = """
import sys
from mute.command_lines import evaluate, entry_points
evaluate.main = lambda: print("59.6\\u00b10.1 dBA")
sys.argv = ["evaluate.py"]
entry_points.evaluate()
"""
    result = _run("-c", code, PYTHONIOENCODING="ascii", LC_ALL="C")
    assert (result.returncode, result.stdout, result.stderr) == (0, "59.6?0.1 dBA\n", "")
