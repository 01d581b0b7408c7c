"""Landings: the force of a blow drives the floor, and through the leg the robot's shell.

A foot of the effective mass m that meets the floor at the normal speed v presses on it as
`physics.contact` says; so harder blows are shorter and brighter, not just louder. The force goes
through two filters, each after `r / c`: that of the floor where it is struck, and that of the
shell, with the share of the force that comes to it. A blow is worked out as a whole, by a Fourier
transform, when it begins, and added to what each robot's microphone is yet to hear.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from mute.acoustics.air import SPEED_OF_SOUND
from mute.acoustics.contacts import ContactBlock, Impacts
from mute.acoustics.floors import Floor
from mute.acoustics.microphone import distance
from mute.acoustics.sources.halves import Half, LowPending, halves, low_divisor
from mute.acoustics.sources.pending import Pending
from mute.acoustics.sources.response import LONGEST_PULSE, PLACES, floor_response
from mute.acoustics.sources.shell import SIDES, shell_response

__all__ = ["FAINTEST", "PLACE_SIZE", "LandingSound", "place_struck", "sampled_force"]

_AT_ONCE = 64
"""Blows that are worked out side by side, which bounds the memory."""

_PULSES = (0.03, LONGEST_PULSE)
"""Lengths of transforms for the forces of short and of long blows, s."""

PLACE_SIZE = 0.2
"""Length of the squares within which a floor sounds alike, m (chosen)."""

FAINTEST = 1e-3
"""Speed below which a landing is not heard, m/s."""


def place_struck(position: NDArray) -> NDArray[np.int64]:
    """Return which of a floor's places a blow hits. Shape: (n,) of (n, 3), m."""
    square = np.floor(position[:, :2] / PLACE_SIZE).astype(np.int64)
    return (square[:, 0] * 73856093 ^ square[:, 1] * 19349663) % PLACES


def sampled_force(
    floor: Floor, mass: NDArray, speed: NDArray, lead: NDArray, sample_rate: float, samples: int
) -> NDArray[np.float64]:
    """Return the forces of blows as means over the sample intervals, N.

    So their sums over the sample rate are the impulses exactly, wherever between samples they
    begin.

    Args:
        floor: What is struck.
        mass: Effective mass, kg. Shape: (n,).
        speed: m/s. Shape: (n,).
        lead: Time from the beginning of each blow to the first sample, s. Shape: (n,).
        sample_rate: Hz.
        samples: How many.

    Returns:
        Forces. Shape: (n, samples).
    """
    blow = floor.contact.blow(mass, speed)
    ends = (lead[:, None] + np.arange(-1, samples) / sample_rate) / blow.duration[:, None]
    passed = floor.contact.passed(blow.give, ends)
    return np.diff(passed, axis=1) * (blow.impulse * sample_rate)[:, None]


class LandingSound:
    """The sound of landings, streamed."""

    def __init__(
        self,
        num_robots: int,
        floors: tuple[Floor, ...],
        sample_rate: int,
        floor_heard: bool = True,
        transmissibility: float = 0.0,
    ) -> None:
        """Start in silence.

        Args:
            num_robots: Number of robots.
            floors: The recording's floors.
            sample_rate: Hz.
            floor_heard: Whether the floor is.
            transmissibility: Share of the force that comes to the shell; 0 where it is not heard.
        """
        self._sample_rate = sample_rate
        self._floors = floors
        self._floor_heard, self._share = floor_heard, transmissibility
        heard = floors if floor_heard else ()
        self._halves = [
            halves(floor_response(floor.plate, sample_rate), sample_rate) for floor in heard
        ]
        self._shell = halves(shell_response(sample_rate), sample_rate)
        self._latest = max(half.late for half in self._shell)
        self._high = Pending(num_robots)
        self._low = LowPending(num_robots, low_divisor(sample_rate))

    def render(self, block: ContactBlock, microphone: NDArray, bounds: NDArray) -> NDArray:
        """Return the block's pressure, Pa. Shape: (robots, samples).

        Args:
            block: Physics.
            microphone: Where it is, m. Shape: (steps, robots, 3).
            bounds: Sample at which each step begins, and the end of the last. Shape: (steps + 1,).
        """
        first, stop = int(bounds[0]), int(bounds[-1])
        self._low.begin(first)
        step = block.impact_steps()
        where = microphone[step, block.impacts.robot]
        trunk = block.trunk_pos[step, block.impacts.robot]
        for index, floor in enumerate(self._floors):
            here = (block.impacts.floor == index) & (block.impacts.speed > FAINTEST)
            for some, pulse in _batches(floor, block.impacts, np.flatnonzero(here)):
                blows = block.impacts.select(some)
                self._strike(index, blows, pulse, where[some], trunk[some], first)
        return self._high.take(stop - first) + self._low.take(first, stop)

    def _strike(
        self,
        floor: int,
        blows: Impacts,
        pulse: float,
        microphone: NDArray,
        trunk: NDArray,
        first: int,
    ) -> None:
        """Add what is heard of some blows on one floor, of each no more than `pulse` seconds."""
        own = self._floors[floor]
        if self._floor_heard:
            apart = distance(blows.position, microphone)
            place, size = place_struck(blows.position), np.ones(len(blows))
            for half in self._halves[floor]:
                self._add(half, own, blows, pulse, first, apart, place, size)
        if self._share > 0.0:
            apart = distance(trunk, microphone)
            size = self._share * SIDES[blows.foot]
            for half in self._shell:
                self._add(half, own, blows, pulse, first, apart, blows.foot, size)

    def _add(
        self,
        half: Half,
        floor: Floor,
        blows: Impacts,
        pulse: float,
        first: int,
        apart: NDArray,
        place: NDArray,
        size: NDArray,
    ) -> None:
        """Add what half of a filter makes of blows to what is yet to be heard."""
        # The lower half is given ahead of its time, but not before the blow: what is nearer than
        # its lateness is heard as from there, both halves alike.
        arrival = blows.time + np.maximum(apart / SPEED_OF_SOUND, self._latest) - half.late
        begin = np.floor(arrival * half.rate).astype(np.int64) + 1
        samples = math.ceil(pulse * half.rate) + 1
        lead = begin / half.rate - arrival
        force = sampled_force(floor, blows.mass, blows.speed, lead, half.rate, samples)
        heard = half.heard(force, apart, place, size)
        if half.low:
            for robot, start, sound in zip(blows.robot, begin, heard, strict=True):
                self._low.add(robot, int(start), sound)
        else:
            for robot, offset, sound in zip(blows.robot, begin - first, heard, strict=True):
                self._high.add(robot, max(0, int(offset)), sound)


def _batches(
    floor: Floor, impacts: Impacts, struck: NDArray[np.int64]
) -> Iterator[tuple[NDArray[np.int64], float]]:
    """Yield blows on a floor to be worked out side by side, and how long the longest may take.

    Args:
        floor: What is struck.
        impacts: All blows.
        struck: Indices of those on the floor.
    """
    lasting = floor.contact.blow(impacts.mass[struck], impacts.speed[struck]).duration
    kind = np.searchsorted(_PULSES[:-1], lasting)
    for index, pulse in enumerate(_PULSES):
        alike = struck[kind == index]
        for begin in range(0, len(alike), _AT_ONCE):
            yield alike[begin : begin + _AT_ONCE], pulse
