"""Tests of how the programs start, each in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from places import REPOSITORY

PROGRAMS = {
    "mute.export": "--policy",
    "mute.acoustics.meter": "--calibration",
    "mute.acoustics.calibration": "--reference",
    "mute.benchmark": "--rollouts",
    "mute.card": "--noise",
    "mute.release": "--checkpoint",
    "mute.web": "--reference",
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


@pytest.mark.parametrize("command", ["sweep-speed", "sweep-beta", "walk"])
def test_a_backend_that_matplotlib_lacks_is_told_before_anything_is_measured(
    command: str, tmp_path: Path
):
    words = ("evaluate.py", command, "--out", str(tmp_path / "out"))
    result = _run(*words, MPLBACKEND="crayons")
    assert (result.returncode, result.stdout) == (2, "")
    assert result.stderr == (
        "error: MPLBACKEND=crayons is no backend of matplotlib's; unset it, figures go to files\n"
    )
    assert not (tmp_path / "out").exists()


def test_a_renderer_that_mujoco_lacks_is_no_matter_where_nothing_is_filmed(tmp_path: Path):
    words = ("play.py", "--viewer", "none", "--seconds", "0.1", "--json")
    result = _run(*words, MUJOCO_GL="crayons")
    assert result.returncode == 0, result.stderr
    assert json.loads(result.stdout)["seconds"] == 0.1
    result = _run(*words, "--video", str(tmp_path / "walk.mp4"), MUJOCO_GL="crayons")
    assert (result.returncode, result.stdout) == (2, "")
    assert result.stderr.startswith("error: --video: MUJOCO_GL=crayons does not render off-screen")
    assert len(result.stderr.splitlines()) == 1
