"""The shell's filter, made once for each sample rate."""

from __future__ import annotations

from functools import cache

import numpy as np

from mute.acoustics.body import SHELL, SHELL_PANELS
from mute.acoustics.sources.response import PlateResponse

__all__ = ["NUM_FEET", "SIDES", "shell_response"]

NUM_FEET = 4
"""Each shakes the shell at a place of its own."""

SIDES = np.array([1.0, -1.0, 1.0, -1.0])
"""Which way each foot moves the shell: those of the right one way, those of the left the other.

Nobody knows the phase that a leg leaves. So what floor and shell make of a landing adds up as
energies do over a stride, and so do the landings of a diagonal. Shape: (feet,)."""


@cache
def shell_response(sample_rate: int) -> PlateResponse:
    """Return the shell's filter."""
    return PlateResponse(SHELL, sample_rate, "body", SHELL_PANELS)
