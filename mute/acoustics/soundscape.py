"""Everything that a robot sounds of, at one microphone: physics in, pressure out.

A `Soundscape` renders blocks of any length one after the other; what it gives does not depend on
where the blocks are cut. Equal seeds give equal sound, and a source sounds the same alone as among
the others. Each robot is in a world, and at a microphone, of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mute.acoustics.contacts import ContactBlock
from mute.acoustics.floors import find_floors
from mute.acoustics.microphone import Microphone
from mute.acoustics.sources.drive import Drive
from mute.acoustics.sources.fan import Fan
from mute.acoustics.sources.impacts import ImpactSound
from mute.acoustics.sources.scuffing import Scuffing

__all__ = ["SOURCES", "Soundscape", "StepClock", "check_sources", "floor_gains"]

SOURCES = ("impacts", "scuffing", "drive", "fan")
"""All that can be heard, each alone or together."""

_CHUNK = 0.1
"""Longest stretch that is rendered at a time, s: it bounds the memory, and fits caches."""


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


def floor_gains(floors: Sequence[str], gains: Mapping[str, float] | None) -> NDArray[np.float64]:
    """Return the calibration gain of each floor, 1 where none is given. Shape: (floors,).

    Raises:
        ValueError: If a gain is not a finite number above zero.
    """
    values = np.array([1.0 if gains is None else gains.get(name, 1.0) for name in floors])
    if not (np.isfinite(values).all() and (values > 0.0).all()):
        raise ValueError(f"gains must be finite and positive, got {dict(gains or {})}")
    return values


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
        gains: Mapping[str, float] | None = None,
    ) -> None:
        """Start in silence.

        Args:
            num_robots: Number of robots in each block.
            floors: Names of the recording's floors, in the order of their indices.
            microphone: Where to listen. Default: on the trunk.
            sample_rate: Hz.
            seed: Of all noise.
            sources: What to hear, of `SOURCES`.
            gains: Calibration gain by floor; it acts on impacts and scuffing. Default: 1.

        Raises:
            ValueError: If a floor, a source, a gain, or the sample rate is not allowed.
        """
        if sample_rate < 8000:
            raise ValueError(f"sample_rate must be at least 8000 Hz, got {sample_rate}")
        self.num_robots = num_robots
        self.sample_rate = sample_rate
        self.microphone = microphone or Microphone()
        known = find_floors(floors)
        factors = floor_gains(floors, gains)
        # A source keeps its seed whatever else is heard.
        seeds = {name: (seed, index) for index, name in enumerate(SOURCES)}
        makers = {
            "impacts": lambda: ImpactSound(num_robots, known, factors, sample_rate),
            "scuffing": lambda: Scuffing(
                num_robots, known, factors, sample_rate, seeds["scuffing"]
            ),
            "drive": lambda: Drive(num_robots, sample_rate, seeds["drive"]),
            "fan": lambda: Fan(num_robots, sample_rate, seeds["fan"]),
        }
        self._sources: list[_Source] = [makers[name]() for name in check_sources(sources)]
        self._clock = StepClock(num_robots)

    def render(self, block: ContactBlock) -> NDArray[np.float32]:
        """Return the samples k with start <= k / sample_rate < end of the next block.

        Args:
            block: Physics that follows the last block's.

        Returns:
            Sound pressure, Pa. Shape: (num_robots, samples).

        Raises:
            ValueError: If the block leaves a gap or is of another number of robots.
        """
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
            heard = sum(source.render(part, where, edges) for source in self._sources)
            out[:, edges[0] - bounds[0] : edges[-1] - bounds[0]] = heard
        return out
