"""Where the files are that come with the package: the robot, policies, courses, the calibration."""

from __future__ import annotations

from pathlib import Path

__all__ = ["RESOURCES"]

RESOURCES = (Path(__file__).parents[1] / "resources").resolve()
"""Directory of the resources; in a checkout, the one at its top."""
