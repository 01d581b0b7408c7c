"""matplotlib, tried before there is anything to draw: figures go to files and need no backend."""

from __future__ import annotations

import os

from mute.support.errors import MuteError

__all__ = ["check_matplotlib"]


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
