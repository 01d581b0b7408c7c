"""Motors and gears: band noise that follows the power and the speed of the joints.

Sound power W = eta sum |tau w| + zeta sum w^2 over the joints; mean square pressure
rho c W / (2 pi r^2) at the distance r from the trunk. The paper gives no figures for it but that it
is minor beside the feet at indoor speeds. All three figures are chosen such that a walk at 0.5 m/s
(some 40 W, 2 rad/s a joint) gives about the level of the fan, and none of them is calibrated.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mute.acoustics.contacts import ContactBlock
from mute.acoustics.microphone import distance, mean_square
from mute.acoustics.sources.band_noise import BandNoise

__all__ = ["DRIVE_BAND", "Drive", "drive_squares"]

DRIVE_BAND = (300.0, 3000.0)
"""Edges of the noise, Hz (chosen)."""

POWER_EFFICIENCY = 5e-9
"""Sound power over mechanical power, eta (chosen)."""

SPEED_NOISE = 2e-9
"""Sound power of gears that run idle over the square of the joint speed, zeta, W s^2 (chosen)."""


def drive_squares(block: ContactBlock, microphone: NDArray) -> NDArray:
    """Return the mean square pressure of motors and gears, Pa^2. Shape: (steps, robots).

    Args:
        block: Physics.
        microphone: Where it is, m. Shape: (steps, robots, 3).
    """
    power = np.asarray(block.joint_power, dtype=np.float64).sum(axis=2)
    speed = np.asarray(block.joint_speed, dtype=np.float64)
    radiated = POWER_EFFICIENCY * power + SPEED_NOISE * np.square(speed).sum(axis=2)
    return mean_square(radiated, distance(block.trunk_pos, microphone))


class Drive:
    """The sound of motors and gears, streamed."""

    def __init__(self, num_robots: int, sample_rate: int, seed: tuple[int, ...]) -> None:
        """Prepare the noise.

        Args:
            num_robots: Number of robots.
            sample_rate: Hz.
            seed: Of the noise.
        """
        self._noise = BandNoise((DRIVE_BAND,), num_robots, sample_rate, seed)

    def render(self, block: ContactBlock, microphone: NDArray, bounds: NDArray) -> NDArray:
        """Return the block's pressure, Pa. Shape: (robots, samples).

        Args:
            block: Physics.
            microphone: Where it is, m. Shape: (steps, robots, 3).
            bounds: Sample at which each step begins, and the end of the last. Shape: (steps + 1,).
        """
        return self._noise.render([drive_squares(block, microphone)], bounds)
