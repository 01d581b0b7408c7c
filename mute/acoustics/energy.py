"""Levels without audio: the A-weighted energies of the sources, added up at the physics rate.

The cheap path for training curves and levels that are shown live. It knows the same sources as
`soundscape`, and gives what a sound level meter would read at its microphone, from energies alone:

- a landing deposits the A-weighted sound exposure of its response, which goes with the squares of
  speed, mass and 1/r, and with the contact time through a table made once for each floor;
- scuffing, drive and fan have the mean square pressure that their noise is made with, times the
  share that the A-weighting leaves of their band;
- the detector of `levels` turns the energies into Fast readings, as it does with those of sound.

What it leaves out: interference of landings that fall within milliseconds of each other, the few
hundredths of a second over which the sound of a landing is drawn out, and the chance of noise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from mute.acoustics.contacts import ContactBlock
from mute.acoustics.floors import Floor, find_floors
from mute.acoustics.metering.levels import LevelDetector, Levels
from mute.acoustics.metering.weighting import a_weighting_db
from mute.acoustics.microphone import Microphone, distance
from mute.acoustics.soundscape import SOURCES, StepClock, check_sources, floor_gains
from mute.acoustics.sources.band_noise import band_a_weight, filter_response
from mute.acoustics.sources.drive import DRIVE_BAND, drive_squares
from mute.acoustics.sources.fan import fan_squares
from mute.acoustics.sources.impacts import contact_time, floor_modes, pulse_spectrum
from mute.acoustics.sources.scuffing import radiated_shares, sliding_squares

__all__ = ["EnergyMeter", "impact_exposure"]

_RATE = 48000
"""Sample rate whose filters are stood in for, Hz."""

_CHUNK = 2.0
"""Longest stretch that is added up at a time, s."""

_TABLE_MASSES = np.geomspace(0.1, 10.0, 256)
"""Masses of the table, kg; beyond its ends, its ends."""

_TABLE_FREQUENCIES = np.arange(2.0, 12000.0, 2.0)
"""Frequencies of the table's sums, Hz: far beyond the highest mode, and finer than any is wide."""


@cache
def _exposure_table(floor: Floor) -> NDArray[np.float64]:
    """Return the exposure of a landing with unit m v, for `_TABLE_MASSES`.

    E = (1 + e)^2 2 int |P(f)|^2 |sum H_n(f)|^2 A(f)^2 df, with the pulse of unit impulse P.

    Returns:
        Exposure times distance squared, Pa^2 s m^2 / (kg m/s)^2. Shape: (masses,).
    """
    angles = 2.0 * np.pi * _TABLE_FREQUENCIES / _RATE
    response = sum(filter_response(b, a, angles) for b, a in floor_modes(floor, _RATE))
    weighted = np.abs(response) ** 2 * 10.0 ** (a_weighting_db(_TABLE_FREQUENCIES) / 10.0)
    duration = contact_time(_TABLE_MASSES, floor)[:, None]
    pulse = np.abs(pulse_spectrum(_TABLE_FREQUENCIES, duration, floor.restitution))
    width = _TABLE_FREQUENCIES[1] - _TABLE_FREQUENCIES[0]
    return (1.0 + floor.restitution) ** 2 * 2.0 * width * (np.square(pulse) @ weighted)


def impact_exposure(mass: NDArray, floor: Floor) -> NDArray[np.float64]:
    """Return the A-weighted sound exposure of a landing at 1 m/s, heard from 1 m, Pa^2 s.

    It goes with the square of the speed and with 1 / r^2.

    Args:
        mass: Effective mass, kg. Any shape.
        floor: What it falls on.
    """
    mass = np.asarray(mass, dtype=np.float64)
    table = _exposure_table(floor)
    return mass**2 * np.interp(np.log(mass), np.log(_TABLE_MASSES), table)


