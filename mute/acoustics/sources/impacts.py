"""Landings: a force pulse drives the floor's damped modes.

A foot of effective mass m that meets the floor at normal speed v, with rebound e v, gives the
impulse J = (1 + e) m v. On a linear contact spring k (the rubber and the floor in series) it lasts
T = pi sqrt(m / k), as half a sine (Goldsmith, Impact, 1960), which the loss that leaves e damps:

    F(t) = J N exp(-b t) sin(pi t / T),    0 < t < T,    b = -ln(e) / T,

with N for an integral of J. So the force sets in faster than it lets go. That matters: a half-sine
of equal flanks has nulls at 3/2, 5/2, ... of 1/T, which would move through a floor's modes as the
mass changes, and make a landing seem quiet by accident.

The force drives the floor's modes, each with the response to an impulse

    h_n(t) = a_n exp(-d_n t) (cos w_n t - d_n / w_n sin w_n t),    d_n = ln(1000) / T60_n,

the modal form of van den Doel and Pai (The sounds of physical shapes, Presence 7(4), 1998; with
Kry, FoleyAutomatic, SIGGRAPH 2001) with the one phase that radiates nothing at 0 Hz: its transfer
function is a_n s / ((s + d_n)^2 + w_n^2). The pressure at the distance r is g / r sum_n h_n * F,
r/c later, with g the floor's calibration gain: exactly proportional to the landing speed. It hardly
goes with the mass: far above 1/T the spectrum of the force is that of its onset, whose slope is
that of k v t.
"""

from __future__ import annotations

from math import ceil

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mute.acoustics.contacts import ContactBlock
from mute.acoustics.floors import Floor, Mode
from mute.acoustics.microphone import SPEED_OF_SOUND, distance
from mute.acoustics.sources.band_noise import Stream

__all__ = [
    "ImpactSound",
    "contact_time",
    "floor_modes",
    "mode_filter",
    "pulse_force",
    "pulse_spectrum",
]

LN_1000 = float(np.log(1e3))
"""A fall by 60 dB in amplitude, as an exponent."""

_PULSE_SAMPLES = 1 << 22
"""Most samples of pulses that are computed at a time, which bounds the memory."""


def contact_time(mass: ArrayLike, floor: Floor) -> NDArray[np.float64]:
    """Return the duration of contact of an effective mass, pi sqrt(m / k), s.

    Args:
        mass: Effective mass, kg. Any shape.
        floor: What it falls on.
    """
    return _contact_time(np.asarray(mass, dtype=np.float64), floor.contact_stiffness)


def _contact_time(mass: NDArray, stiffness: ArrayLike) -> NDArray[np.float64]:
    """Return the same of the stiffness k, N/m; shapes broadcast."""
    return np.pi * np.sqrt(mass / stiffness)


def pulse_force(
    time: NDArray, onset: NDArray, duration: NDArray, restitution: NDArray, sample_rate: int
) -> NDArray:
    """Return the pulse of unit impulse, N, as means over the sample intervals.

    The mean over the interval that ends at each time is taken, not the value: so the samples' sum
    over the sample rate is the impulse exactly, however short the pulse and wherever it begins.

    Args:
        time: Sample times, s. Shapes broadcast.
        onset: Beginning of the pulse, s.
        duration: T, s.
        restitution: e, above 0.
        sample_rate: Hz.
    """
    elapsed = (time - onset) / duration
    end = _impulse_until(elapsed, restitution)
    return sample_rate * (
        end - _impulse_until(elapsed - 1.0 / (sample_rate * duration), restitution)
    )


def _impulse_until(elapsed: NDArray, restitution: NDArray) -> NDArray:
    """Return the share of the impulse that has passed after a share of the contact time."""
    share = np.clip(elapsed, 0.0, 1.0)
    decay = -np.log(restitution) / np.pi  # b T / pi
    angle = np.pi * share
    left = np.exp(-decay * angle) * (np.cos(angle) + decay * np.sin(angle))
    return (1.0 - left) / (1.0 + restitution)


def pulse_spectrum(
    frequency: NDArray, duration: NDArray, restitution: float
) -> NDArray[np.complex128]:
    """Return the Fourier transform of the pulse of unit impulse. Shapes broadcast.

    Args:
        frequency: Hz.
        duration: T, s.
        restitution: e, above 0.
    """
    decay = -np.log(restitution)
    exponent = decay + 2j * np.pi * frequency * duration  # (b + i omega) T
    shape = (1.0 + np.exp(-exponent)) / (exponent**2 + np.pi**2)
    return shape * (decay**2 + np.pi**2) / (1.0 + restitution)


