"""A-weighted exposures of blows, from tables: what the sound would hold, without the sound.

How much is heard of a blow goes with its mass and its speed, by the spectrum of its force and the
filters of floor and shell. For each floor that is tabulated once, from the very filters that the
sound is made with, place by place; between the entries it goes as a power of both.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.fft import rfft
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from mute.acoustics.air import AIR_IMPEDANCE
from mute.acoustics.floors import Floor
from mute.acoustics.metering.weighting import a_weighting_db
from mute.acoustics.physics.plate import Plate
from mute.acoustics.physics.ringing import BANDS, OCTAVES, band_edges
from mute.acoustics.sources.response import PLACES, floor_response
from mute.acoustics.sources.shell import NUM_FEET, shell_response

__all__ = ["BlowExposures", "blow_exposures"]

_MASSES = np.geomspace(0.2, 8.0, 12)
"""Masses of the table, kg; beyond its ends, its ends."""
_SPEEDS = np.geomspace(1e-3, 5.0, 28)
"""Speeds of the table, m/s."""
_RATE = 48000
"""Sample rate whose filters are stood in for, Hz."""
_IN_A_BAND = 12
"""Steps of frequency that a third octave is summed up by."""
_OCTAVES = len(OCTAVES)
_SHAPE_STEPS, _PADDING = 1024, 16
"""Steps of a force's shape, and how much longer than it its transform is."""
_NOTHING = 1e-300
"""In place of 0 where a logarithm is taken."""


@dataclass(frozen=True)
class BlowExposures:
    """What is heard of blows on one floor, A-weighted, Pa^2 s. Each array has a row a blow."""

    direct: NDArray[np.float64]
    """What the floor radiates at once, at 1 m. Shape: (n,)."""
    ringing: NDArray[np.float64]
    """What rings, times the area that it goes through, in m^2, by octave. Shape: (n, octaves)."""
    alike: NDArray[np.float64]
    """How much of both is in phase, from -1 to 1, by octave. Shape: (n, octaves)."""
    body: NDArray[np.float64]
    """What the shell would make of the whole force, at 1 m. Shape: (n,)."""
    plate: Plate
    """The floor's."""

    def floor_at(self, distance: NDArray) -> NDArray[np.float64]:
        """Return what is heard of the floor, Pa^2 s. Shape: (n,).

        Args:
            distance: Of the blows from the microphone, m. Shape: (n,).
        """
        direct = self.direct / np.square(distance)
        ringing = self.ringing * self.plate.spread(OCTAVES, distance[:, None])
        both = 2.0 * self.alike * np.sqrt(direct[:, None] * ringing)
        return np.maximum(direct + (ringing + both).sum(axis=1), 0.0)

    @property
    def floor_power(self) -> NDArray[np.float64]:
        """Sound energy that the floor radiates upwards, J. Shape: (n,)."""
        return (2.0 * np.pi * self.direct + self.ringing.sum(axis=1)) / AIR_IMPEDANCE


def blow_exposures(
    floor: Floor, mass: NDArray, speed: NDArray, place: NDArray, foot: NDArray
) -> BlowExposures:
    """Return what is heard of blows.

    Args:
        floor: What is struck.
        mass: Effective mass, kg. Shape: (n,).
        speed: m/s. Shape: (n,).
        place: Which of the floor's places is struck, see `landings.place_struck`. Shape: (n,).
        foot: Which one strikes. Shape: (n,).
    """
    tables = _tables(floor)
    at = _between(mass, _MASSES), _between(speed, _SPEEDS)
    return BlowExposures(
        direct=np.exp(_looked_up(tables.direct, *at)),
        ringing=np.exp(_looked_up(tables.ringing, *at, place)),
        alike=_looked_up(tables.alike, *at, place),
        body=np.exp(_looked_up(tables.body, *at, foot)),
        plate=floor.plate,
    )


_Between = tuple[NDArray[np.int64], NDArray[np.float64]]


def _looked_up(
    table: NDArray, mass: _Between, speed: _Between, *rest: NDArray
) -> NDArray[np.float64]:
    """Return the values between four entries of a table. `rest` are indices of its next axes."""
    (row, up), (column, on) = mass, speed
    shape = (-1, *(1,) * (table.ndim - 2 - len(rest)))
    up, on = up.reshape(shape), on.reshape(shape)
    lower, upper = (
        (1.0 - on) * table[row + i, column, *rest] + on * table[row + i, column + 1, *rest]
        for i in (0, 1)
    )
    return (1.0 - up) * lower + up * upper


