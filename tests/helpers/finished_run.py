"""A training of three iterations, and what tests read of a run."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from training_process import TINY

from mute.command_lines import train
from mute.support.errors import run_cli

THREE_ITERATIONS = (
    *("--plain", "--task", "go1_mute", "--num-envs", "32", "--iterations", "3", "--seed", "5"),
    *("--env.rewards.k", "0.3", "--agent.estimation.network.lstm-hidden", "24"),
    *("--env.rewards.quiet-ramp", "0.0", "1.0", "--agent.save-interval", "2"),
    *("--agent.noise-interval", "2", "--run-name", "a"),
)
"""Options of a training that saves its iterations 0 and 2."""


def exit_status(program: Callable[[], int]) -> int:
    """Run a command line in this process as its script would, and return its exit status."""
    with pytest.raises(SystemExit) as stop:
        run_cli(program)
    assert isinstance(stop.value.code, int)
    return stop.value.code


def train_tiny(*arguments: str) -> int:
    """Train tiny networks in this process and return the exit status."""
    return exit_status(lambda: train.main([*TINY, *arguments]))


def curves(run: Path) -> list[dict[str, float]]:
    """Return the scalars of each iteration."""
    return [json.loads(line) for line in (run / "curves.jsonl").read_text().splitlines()]


def tensorboard(run: Path) -> EventAccumulator:
    """Return all that TensorBoard would show of a run."""
    return EventAccumulator(str(run), size_guidance={"scalars": 0}).Reload()


def is_one_line(text: str) -> bool:
    """Tell whether an error is told in one line, and nothing else is."""
    return text.startswith("error: ") and text.count("\n") == 1 and text.endswith("\n")


def contents(run: Path) -> dict[Path, bytes]:
    """Return the files of a run with what they hold."""
    return {path: path.read_bytes() for path in run.glob("*.*")}
