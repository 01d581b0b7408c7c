"""The page on extending MUTE keeps its word: what it shows runs as it stands."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from places import REPOSITORY

from mute.checkpoint import load_checkpoint, save_checkpoint
from mute.evaluation.tables import read_json

PAGE = (REPOSITORY / "docs" / "extending.md").read_text()

RUN = """
import os, shlex, sys
from mute.command_lines import entry_points
for line in sys.argv[1].splitlines():
    words = shlex.split(line)
    if words[0] == "export":
        os.environ.update([words[1].split("=", 1)])
        continue
    sys.argv = words
    try:
        getattr(entry_points, words[0].removeprefix("mute-"))()
    except SystemExit as stop:
        if stop.code:
            sys.exit(stop.code)
"""
"""Runs the lines of a shell in one process, as each would else import torch anew."""


def _blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", PAGE, flags=re.DOTALL | re.MULTILINE)


def _run(commands: str, folder: Path) -> subprocess.CompletedProcess[str]:
    environment = {name: value for name, value in os.environ.items() if name != "MUTE_PLUGINS"}
    return subprocess.run(
        [sys.executable, "-c", RUN, commands],
        cwd=folder,
        env=environment | {"OMP_NUM_THREADS": "1", "PYTHONPATH": str(REPOSITORY)},
        capture_output=True,
        text=True,
        timeout=280,
    )


@pytest.fixture(scope="module")
def followed(tmp_path_factory) -> tuple[Path, str]:
    """Follow the page in an empty folder, from the module to the last command."""
    folder = tmp_path_factory.mktemp("extending")
    (folder / "my_robots.py").write_text("\n".join(_blocks("python")))
    (commands,) = _blocks("sh")
    result = _run(commands, folder)
    assert result.returncode == 0, result.stderr
    return folder, result.stdout + result.stderr


def test_the_new_task_is_learnt_with_the_new_term_and_goes_on(followed):
    run = followed[0] / "runs" / "narrow_walk" / "first"
    saved = load_checkpoint(run / "model_1.pt")
    assert saved["task"] == "narrow_walk"
    assert saved["config"]["env"]["commands"]["lin_vel_x"] == [-0.3, 0.3]
    assert saved["config"]["env"]["rewards"]["terms"]["wide_stance"] == {
        "function": "wide_stance",
        "weight": -0.05,
        "group": "lift",
        "params": {"width": 0.2},
    }
    lines = (run / "curves.jsonl").read_text().splitlines()
    assert len(lines) == 2
    assert all('"Reward/wide_stance"' in line for line in lines)


def test_what_was_learnt_is_played_on_the_new_floor(followed):
    header = "narrow_walk, iteration 0: beta 0.5, asked for 0.5 m/s forward, 0 m/s left, 0 rad/s"
    assert f"{header}, on cork" in followed[1]


def test_a_walk_is_heard_on_the_new_floor_softer_than_on_wood(followed):
    rows = read_json(followed[0] / "evaluation" / "noise.json")
    levels = {(row["surface"], row["beta"]): row["laeq_impacts"] for row in rows}
    assert set(levels) == {(name, beta) for name in ("wood", "cork") for beta in (0.0, 1.0)}
    assert 40.0 < levels["cork", 0.0] < levels["wood", 0.0] - 3.0


@pytest.mark.parametrize("block", _blocks("python"))
def test_each_thing_takes_about_ten_lines(block):
    lines = [line for line in block.splitlines() if line and not line.startswith("#")]
    assert len([line for line in lines if not re.match("from|import", line)]) <= 10


def test_the_task_in_a_checkpoint_imports_nothing(followed, tmp_path):
    saved = load_checkpoint(followed[0] / "runs" / "narrow_walk" / "first" / "model_0.pt")
    policy = tmp_path / "model_0.pt"
    save_checkpoint(policy, saved | {"task": "my_robots:narrow_walk"})
    (tmp_path / "my_robots.py").write_text("raise SystemExit('imported')")
    result = _run(f"mute-play --policy {policy} --seconds 1 --viewer none", tmp_path)
    assert result.returncode == 2
    (line,) = result.stderr.splitlines()
    assert line.startswith("error: ")
    for words in ("model_0.pt", "'wide_stance'", "MUTE_PLUGINS"):
        assert words in line