def _between(value: NDArray, grid: NDArray) -> _Between:
    """Return between which points of an even logarithmic grid values lie, and how far on."""
    steps = np.log(np.maximum(value, grid[0]) / grid[0]) / np.log(grid[1] / grid[0])
    steps = np.minimum(steps, len(grid) - 1.0)
    index = np.minimum(steps.astype(np.int64), len(grid) - 2)
    return index, steps - index


@dataclass(frozen=True)
class _Tables:
    """What is heard of all masses and speeds; logarithms, but for `alike`."""

    direct: NDArray[np.float64]
    """Shape: (masses, speeds)."""
    ringing: NDArray[np.float64]
    """Shape: (masses, speeds, places, octaves)."""
    alike: NDArray[np.float64]
    """Shape: (masses, speeds, places, octaves)."""
    body: NDArray[np.float64]
    """Shape: (masses, speeds, feet)."""


@cache
def _tables(floor: Floor) -> _Tables:
    response = floor_response(floor.plate, _RATE)
    rings = (PLACES, _OCTAVES)
    squares = {
        "direct": np.square(np.abs(response.direct))[None],
        "ringing": np.square(np.abs(response.ringing)).reshape(PLACES * _OCTAVES, -1),
        "both": (response.direct.conj() * response.ringing).real.reshape(PLACES * _OCTAVES, -1),
    }
    heard = {name: _in_steps(response.frequency, each) for name, each in squares.items()}
    force = _forces(floor)
    shape = (len(_MASSES), len(_SPEEDS))
    direct = (force @ heard["direct"][0]).reshape(shape)
    ringing = (force @ heard["ringing"].T).reshape(*shape, *rings)
    both = (force @ heard["both"].T).reshape(*shape, *rings)
    body = (force @ _shell_squares().T).reshape(*shape, NUM_FEET)
    size = np.sqrt(np.maximum(direct[:, :, None, None] * ringing, _NOTHING))
    logarithms = (np.log(np.maximum(each, _NOTHING)) for each in (direct, ringing, body))
    direct, ringing, body = logarithms
    return _Tables(direct, ringing, np.clip(both / size, -1.0, 1.0), body)


def _forces(floor: Floor) -> NDArray[np.float64]:
    """Return the integrals of F^2 over each step of frequency, N^2 s.

    Shape: (masses * speeds, steps).
    """
    mass, speed = (each.ravel() for each in np.meshgrid(_MASSES, _SPEEDS, indexing="ij"))
    blow = floor.contact.blow(mass, speed)
    edges = _edges()
    cycles = blow.duration[:, None] * (0.5 * (edges[1:] + edges[:-1]))
    points = np.broadcast_to(np.linspace(0.0, 1.0, _SHAPE_STEPS + 1), (len(mass), _SHAPE_STEPS + 1))
    shape = np.diff(floor.contact.passed(blow.give, points), axis=1)
    # Between its steps the force is constant, which blurs them; padded, the transform is fine
    # enough to be read between its points, once it is turned to be about the pulse's middle.
    count = _SHAPE_STEPS * _PADDING
    spectrum = rfft(shape, count, axis=1)
    spectrum *= np.exp(1j * np.pi * np.arange(spectrum.shape[1]) / _PADDING)
    # Beyond its steps' half frequency a spectrum comes again, mirrored.
    position = np.abs(np.mod(cycles * _PADDING + 0.5 * count, count) - 0.5 * count)
    index = np.minimum(position.astype(np.int64), count // 2 - 1)
    low, high = (np.take_along_axis(spectrum, index + step, axis=1) for step in (0, 1))
    between = low + (position - index) * (high - low)
    size = np.abs(between) * np.sinc(cycles / _SHAPE_STEPS) * blow.impulse[:, None]
    return 2.0 * np.diff(edges) * np.square(size)


@cache
def _shell_squares() -> NDArray[np.float64]:
    """Return the A-weighted p^2 over F^2 at 1 m of the shell. Shape: (feet, steps)."""
    response = shell_response(_RATE)
    return _in_steps(response.frequency, response.squares[:NUM_FEET])


def _in_steps(frequency: NDArray, squares: NDArray) -> NDArray[np.float64]:
    """Return A-weighted means over steps of frequency. Shape: (n, steps) of (n, frequencies)."""
    weighted = squares * 10.0 ** (a_weighting_db(frequency) / 10.0)
    passed = cumulative_trapezoid(weighted, frequency, axis=1, initial=0.0)
    edges = _edges()
    return np.diff([np.interp(edges, frequency, each) for each in passed], axis=1) / np.diff(edges)


def _edges() -> NDArray[np.float64]:
    """Return the edges of the steps of frequency, Hz."""
    low, high = band_edges(BANDS)
    return np.geomspace(low[0], high[-1], _IN_A_BAND * len(BANDS) + 1)
