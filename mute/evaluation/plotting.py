"""matplotlib, tried before there is anything to draw, and the looks that figures share.

Figures go to files and need no backend.
"""

from __future__ import annotations

import os
from typing import Any

from mute.support.errors import MuteError

__all__ = ["COLOURS", "STYLE", "check_matplotlib"]

STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.hashsalt": "mute",  # the same data make the same file
}
"""Settings of matplotlib's."""

COLOURS = ("#b5482f", "#1f6f8b", "#6a8f3c", "#7b5ea7")
"""What lines and bars are drawn in, one after the other."""


def check_matplotlib() -> None:
    """Import matplotlib, which takes a second.

    Raises:
        MuteError: If MPLBACKEND names no backend, which ends the import though nothing of it is
            used here.
    """
    try:
        import matplotlib  # noqa: F401
    except ValueError as error:
        backend = os.environ.get("MPLBACKEND")
        if not backend:
            raise
        raise MuteError(
            f"MPLBACKEND={backend} is no backend of matplotlib's; unset it, figures go to files"
        ) from error