def mode_filter(mode: Mode, sample_rate: int) -> tuple[NDArray, NDArray]:
    """Return a mode as a digital filter b, a from force, N, to pressure times distance, Pa m.

    By the matched z-transform: the poles are exact, so frequency and decay are, the zeros lie at
    0 Hz and half the sample rate; the gain at the mode's frequency is that of the analogue mode.

    Args:
        mode: The mode, below half the sample rate.
        sample_rate: Hz.
    """
    damping = LN_1000 / mode.decay_time
    omega = 2.0 * np.pi * mode.frequency
    radius, angle = np.exp(-damping / sample_rate), omega / sample_rate
    a = np.array([1.0, -2.0 * radius * np.cos(angle), radius**2])
    b = np.array([1.0, 0.0, -1.0])
    unit = np.exp(-1j * angle * np.arange(3))
    analogue = mode.gain * omega / abs(damping**2 + 2j * damping * omega)
    return b * (analogue / abs((b @ unit) / (a @ unit))), a


def floor_modes(floor: Floor, sample_rate: int) -> list[tuple[NDArray, NDArray]]:
    """Return the filters of all modes that the sample rate can carry, to be summed."""
    heard = (mode for mode in floor.modes if mode.frequency < 0.45 * sample_rate)
    return [mode_filter(mode, sample_rate) for mode in heard]


class ImpactSound:
    """The sound of landings, streamed; pulses reach over the ends of blocks."""

    def __init__(
        self, num_robots: int, floors: tuple[Floor, ...], gains: NDArray, sample_rate: int
    ) -> None:
        """Start in silence.

        Args:
            num_robots: Number of robots.
            floors: The recording's floors.
            gains: Calibration gain of each floor. Shape: (floors,).
            sample_rate: Hz.
        """
        self._num_robots = num_robots
        self._sample_rate = sample_rate
        self._gains = gains
        self._restitution = np.array([floor.restitution for floor in floors])
        self._stiffness = np.array([floor.contact_stiffness for floor in floors])
        self._banks = [
            [Stream(b, a, num_robots) for b, a in floor_modes(floor, sample_rate)]
            for floor in floors
        ]
        # Pulses that have not ended: onset at the microphone, duration, impulse / distance, e.
        self._pulses = np.zeros((0, 4))
        self._owners = np.zeros((0, 2), dtype=np.int64)  # robot and floor of each

    def render(self, block: ContactBlock, microphone: NDArray, bounds: NDArray) -> NDArray:
        """Return the block's pressure, Pa. Shape: (robots, samples).

        Args:
            block: Physics.
            microphone: Where it is, m. Shape: (steps, robots, 3).
            bounds: Sample at which each step begins, and the end of the last. Shape: (steps + 1,).
        """
        self._add(block, microphone)
        first, stop = int(bounds[0]), int(bounds[-1])
        out = np.zeros((self._num_robots, stop - first))
        for floor, bank in enumerate(self._banks):
            struck = self._owners[:, 1] == floor
            ringing = bank[0].busy()
            ringing[self._owners[struck, 0]] = True
            rows = np.flatnonzero(ringing)
            if len(rows):
                force = self._force(struck, first, stop)[rows]
                out[rows] += sum(mode.filter(force, rows) for mode in bank)
        going = self._pulses[:, 0] + self._pulses[:, 1] > (stop - 1) / self._sample_rate
        self._pulses, self._owners = self._pulses[going], self._owners[going]
        return out

    def _add(self, block: ContactBlock, microphone: NDArray) -> None:
        """Take up the landings of a block."""
        impacts = block.impacts
        apart = distance(impacts.position, microphone[block.impact_steps(), impacts.robot])
        restitution = self._restitution[impacts.floor]
        impulse = (1.0 + restitution) * impacts.mass * impacts.speed
        pulses = np.stack(
            (
                impacts.time + apart / SPEED_OF_SOUND,
                _contact_time(impacts.mass, self._stiffness[impacts.floor]),
                self._gains[impacts.floor] * impulse / apart,
                restitution,
            ),
            axis=1,
        )
        owners = np.stack((impacts.robot, impacts.floor), axis=1).astype(np.int64)
        heard = pulses[:, 2] > 0.0
        self._pulses = np.concatenate((self._pulses, pulses[heard]))
        self._owners = np.concatenate((self._owners, owners[heard]))

    def _force(self, which: NDArray, first: int, stop: int) -> NDArray:
        """Return some pulses' force over distance, N/m. Shape: (robots, stop - first)."""
        samples = stop - first
        pulses, robots = self._pulses[which], self._owners[which, 0]
        force = np.zeros(self._num_robots * samples)
        if not len(pulses):
            return force.reshape(self._num_robots, samples)
        begin = np.floor(pulses[:, 0] * self._sample_rate).astype(np.int64) + 1
        begin = np.clip(begin - first, 0, samples)
        length = min(samples, ceil(pulses[:, 1].max() * self._sample_rate) + 1)
        group = max(1, _PULSE_SAMPLES // length)
        for start in range(0, len(pulses), group):
            some = slice(start, start + group)
            index = begin[some, None] + np.arange(length)
            onset, duration, impulse, e = pulses[some, :, None].transpose(1, 0, 2)
            value = impulse * pulse_force(
                (first + index) / self._sample_rate, onset, duration, e, self._sample_rate
            )
            inside = index < samples
            flat = (robots[some, None] * samples + index)[inside]
            force += np.bincount(flat, weights=value[inside], minlength=len(force))
        return force.reshape(self._num_robots, samples)
