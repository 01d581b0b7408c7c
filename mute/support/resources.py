"""Where the files are that come with the package: the robot, policies, courses, the calibration."""

from __future__ import annotations

from pathlib import Path

__all__ = ["RESOURCES", "shipped_file"]

RESOURCES = (Path(__file__).parents[1] / "resources").resolve()
"""Directory of the resources; in a checkout, the one at its top."""


def shipped_file(task: str, suffix: str = ".pt") -> Path:
    """Return where the policy of a task is that comes with the package, whether or not one does.

    Args:
        task: The task.
        suffix: `.pt`, `.onnx`, or `.json` for its card.
    """
    return RESOURCES / "go1" / f"{task}{suffix}"
