"""Levels without the background's energy, and which of them cannot be told from it.

A level L of robot and background together and the background's own Lb leave

    10 lg(10^(L / 10) - 10^(Lb / 10))

for the robot (ISO 3746:2010, 8.3.3). Lb is the background's level in the same third octave, and its
LAeq for LAeq, MNL, PNL, L10, L90 and LAFmax. Each figure is corrected as one number: MNL is that of
the mean of the readings, not the mean of corrected readings, of which those between two steps may
be below the background and have no level.

Less than 3 dB above the background, where the standard gives no more than an upper bound, a figure
is refused: half of the energy or more is the background's, and its changes are what is seen.
"""

from __future__ import annotations

import dataclasses
import math

from mute.acoustics.metering.levels import Levels
from mute.acoustics.metering.third_octaves import ThirdOctaveLevel

__all__ = [
    "CORRECTED",
    "LEAST_DIFFERENCE",
    "levels_without",
    "third_octaves_without",
    "without_background",
]

LEAST_DIFFERENCE = 3.0
"""Smallest difference from the background at which a level is corrected, dB (ISO 3746, 8.3.3)."""

CORRECTED = ("mnl", "pnl", "laeq", "lafmax", "l10", "l90")
"""Figures of `Levels` that are corrected by the background's LAeq."""


def without_background(level: float, background: float) -> float:
    """Return a level without the background's energy; NaN if it cannot be told from it.

    Args:
        level: Of all that was heard, dB; NaN stays NaN.
        background: Of the background alone, dB re the same; minus infinity takes nothing away.
    """
    if background == -math.inf:
        return level
    if not level - background >= LEAST_DIFFERENCE:  # which NaN is not
        return math.nan
    return level + 10.0 * math.log10(-math.expm1((background - level) * math.log(10.0) / 10.0))


def levels_without(levels: Levels, background: float) -> Levels:
    """Return the figures of a recording without the background's energy.

    Args:
        levels: Of all that was heard.
        background: LAeq of the background alone, dB re the same.
    """
    figures = {name: without_background(getattr(levels, name), background) for name in CORRECTED}
    return dataclasses.replace(levels, **figures)


def third_octaves_without(
    bands: tuple[ThirdOctaveLevel, ...], background: tuple[ThirdOctaveLevel, ...]
) -> tuple[ThirdOctaveLevel, ...]:
    """Return the spectrum of a recording without the background's energy.

    Args:
        bands: Of all that was heard.
        background: Of the background alone, the same bands. Where it was too short to have a level,
            there is none without it.
    """
    return tuple(
        dataclasses.replace(band, level=without_background(band.level, alone.level))
        for band, alone in zip(bands, background, strict=True)
    )