class EnergyMeter:
    """A sound level meter for every robot, without sound."""

    def __init__(
        self,
        num_robots: int,
        floors: Sequence[str],
        microphone: Microphone | None = None,
        sources: Sequence[str] = SOURCES,
        gains: Mapping[str, float] | None = None,
    ) -> None:
        """Start in silence.

        Args:
            num_robots: Number of robots in each block.
            floors: Names of the recording's floors, in the order of their indices.
            microphone: Where to listen. Default: on the trunk.
            sources: What to hear.
            gains: Calibration gain by floor. Default: 1.

        Raises:
            ValueError: If a floor, a source or a gain is not allowed.
        """
        self._microphone = microphone or Microphone()
        self._floors = find_floors(floors)
        self._gains = floor_gains(floors, gains)
        squares = {
            "impacts": self._landings,
            "scuffing": self._scuffing,
            "drive": self._drive,
            "fan": self._fan,
        }
        self._squares = {name: squares[name] for name in check_sources(sources)}
        self.exposure = {name: np.zeros(num_robots) for name in self._squares}
        """A-weighted sound exposure of each source so far, Pa^2 s. Shape of each: (num_robots,)."""
        self._clock = StepClock(num_robots)
        bands = [band_a_weight(floor.scuff_band, _RATE) for floor in self._floors]
        self._scuff_weights = radiated_shares(self._floors, self._gains) * bands
        self._drive_weight = band_a_weight(DRIVE_BAND, _RATE)
        self._num_robots = num_robots
        self._detector: LevelDetector | None = None

    def update(self, block: ContactBlock) -> None:
        """Add the next block.

        Args:
            block: Physics that follows the last block's.

        Raises:
            ValueError: If the block leaves a gap, is of another number of robots, or its steps are
                no whole number a second.
        """
        self._clock.accept(block)
        rate = round(1.0 / block.timestep)
        if abs(rate * block.timestep - 1.0) > 1e-6:
            raise ValueError(f"timestep must be a whole part of 1 s, got {block.timestep:g} s")
        if self._detector is None:
            self._detector = LevelDetector(rate, self._num_robots)
        chunk = max(1, round(_CHUNK / block.timestep))
        for first in range(0, block.steps, chunk):
            part = block.part(first, first + chunk)
            where = self._microphone.position(part)
            total = np.zeros((part.steps, part.num_robots))
            for name, squares in self._squares.items():
                own = squares(part, where)
                self.exposure[name] += own.sum(axis=0) * block.timestep
                total += own
            self._detector.update(total.T)

    @property
    def detector(self) -> LevelDetector:
        """Where the figures are made; has the readings and the level of now.

        Raises:
            ValueError: If nothing came.
        """
        if self._detector is None:
            raise ValueError("no levels of an empty recording")
        return self._detector

    def result(self) -> list[Levels]:
        """Return the figures of what came so far, one for each robot, dB(A).

        The `sample_rate` among them is that of the physics.

        Raises:
            ValueError: If nothing came.
        """
        return self.detector.result()

    # What follows are A-weighted mean squares by step, Pa^2. Shapes: (steps, robots).

    def _scuffing(self, block: ContactBlock, where: NDArray) -> NDArray:
        return (self._scuff_weights[block.floor] * sliding_squares(block, where)).sum(axis=2)

    def _drive(self, block: ContactBlock, where: NDArray) -> NDArray:
        return self._drive_weight * drive_squares(block, where)

    def _fan(self, block: ContactBlock, where: NDArray) -> NDArray:
        return fan_squares(block, where)

    def _landings(self, block: ContactBlock, where: NDArray) -> NDArray:
        impacts, step = block.impacts, block.impact_steps()
        apart = distance(impacts.position, where[step, impacts.robot])
        exposure = np.square(impacts.speed * self._gains[impacts.floor] / apart)
        for index, floor in enumerate(self._floors):
            here = impacts.floor == index
            if here.any():
                exposure[here] *= impact_exposure(impacts.mass[here], floor)
        flat = step * block.num_robots + impacts.robot
        size = block.steps * block.num_robots
        deposited = np.bincount(flat, weights=exposure / block.timestep, minlength=size)
        return deposited.reshape(block.steps, block.num_robots)
