"""Levels without audio: the A-weighted energies of the sources, added up at the physics rate.

The cheap path for training curves and levels that are shown live. It knows the same sources as
`soundscape`, and gives what a sound level meter would read at its microphone, from energies alone:

- a landing deposits the A-weighted sound exposure of what floor and shell make of its force
  (`sources.exposures`), and so do teeth that meet;
- scuffing, drive and fan have the mean square pressure that their sound is made with, times the
  share that the A-weighting leaves of it;
- the detector of `levels` turns the energies into Fast readings, as it does with those of sound.

What it leaves out: interference of landings that fall within milliseconds of each other, the few
hundredths of a second over which the sound of a landing is drawn out, and the chance of noise.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from mute.acoustics.air import AIR_IMPEDANCE
from mute.acoustics.body import load_transmissibility
from mute.acoustics.contacts import ContactBlock, Impacts
from mute.acoustics.floors import Floor, find_floors
from mute.acoustics.metering.levels import LevelDetector, Levels
from mute.acoustics.microphone import Microphone, distance
from mute.acoustics.physics.room import OPEN, Room
from mute.acoustics.soundscape import SOURCES, StepClock, check_sources
from mute.acoustics.sources.band_noise import band_a_weight
from mute.acoustics.sources.drive import DriveExposure
from mute.acoustics.sources.exposures import BlowExposures, blow_exposures
from mute.acoustics.sources.fan import fan_squares
from mute.acoustics.sources.landings import place_struck
from mute.acoustics.sources.scuffing import SCUFF_BAND, scuffing_power, scuffing_squares

__all__ = ["EnergyMeter"]

_RATE = 48000
"""Sample rate whose filters are stood in for, Hz."""

_CHUNK = 2.0
"""Longest stretch that is added up at a time, s."""

_Heard = tuple[NDArray, NDArray]


class EnergyMeter:
    """A sound level meter for every robot, without sound."""

    def __init__(
        self,
        num_robots: int,
        floors: Sequence[str],
        microphone: Microphone | None = None,
        sources: Sequence[str] = SOURCES,
        transmissibility: float | None = None,
        room: Room = OPEN,
    ) -> None:
        """Start in silence.

        Args:
            num_robots: Number of robots in each block.
            floors: Names of the recording's floors, in the order of their indices.
            microphone: Where to listen. Default: on the trunk.
            sources: What to hear.
            transmissibility: Share of a foot's force that comes to the shell. Default: the
                calibration's.
            room: Where that is.

        Raises:
            ValueError: If a floor or a source is not allowed.
        """
        self._microphone = microphone or Microphone()
        self._floors = find_floors(floors)
        share = load_transmissibility() if transmissibility is None else transmissibility
        self._share, self._room = share, room
        self._lingering = {name: np.zeros((1, num_robots)) for name in SOURCES}
        squares = {
            "impacts": self._impacts,
            "body": self._body,
            "scuffing": self._scuffing,
            "drive": self._drive,
            "fan": self._fan,
        }
        self._squares = {name: squares[name] for name in check_sources(sources)}
        self.exposure = {name: np.zeros(num_robots) for name in self._squares}
        """A-weighted sound exposure of each source so far, Pa^2 s. Shape of each: (num_robots,)."""
        self._clock = StepClock(num_robots)
        self._scuff_weight = band_a_weight(SCUFF_BAND, _RATE)
        self._drive_exposure = DriveExposure(num_robots, _RATE, share)
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
                direct, near = squares(part, where)
                own = direct + self._echo(name, near, block.timestep)
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

    def _echo(self, name: str, near: NDArray, timestep: float) -> NDArray:
        """Return what comes back from the walls of a source, by step, Pa^2.

        The room fills up, and empties, by e to the power of -13.8 within its reverberation time.

        Args:
            name: Of the source.
            near: Its mean square at 1 m, Pa^2. Shape: (steps, robots).
            timestep: s.
        """
        room = self._room
        if not room.has_walls:
            return np.zeros_like(near)
        kept = math.exp(-math.log(1e6) * timestep / max(room.reverberation_time, timestep))
        filled = room.echo * near
        echo, self._lingering[name] = signal.lfilter(
            [1.0 - kept], [1.0, -kept], filled, axis=0, zi=self._lingering[name]
        )
        return echo

    # What follows are A-weighted mean squares by step, of the direct sound at the microphone and at
    # 1 m from a source of that power, Pa^2. Shapes: (steps, robots).

    def _scuffing(self, block: ContactBlock, where: NDArray) -> _Heard:
        near = self._scuff_weight * scuffing_power(block) * AIR_IMPEDANCE / (2.0 * math.pi)
        return self._scuff_weight * scuffing_squares(block, where), near

    def _drive(self, block: ContactBlock, where: NDArray) -> _Heard:
        near = self._drive_exposure.squares(block)
        return near / np.square(distance(block.trunk_pos, where)), near

    def _fan(self, block: ContactBlock, where: NDArray) -> _Heard:
        direct = fan_squares(block, where)
        return direct, direct * np.square(distance(block.trunk_pos, where))

    def _impacts(self, block: ContactBlock, where: NDArray) -> _Heard:
        impacts, step = block.impacts, block.impact_steps()
        apart = distance(impacts.position, where[step, impacts.robot])
        direct, power = np.zeros(len(impacts)), np.zeros(len(impacts))
        for floor, here in self._by_floor(block):
            heard = _heard_of(impacts, floor, here)
            direct[here], power[here] = heard.floor_at(apart[here]), heard.floor_power
        near = AIR_IMPEDANCE / (2.0 * math.pi) * power
        return _deposited(direct, block), _deposited(near, block)

    def _body(self, block: ContactBlock, where: NDArray) -> _Heard:
        impacts, step = block.impacts, block.impact_steps()
        near = np.zeros(len(impacts))
        for floor, here in self._by_floor(block):
            heard = _heard_of(impacts, floor, here)
            near[here] = self._share**2 * heard.body
        apart = distance(block.trunk_pos[step, impacts.robot], where[step, impacts.robot])
        return _deposited(near / np.square(apart), block), _deposited(near, block)

    def _by_floor(self, block: ContactBlock) -> Iterator[tuple[Floor, NDArray[np.bool_]]]:
        """Yield each floor with the impacts upon it, where there are any."""
        for index, floor in enumerate(self._floors):
            here = block.impacts.floor == index
            if here.any():
                yield floor, here


def _heard_of(impacts: Impacts, floor: Floor, here: NDArray[np.bool_]) -> BlowExposures:
    """Return what is heard of some impacts on one floor."""
    mass, speed = impacts.mass[here], impacts.speed[here]
    place = place_struck(impacts.position[here])
    return blow_exposures(floor, mass, speed, place, impacts.foot[here])


def _deposited(exposure: NDArray, block: ContactBlock) -> NDArray[np.float64]:
    """Return exposures of a block's impacts, Pa^2 s, as mean squares of the steps they fall in."""
    flat = block.impact_steps() * block.num_robots + block.impacts.robot
    size = block.steps * block.num_robots
    deposited = np.bincount(flat, weights=exposure / block.timestep, minlength=size)
    return deposited.astype(np.float64).reshape(block.steps, block.num_robots)  # of none: integers
