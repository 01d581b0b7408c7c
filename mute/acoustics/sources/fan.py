"""The cooling fan: stationary noise of the level that the paper measured on a robot at rest.

55 dB(A) at the microphone on the trunk; from elsewhere 1/r. The band is chosen.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mute.acoustics.contacts import ContactBlock
from mute.acoustics.metering.levels import P_REF
from mute.acoustics.microphone import TRUNK_OFFSET, distance
from mute.acoustics.sources.band_noise import BandNoise, band_a_weight

__all__ = ["FAN_BAND", "FAN_LEVEL", "Fan", "fan_squares"]

FAN_LEVEL = 55.0
"""Of the robot at rest at the trunk's microphone, dB(A) (the paper, noise reduction)."""

FAN_BAND = (200.0, 2000.0)
"""Edges of the noise, Hz (chosen: a small axial fan)."""


def fan_squares(block: ContactBlock, microphone: NDArray) -> NDArray:
    """Return the A-weighted mean square pressure of the fan, Pa^2. Shape: (steps, robots).

    Args:
        block: Physics.
        microphone: Where it is, m. Shape: (steps, robots, 3).
    """
    reference = float(np.linalg.norm(TRUNK_OFFSET))
    near = P_REF**2 * 10.0 ** (FAN_LEVEL / 10.0)
    return near * (reference / distance(block.trunk_pos, microphone)) ** 2


class Fan:
    """The sound of the fan, streamed."""

    def __init__(self, num_robots: int, sample_rate: int, seed: tuple[int, ...]) -> None:
        """Prepare the noise.

        Args:
            num_robots: Number of robots.
            sample_rate: Hz.
            seed: Of the noise.
        """
        self._noise = BandNoise((FAN_BAND,), num_robots, sample_rate, seed)
        self._weight = band_a_weight(FAN_BAND, sample_rate)

    def render(self, block: ContactBlock, microphone: NDArray, bounds: NDArray) -> NDArray:
        """Return the block's pressure, Pa. Shape: (robots, samples).

        Args:
            block: Physics.
            microphone: Where it is, m. Shape: (steps, robots, 3).
            bounds: Sample at which each step begins, and the end of the last. Shape: (steps + 1,).
        """
        return self._noise.render([fan_squares(block, microphone) / self._weight], bounds)
