"""Landings: the force of a blow drives the floor, and through the leg the robot's shell.

A foot of the effective mass m that meets the floor at the normal speed v presses on it as
`physics.contact` says; so harder blows are shorter and brighter, not just louder. The force goes
through two filters, each after `r / c`: that of the floor where it is struck, and that of the
shell, with the share of the force that comes to it. A blow is worked out as a whole, by a Fourier
transform, when it begins, and added to what each robot's microphone is yet to hear.
"""

from __future__ import annotations

import numpy as np
from numpy.fft import irfft, rfft
from numpy.typing import NDArray

from mute.acoustics.air import SPEED_OF_SOUND
from mute.acoustics.contacts import ContactBlock, Impacts
from mute.acoustics.floors import Floor
from mute.acoustics.microphone import distance
from mute.acoustics.sources.pending import Pending
from mute.acoustics.sources.response import PLACES, PlateResponse, floor_response
from mute.acoustics.sources.shell import SIDES, shell_response

__all__ = ["LandingSound", "place_struck", "sampled_force"]

_AT_ONCE = 32
"""Blows that are worked out side by side, which bounds the memory."""

_PLACE_SIZE = 0.2
"""Length of the squares within which a floor sounds alike, m (chosen)."""

_FAINTEST = 1e-3
"""Speed below which a landing is not heard, m/s."""


def place_struck(position: NDArray) -> NDArray[np.int64]:
    """Return which of a floor's places a blow hits. Shape: (n,) of (n, 3), m."""
    square = np.floor(position[:, :2] / _PLACE_SIZE).astype(np.int64)
    return (square[:, 0] * 73856093 ^ square[:, 1] * 19349663) % PLACES


def sampled_force(
    floor: Floor, mass: NDArray, speed: NDArray, lead: NDArray, sample_rate: int, samples: int
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
        self._responses = [floor_response(floor.plate, sample_rate) for floor in heard]
        self._shell = shell_response(sample_rate)
        self._pending = Pending(num_robots)

    def render(self, block: ContactBlock, microphone: NDArray, bounds: NDArray) -> NDArray:
        """Return the block's pressure, Pa. Shape: (robots, samples).

        Args:
            block: Physics.
            microphone: Where it is, m. Shape: (steps, robots, 3).
            bounds: Sample at which each step begins, and the end of the last. Shape: (steps + 1,).
        """
        first, stop = int(bounds[0]), int(bounds[-1])
        where = microphone[block.impact_steps(), block.impacts.robot]
        for index in range(len(self._floors)):
            here = (block.impacts.floor == index) & (block.impacts.speed > _FAINTEST)
            struck = np.flatnonzero(here)
            for begin in range(0, len(struck), _AT_ONCE):
                some = struck[begin : begin + _AT_ONCE]
                trunk = block.trunk_pos[block.impact_steps()[some], block.impacts.robot[some]]
                self._strike(index, block.impacts.select(some), where[some], trunk, first)
        return self._pending.take(stop - first)

    def _strike(
        self, floor: int, blows: Impacts, microphone: NDArray, trunk: NDArray, first: int
    ) -> None:
        """Add what is heard of some blows on one floor."""
        own = self._floors[floor]
        if self._floor_heard:
            response = self._responses[floor]
            apart = distance(blows.position, microphone)
            place = place_struck(blows.position)
            self._add(own, blows, apart, response.transfer(apart, place), response, first)
        if self._share > 0.0:
            apart = distance(trunk, microphone)
            side = self._share * SIDES[blows.foot]
            transfer = side[:, None] * self._shell.transfer(apart, blows.foot)
            self._add(own, blows, apart, transfer, self._shell, first)

    def _add(
        self,
        floor: Floor,
        blows: Impacts,
        apart: NDArray,
        transfer: NDArray,
        response: PlateResponse,
        first: int,
    ) -> None:
        """Add what one filter makes of blows to what is yet to be heard."""
        rate = self._sample_rate
        arrival = blows.time + apart / SPEED_OF_SOUND
        begin = np.floor(arrival * rate).astype(np.int64) + 1
        force = sampled_force(
            floor, blows.mass, blows.speed, begin / rate - arrival, rate, response.longest_pulse
        )
        heard = irfft(rfft(force, response.length, axis=1) * transfer, response.length, axis=1)
        for robot, offset, sound in zip(blows.robot, begin - first, heard, strict=True):
            self._pending.add(robot, max(0, int(offset)), sound)
