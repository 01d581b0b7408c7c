"""Feet that slide: band noise whose amplitude goes with the square root of the friction power.

A fixed share eta of the friction power P is radiated, so the mean square pressure is
p^2 = g^2 rho c eta P / (2 pi r^2), with the floor's calibration gain g. Feet are incoherent: their
mean squares add. The delay r/c of a few milliseconds is left out here and in the other noises, as
noise has no shape that it would move.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mute.acoustics.contacts import ContactBlock
from mute.acoustics.floors import Floor
from mute.acoustics.microphone import distance, mean_square
from mute.acoustics.sources.band_noise import BandNoise

__all__ = ["Scuffing", "radiated_shares", "sliding_squares"]


def sliding_squares(block: ContactBlock, microphone: NDArray) -> NDArray[np.float64]:
    """Return the mean square pressure if all friction power were radiated, by foot, Pa^2.

    Args:
        block: Physics.
        microphone: Where it is, m. Shape: (steps, robots, 3).

    Returns:
        rho c P / (2 pi r^2). Shape: (steps, robots, 4).
    """
    apart = distance(block.foot_pos, microphone[:, :, None])
    return mean_square(np.asarray(block.friction_power, dtype=np.float64), apart)


def radiated_shares(floors: tuple[Floor, ...], gains: NDArray) -> NDArray[np.float64]:
    """Return g^2 eta, what of the mean square is heard on each floor. Shape: (floors,)."""
    return np.square(gains) * [floor.scuff_efficiency for floor in floors]


class Scuffing:
    """The sound of sliding feet, streamed."""

    def __init__(
        self,
        num_robots: int,
        floors: tuple[Floor, ...],
        gains: NDArray,
        sample_rate: int,
        seed: tuple[int, ...],
    ) -> None:
        """Prepare a noise for each floor.

        Args:
            num_robots: Number of robots.
            floors: The recording's floors.
            gains: Calibration gain of each floor. Shape: (floors,).
            sample_rate: Hz.
            seed: Of the noise.
        """
        bands = tuple(floor.scuff_band for floor in floors)
        self._noise = BandNoise(bands, num_robots, sample_rate, seed)
        self._shares = radiated_shares(floors, gains)

    def render(self, block: ContactBlock, microphone: NDArray, bounds: NDArray) -> NDArray:
        """Return the block's pressure, Pa. Shape: (robots, samples).

        Args:
            block: Physics.
            microphone: Where it is, m. Shape: (steps, robots, 3).
            bounds: Sample at which each step begins, and the end of the last. Shape: (steps + 1,).
        """
        heard = sliding_squares(block, microphone)
        squares = [
            share * np.where(block.floor == floor, heard, 0.0).sum(axis=2)
            for floor, share in enumerate(self._shares)
        ]
        return self._noise.render(squares, bounds)
