"""Real time: when the next control step of a walk that is watched is due."""

from __future__ import annotations

import time

__all__ = ["wait_until"]

_MAX_LAG = 0.1
"""Lag behind real time from which on it is given up to catch up, s."""


def wait_until(due: float) -> float:
    """Sleep until a time of `time.perf_counter` and return it.

    Where it is too far in the past, return the present: what was lost is not made up for.
    """
    now = time.perf_counter()
    if now < due:
        time.sleep(due - now)
        return due
    return due if now - due < _MAX_LAG else now
