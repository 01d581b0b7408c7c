"""Feet that slide: band noise whose amplitude goes with the square root of the friction power.

A share eta of the friction power P is radiated, so that the mean square pressure is
p^2 = rho c eta P / (2 pi r^2). Rough surfaces that rub are heard as noise of a wide band whose
amplitude rises with about the 3/4 power of the speed (Dang et al., on the influence of the sliding
speed on roughness noise, 2019), so with its power as P does within a decibel and a half for twice
the speed. Of eta there is no figure for rubber: 5e-7 is assumed, amid the 1e-7 to 1e-6 of their
mechanical power that ordinary machines radiate. Feet are incoherent: their mean squares add. The
delay r/c of a few milliseconds is left out here and of the fan, as noise has no shape that it would
move.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mute.acoustics.contacts import ContactBlock
from mute.acoustics.microphone import distance, mean_square
from mute.acoustics.sources.band_noise import BandNoise

__all__ = ["SCUFF_BAND", "SCUFF_EFFICIENCY", "Scuffing", "scuffing_power", "scuffing_squares"]

SCUFF_BAND = (300.0, 6000.0)
"""Edges of the noise, Hz (assumed)."""

SCUFF_EFFICIENCY = 5e-7
"""Radiated sound power over friction power (assumed, see above)."""


def scuffing_power(block: ContactBlock) -> NDArray[np.float64]:
    """Return the sound power of sliding feet, W. Shape: (steps, robots)."""
    return SCUFF_EFFICIENCY * np.asarray(block.friction_power, dtype=np.float64).sum(axis=2)


def scuffing_squares(block: ContactBlock, microphone: NDArray) -> NDArray[np.float64]:
    """Return the mean square pressure of sliding feet, Pa^2. Shape: (steps, robots).

    Args:
        block: Physics.
        microphone: Where it is, m. Shape: (steps, robots, 3).
    """
    apart = distance(block.foot_pos, microphone[:, :, None])
    power = SCUFF_EFFICIENCY * np.asarray(block.friction_power, dtype=np.float64)
    return mean_square(power, apart).sum(axis=2)


class Scuffing:
    """The sound of sliding feet, streamed."""

    def __init__(self, num_robots: int, sample_rate: int, seed: tuple[int, ...]) -> None:
        """Prepare the noise.

        Args:
            num_robots: Number of robots.
            sample_rate: Hz.
            seed: Of the noise.
        """
        self._noise = BandNoise((SCUFF_BAND,), num_robots, sample_rate, seed)

    def render(self, block: ContactBlock, microphone: NDArray, bounds: NDArray) -> NDArray:
        """Return the block's pressure, Pa. Shape: (robots, samples).

        Args:
            block: Physics.
            microphone: Where it is, m. Shape: (steps, robots, 3).
            bounds: Sample at which each step begins, and the end of the last. Shape: (steps + 1,).
        """
        return self._noise.render([scuffing_squares(block, microphone)], bounds)
