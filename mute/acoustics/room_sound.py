"""What comes back from the walls, as sound, by pyroomacoustics if it is installed.

The library traces rays through an empty room of the given size whose surfaces absorb evenly. Of its
response the direct sound is left out, which `soundscape` makes, and the rest is given the energy of
the reverberant field, 8 pi / A of the source's mean square at 1 m: so levels are those of
`physics.room`, and the library gives their course in time alone. An optional extra,
`pip install 'mute[rooms]'`.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import oaconvolve

from mute.acoustics.air import AIR_IMPEDANCE
from mute.acoustics.contacts import ContactBlock
from mute.acoustics.floors import USUAL_LANDING, Floor
from mute.acoustics.microphone import distance
from mute.acoustics.physics.room import Room
from mute.acoustics.sources.exposures import blow_exposures
from mute.acoustics.sources.pending import Pending
from mute.acoustics.sources.response import PLACES
from mute.support.errors import MuteError

__all__ = ["Nearness", "RoomSound", "check_rooms_heard", "near_feet", "near_floors", "near_trunk"]

Nearness = Callable[[ContactBlock, NDArray], NDArray[np.float64]]
"""By what the sound at a microphone is less than at 1 m of a source of that power.

Takes a block and the place of the microphone, of shape (steps, robots, 3); returns (steps, robots).
"""

_SOURCE_HEIGHT, _EAR_HEIGHT = 0.15, 1.2
"""Above the ground, m."""
_RAYS = 20000
_HEARD = (100.0, 4000.0)
"""Frequencies between which the response has its energy, Hz."""
_AFTER_DIRECT = 2e-3
"""Time after the direct sound that is left out with it, s."""


def near_trunk(block: ContactBlock, microphone: NDArray) -> NDArray[np.float64]:
    """Tell it of sources in the trunk."""
    return distance(block.trunk_pos, microphone)


def near_feet(block: ContactBlock, microphone: NDArray) -> NDArray[np.float64]:
    """Tell it of feet, in the mean of their energies."""
    apart = distance(block.foot_pos, microphone[:, :, None])
    return 1.0 / np.sqrt(np.square(1.0 / apart).mean(axis=2))


def near_floors(floors: Sequence[Floor]) -> Nearness:
    """Tell it of floors that are struck, whose sound leaves them not at one point.

    Args:
        floors: The recording's, in the order of their indices.
    """
    tables = np.stack([_floor_nearness(floor) for floor in floors])

    def nearness(block: ContactBlock, microphone: NDArray) -> NDArray[np.float64]:
        apart, under = near_feet(block, microphone), np.asarray(block.floor)
        # Of feet on several floors the mean, as it is not known here which one is heard.
        shares = [(under == index).mean(axis=2) for index in range(len(tables))]
        each = [np.interp(apart, _APART, table) for table in tables]
        return np.sum([share * own for share, own in zip(shares, each, strict=True)], axis=0)

    return nearness


_APART = np.geomspace(0.05, 50.0, 64)
"""Distances of the tables, m."""


@cache
def _floor_nearness(floor: Floor) -> NDArray[np.float64]:
    count = len(_APART)
    mass, speed = (np.full(count, value) for value in USUAL_LANDING)
    foot = np.zeros(count, dtype=np.int64)
    places = [
        blow_exposures(floor, mass, speed, np.full(count, place), foot) for place in range(PLACES)
    ]
    heard = np.mean([place.floor_at(_APART) for place in places], axis=0)
    power = np.mean([place.floor_power for place in places], axis=0)
    return np.sqrt(AIR_IMPEDANCE / (2.0 * np.pi) * power / heard)


def check_rooms_heard() -> Any:  # noqa: ANN401
    """Return the library.

    Raises:
        MuteError: If it is not installed.
    """
    try:
        return importlib.import_module("pyroomacoustics")
    except ImportError as error:
        raise MuteError(
            f"sound in a room needs the library pyroomacoustics ({error}): "
            "pip install 'mute[rooms]'"
        ) from error


class RoomSound:
    """The reverberant field of one room, streamed."""

    def __init__(self, num_robots: int, sample_rate: int, room: Room) -> None:
        """Start in silence.

        Args:
            num_robots: Number of robots.
            sample_rate: Hz.
            room: One with walls.

        Raises:
            MuteError: If the library is not installed.
        """
        self._response = _response(room, sample_rate)
        self._pending = Pending(num_robots)

    def render(self, near: NDArray) -> NDArray[np.float64]:
        """Return what comes back, Pa. Shape: (robots, samples).

        Args:
            near: What is heard at 1 m of a source of that power. Shape: (robots, samples).
        """
        self._pending.add(slice(None), 0, oaconvolve(near, self._response[None], axes=1))
        return self._pending.take(near.shape[1])


@cache
def _response(room: Room, sample_rate: int) -> NDArray[np.float64]:
    library = check_rooms_heard()
    assert room.size is not None
    absorbed, _ = library.inverse_sabine(room.reverberation_time, room.size)
    walls = library.Material(absorbed)
    box = library.ShoeBox(
        room.size, fs=sample_rate, materials=walls, max_order=3, ray_tracing=True,
        air_absorption=False,
    )  # fmt: skip
    box.set_ray_tracing(n_rays=_RAYS)
    long, wide, _ = room.size
    # Off the middle, where many modes have their nodes.
    box.add_source([0.40 * long, 0.45 * wide, _SOURCE_HEIGHT])
    box.add_microphone([0.65 * long, 0.60 * wide, _EAR_HEIGHT])
    library.random.seed(numpy=0, libroom=0)  # of its own noise and rays
    box.compute_rir()
    response = np.array(box.rir[0][0], dtype=np.float64)
    direct = int(np.argmax(np.abs(response)))
    response[: direct + round(_AFTER_DIRECT * sample_rate)] = 0.0
    return response * np.sqrt(room.echo / _evenly(response, sample_rate))


def _evenly(response: NDArray, sample_rate: int) -> float:
    """Return the mean of |H|^2 over the octaves that steps are heard in.

    That of a flat response is the sum of its squares.
    """
    frequency = np.fft.rfftfreq(len(response), 1.0 / sample_rate)
    heard = (frequency > _HEARD[0]) & (frequency < _HEARD[1])
    squares = np.square(np.abs(np.fft.rfft(response)[heard]))
    return float(np.average(squares, weights=1.0 / frequency[heard]))
