"""When a training first walks: its checkpoints measured one after the other."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from mute.checkpoint import CheckpointError, load_checkpoint
from mute.learning.saved_state import check_totals

__all__ = ["Milestone", "checkpoints_of", "training_minutes", "walks"]

_MAX_ERROR = 0.05
_MAX_FALLS = 0.01


@dataclass
class Milestone:
    """A checkpoint of a run and how it walks."""

    iteration: int
    """Last finished iteration."""
    steps: int
    """Control steps of all robots until then."""
    minutes: float
    """Time trained until then, min."""
    velocity_error_sq: float
    """Mean of |v_xy^cmd - v_xy|^2 over the command range, (m/s)^2."""
    fall_rate: float
    """Share of the trials with a fall."""
    walks: bool
    """Whether that is a walk: error below 0.05 (m/s)^2, falls below 1 %."""


def checkpoints_of(run_dir: Path) -> list[Path]:
    """Return a run's checkpoints in the order of their iterations.

    Raises:
        CheckpointError: If there is none.
    """
    found = run_dir.glob("model_*.pt")
    numbered = [path for path in found if path.stem.removeprefix("model_").isdigit()]
    if not numbered:
        raise CheckpointError(f"no checkpoint in {run_dir}")
    return sorted(numbered, key=lambda path: int(path.stem.removeprefix("model_")))


def training_minutes(path: Path) -> float:
    """Return how long a checkpoint had been trained, min.

    Raises:
        CheckpointError: If it holds a policy only.
    """
    checkpoint = load_checkpoint(path)
    if "logger" not in checkpoint:
        raise CheckpointError(f"{path} holds a policy only, not a training")
    try:
        check_totals(checkpoint)
    except ValueError as error:
        raise CheckpointError(f"{path} holds no training: {error}") from error
    return checkpoint["logger"]["total_time"] / 60.0


def walks(velocity_error_sq: float, fall_rate: float) -> bool:
    """Return whether figures over the command range are those of a walk."""
    return velocity_error_sq < _MAX_ERROR and fall_rate < _MAX_FALLS
