"""Everything that a robot sounds of, at one microphone: physics in, pressure out.

A `Soundscape` renders blocks of any length one after the other; what it gives does not depend on
where the blocks are cut. Equal seeds give equal sound, and a source sounds the same alone as among
the others. Each robot is in a world, and at a microphone, of its own.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mute.acoustics.body import load_transmissibility
from mute.acoustics.contacts import ContactBlock
from mute.acoustics.floors import find_floors
from mute.acoustics.microphone import Microphone
from mute.acoustics.physics.room import OPEN, Room
from mute.acoustics.room_sound import RoomSound, near_feet, near_floors, near_trunk
from mute.acoustics.sources.band_noise import spread
from mute.acoustics.sources.drive import DriveSound
from mute.acoustics.sources.fan import Fan
from mute.acoustics.sources.landings import LandingSound
from mute.acoustics.sources.scuffing import Scuffing
from mute.support.threads import core_share

__all__ = ["SOURCES", "Soundscape", "StepClock", "check_sources"]

SOURCES = ("impacts", "body", "drive", "scuffing", "fan")
"""All that can be heard, each alone or together."""

_CHUNK = 0.1
"""Longest stretch that is rendered at a time, s: it bounds the memory, and fits caches."""

_MANY = 4
"""Robots from which on sources are rendered side by side, each in a thread: what they compute in
does not hold up the others."""


class _Source(Protocol):
    def render(self, block: ContactBlock, microphone: NDArray, bounds: NDArray) -> NDArray: ...


def check_sources(sources: Sequence[str]) -> tuple[str, ...]:
    """Return the sources.

    Raises:
        ValueError: If one is not known or there are none.
    """
    for name in sources:
        if name not in SOURCES:
            raise ValueError(f"sources must be of {', '.join(SOURCES)}, got {name!r}")
    if not sources:
        raise ValueError(f"sources must be of {', '.join(SOURCES)}, got none")
    return tuple(sources)


class StepClock:
    """Keeps blocks in order."""

    def __init__(self, num_robots: int) -> None:
        """Expect a first block, which may begin at any time.

        Args:
            num_robots: That every block must hold.
        """
        self._num_robots = num_robots
        self._end: float | None = None
        self.step = 0
        """Number of the last block's first step, from the beginning of the recording."""

    def accept(self, block: ContactBlock) -> None:
        """Take the next block.

        Raises:
            ValueError: If it does not follow the last one, or is not of the right size.
        """
        if block.num_robots != self._num_robots:
            raise ValueError(f"block has {block.num_robots} robots, not {self._num_robots}")
        if self._end is not None and abs(block.start - self._end) > 0.1 * block.timestep:
            raise ValueError(f"block starts at {block.start:g} s, not at {self._end:g} s")
        self._end = block.end
        self.step = round(block.start / block.timestep)


class Soundscape:
    """Renders the pressure at a microphone for a batch of robots, block by block."""

    def __init__(
        self,
        num_robots: int,
        floors: Sequence[str],
        microphone: Microphone | None = None,
        sample_rate: int = 48000,
        seed: int = 0,
        sources: Sequence[str] = SOURCES,
        transmissibility: float | None = None,
        room: Room = OPEN,
    ) -> None:
        """Start in silence.

        Args:
            num_robots: Number of robots in each block.
            floors: Names of the recording's floors, in the order of their indices.
            microphone: Where to listen. Default: on the trunk.
            sample_rate: Hz.
            seed: Of all noise.
            sources: What to hear, of `SOURCES`.
            transmissibility: Share of a foot's force that comes to the robot's shell. Default: the
                calibration's.
            room: Where it is heard. One with walls needs pyroomacoustics.

        Raises:
            MuteError: If what a room needs is not installed.
            ValueError: If a floor, a source or the sample rate is not allowed.
        """
        if sample_rate < 8000:
            raise ValueError(f"sample_rate must be at least 8000 Hz, got {sample_rate}")
        self.num_robots = num_robots
        self.sample_rate = sample_rate
        self.microphone = microphone or Microphone()
        known = find_floors(floors)
        share = load_transmissibility() if transmissibility is None else transmissibility
        heard = check_sources(sources)
        # A source keeps its seed whatever else is heard.
        seeds = {name: (seed, index) for index, name in enumerate(SOURCES)}
        makers: dict[str, Callable[[], _Source]] = {
            "impacts": lambda: LandingSound(num_robots, known, sample_rate),
            "body": lambda: LandingSound(num_robots, known, sample_rate, False, share),
            "drive": lambda: DriveSound(num_robots, sample_rate, share),
            "scuffing": lambda: Scuffing(num_robots, sample_rate, seeds["scuffing"]),
            "fan": lambda: Fan(num_robots, sample_rate, seeds["fan"]),
        }
        self._sources = [makers[name]() for name in heard]
        self._room: RoomSound | None = None
        if room.has_walls:
            self._room = RoomSound(num_robots, sample_rate, room)
            of_floors = near_floors(known)
            nearness = {"impacts": of_floors, "scuffing": near_feet}
            self._nearness = [nearness.get(name, near_trunk) for name in heard]
        self._clock = StepClock(num_robots)

    def render(self, block: ContactBlock) -> NDArray[np.float32]:
        """Return the samples k with start <= k / sample_rate < end of the next block.

        Args:
            block: Physics that follows the last block's.

        Returns:
            Sound pressure, Pa. Shape: (num_robots, samples).

        Raises:
            ValueError: If the block leaves a gap, is of another number of robots, or its steps are
                shorter than a sample.
        """
        if block.timestep * self.sample_rate < 1.0:
            raise ValueError(
                f"steps of {block.timestep:g} s are shorter than a sample at {self.sample_rate} Hz"
            )
        self._clock.accept(block)
        steps = self._clock.step + np.arange(block.steps + 1)
        # Less a margin, so that a step that ends upon a sample does not, by rounding, include it.
        bounds = np.ceil(steps * (block.timestep * self.sample_rate) - 1e-6).astype(np.int64)
        out = np.zeros((self.num_robots, int(bounds[-1] - bounds[0])), dtype=np.float32)
        chunk = max(1, round(_CHUNK / block.timestep))
        for first in range(0, block.steps, chunk):
            stop = min(first + chunk, block.steps)
            part = block.part(first, stop)
            where = self.microphone.position(part)
            edges = bounds[first : stop + 1]
            heard = self._heard(part, where, edges)
            total = sum(heard)
            if self._room is not None:
                near = sum(
                    spread(nearness(part, where), edges) * own
                    for nearness, own in zip(self._nearness, heard, strict=True)
                )
                total = total + self._room.render(np.asarray(near))
            out[:, edges[0] - bounds[0] : edges[-1] - bounds[0]] = total
        return out

    def _heard(self, part: ContactBlock, where: NDArray, edges: NDArray) -> list[NDArray]:
        """Return the sound of each source, which have nothing to do with one another."""

        def render(source: _Source) -> NDArray:
            return source.render(part, where, edges)

        if self.num_robots < _MANY:
            return [render(source) for source in self._sources]
        return list(_threads().map(render, self._sources))


@cache
def _threads() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(core_share(), thread_name_prefix="sound")


if hasattr(os, "register_at_fork"):  # not on Windows
    os.register_at_fork(after_in_child=_threads.cache_clear)  # a copied process has no threads
