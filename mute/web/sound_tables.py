"""What the page's sound needs of Python: all that does not depend on the walk, as tables.

The page (`web/src/sound/`) makes the same sound as `mute.acoustics` as it goes, sample by sample.
What is worked out here once are the laws that it looks up: how blows press, how plates ring, how
the drive's forces come through, and the filters of noise and meter. Plates are told as the tones
that they ring with, which the page plays one by one, at the sample rate or at a fraction of it.
"""

from __future__ import annotations

import json
from math import sqrt
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from mute.acoustics.air import AIR_DENSITY, AIR_IMPEDANCE, SPEED_OF_SOUND
from mute.acoustics.body import SHELL, SHELL_PANELS, load_transmissibility
from mute.acoustics.floors import FLOORS, Floor
from mute.acoustics.listener import WAV_FULL_SCALE
from mute.acoustics.metering.levels import (
    P_REF,
    READINGS_PER_SECOND,
    TIME_CONSTANTS,
    settling_time,
)
from mute.acoustics.metering.weighting import a_weighting_sos
from mute.acoustics.microphone import MIN_DISTANCE, TRUNK_OFFSET
from mute.acoustics.physics.contact import YIELDS, blow_table
from mute.acoustics.physics.plate import UNDERLAY_LOSS, Plate
from mute.acoustics.physics.ringing import OCTAVES, Tones, ringing_energy, ringing_tones
from mute.acoustics.sources import drive, landings
from mute.acoustics.sources.band_noise import band_a_weight, band_filter, filter_response
from mute.acoustics.sources.fan import FAN_BAND, FAN_LEVEL
from mute.acoustics.sources.halves import TAPS, interpolator
from mute.acoustics.sources.response import PLACES, modes_seed
from mute.acoustics.sources.scuffing import SCUFF_BAND, SCUFF_EFFICIENCY
from mute.acoustics.sources.shell import NUM_FEET, SIDES
from mute.envs.scene import FOOT_RADIUS
from mute.evaluation.noise_levels import SETTLE_TIME

__all__ = ["FORMAT", "packed", "sound_tables"]

FORMAT = 2
"""Version of the tables' layout; the page refuses any other."""

SAMPLE_RATE = 48000
"""Hz."""

_TIERS = ((8, 5), (4, 7), (2, 7))
"""Fractions of the sample rate at which tones ring, as divisors, and the octave at which each ends:
so no tone is above a quarter of its rate. What feet and gears make a plate ring with above the last
octave, above 2.8 kHz, is some 20 dB and more below the noise of fan and soles there, and would take
half of the page's time for sound."""

_BRIEF = 0.02
"""Decay below which a tone rings in the last tier, s: it is over soon, and broad."""

_DISTANCES = np.geomspace(MIN_DISTANCE, 20.0, 48)
"""At which it is tabulated how a plate is heard, m."""


def sound_tables() -> dict[str, Any]:
    """Return the tables as nested dicts and lists of numbers, strings and float arrays.

    `packed` makes of them what the page loads, `sound.json` and `sound.bin` beside each other;
    `web/src/sound/tables.ts` says what each is, and of what shape.
    """
    laws = sorted({(floor.contact.exponent, floor.contact.damping) for floor in FLOORS.values()})
    return {
        "format": FORMAT,
        "sample_rate": SAMPLE_RATE,
        "full_scale": WAV_FULL_SCALE,
        "air": {"speed_of_sound": SPEED_OF_SOUND, "impedance": AIR_IMPEDANCE},
        "tiers": [_tier_table(divisor) for divisor, _ in _TIERS],
        "landing": {
            "foot_radius": FOOT_RADIUS,
            "faintest": landings.FAINTEST,
            "place_size": landings.PLACE_SIZE,
        },
        "contact_laws": [_law_table(*law) for law in laws],
        "floors": {
            name: _floor_table(floor, laws.index((floor.contact.exponent, floor.contact.damping)))
            for name, floor in FLOORS.items()
        },
        "shell": {
            "transmissibility": load_transmissibility(),
            "sides": SIDES,
            "plate": _plate_table(SHELL, "body"),
        },
        "drive": {
            "inertia": drive.INERTIA,
            "backlash": drive.BACKLASH,
            "stiffness": drive.STIFFNESS,
            "lever": drive.LEVER,
            "tone_periods": np.stack([periods for periods, _ in drive.TONES]),
            "tone_shares": [share for _, share in drive.TONES],
        },
        "fan": {
            # Of a fan that is heard from 1 m.
            "mean_square": P_REF**2
            * 10.0 ** (FAN_LEVEL / 10.0)
            * sum(own**2 for own in TRUNK_OFFSET)
            / band_a_weight(FAN_BAND, SAMPLE_RATE),
            "filter": _section(*band_filter(FAN_BAND, SAMPLE_RATE)),
        },
        "scuffing": {
            "efficiency": SCUFF_EFFICIENCY,
            "filter": _section(*band_filter(SCUFF_BAND, SAMPLE_RATE)),
        },
        "microphone": {"offset": list(TRUNK_OFFSET), "min_distance": MIN_DISTANCE},
        "meter": {
            "reference": P_REF,
            "a_weighting": a_weighting_sos(SAMPLE_RATE).tolist(),
            "time_constant": TIME_CONSTANTS["fast"],
            "readings_per_second": READINGS_PER_SECOND,
            "settling": settling_time("fast"),
            "settle_time": SETTLE_TIME,
        },
    }


def packed(tables: dict[str, Any]) -> tuple[str, bytes]:
    """Return tables as JSON and the binary file of their arrays.

    In the JSON an array is `{"shape": [...], "offset": number}`, the place of its first number in
    the binary file, which holds float32 numbers, least significant byte first. Lists stay as they
    are, in full precision: filters need it.
    """
    chunks: list[bytes] = []
    numbers = 0

    def plain(value: object) -> object:
        nonlocal numbers
        if isinstance(value, dict):
            return {str(name): plain(own) for name, own in value.items()}
        if isinstance(value, list):
            return [plain(own) for own in value]
        if isinstance(value, np.ndarray):
            reference = {"shape": list(value.shape), "offset": numbers}
            chunks.append(_bytes(value))
            numbers += value.size
            return reference
        return value

    return json.dumps(plain(tables), allow_nan=False), b"".join(chunks)


def _bytes(array: NDArray) -> bytes:
    if not np.isfinite(array).all():
        raise ValueError("a table of sound must be finite")
    return np.ascontiguousarray(array, dtype="<f4").tobytes()


def _section(b: NDArray, a: NDArray) -> list[float]:
    """Return a filter of the second order as scipy writes its sections."""
    return [*b.tolist(), *a.tolist()]


def _law_table(exponent: float, damping: float) -> dict[str, Any]:
    """Return all blows of a law, over the relative mobility of the ground."""
    table = blow_table(exponent, damping)
    return {
        "yields": YIELDS,
        "duration": table.duration,
        "impulse": table.impulse,
        "passed": table.passed,
    }


def _floor_table(floor: Floor, law: int) -> dict[str, Any]:
    return {
        "law": law,
        "stiffness": floor.contact.stiffness,
        "exponent": floor.contact.exponent,
        "mobility": floor.contact.mobility,
        "friction": floor.friction,
        "solref": list(floor.solref),
        "colour": list(floor.colour),
        "plate": _plate_table(floor.plate, "floor"),
    }


def _plate_table(plate: Plate, form: Literal["floor", "body"]) -> dict[str, Any]:
    """Return what a plate makes of a force, see `sources.response.PlateResponse`."""
    body = form == "body"
    drawn = ringing_tones(
        plate, SAMPLE_RATE, PLACES, modes_seed(plate), body, SHELL_PANELS if body else 1
    )
    bands = [tones for tones in drawn if tones.band // 3 < _TIERS[-1][1]]
    return {
        "direct_gain": AIR_DENSITY / (2.0 * np.pi * plate.surface_mass),
        "direct": _direct_sections(plate),
        "after": _high_pass(plate.first_mode) if body else [],
        "octaves": [tones.band // 3 for tones in bands],
        "counts": [len(tones.frequency) for tones in bands],
        "decays": [tones.decay for tones in bands],
        "tiers": [_tier(tones) for tones in bands],
        "frequencies": np.concatenate([tones.frequency for tones in bands]),
        "strengths": np.concatenate(
            [_strengths(plate, tones, even=body)[: NUM_FEET if body else None] for tones in bands],
            axis=1,
        ),
        "distances": _DISTANCES,
        "spread": _spread(plate, body),
    }


def _direct_sections(plate: Plate) -> list[list[float]]:
    """Return the filter of what is radiated at once, up to its gain.

    Where a plate floats, its underlay's loss is taken to be a dashpot's, which begins with the blow
    and not before; at the resonance and far from it both are the same.
    """
    # Nothing is heard near half the sample rate, where the corner of a light plate would lie.
    corner = min(plate.critical_frequency, 0.45 * SAMPLE_RATE)
    low = signal.butter(2, corner, "lowpass", output="sos", fs=SAMPLE_RATE)
    sections = np.asarray(low).tolist()
    floating = 2.0 * np.pi * plate.floating_frequency
    if floating > 0.0:
        loss = UNDERLAY_LOSS * floating
        b, a = signal.bilinear([1.0, 0.0, 0.0], [1.0, loss, floating**2], SAMPLE_RATE)
        sections.append(_section(np.asarray(b), np.asarray(a)))
    return sections


def _high_pass(corner: float) -> list[list[float]]:
    """Return what the size of a body leaves of its sound."""
    return np.asarray(signal.butter(2, corner, "highpass", output="sos", fs=SAMPLE_RATE)).tolist()


def _strengths(plate: Plate, tones: Tones, even: bool) -> NDArray[np.float64]:
    """Return the strength of tones at each place, such that a band holds what the plate radiates.

    As `physics.ringing.ringing_responses`, but that a tone rings to its end.

    Shape: (places, tones).
    """
    present = _energy(tones)[:, None]
    if not even:
        present = present.mean(keepdims=True)
    strength = tones.strength * np.sqrt(ringing_energy(plate, tones.band) / present)
    return strength / _lost(tones.frequency, _TIERS[_tier(tones)][0])


def _energy(tones: Tones) -> NDArray[np.float64]:
    """Return the integral of the square of what rings at each place. Shape: (places,).

    As of samples, of which the first is halved, as it lies on a jump.
    """
    fall = 2.0 * np.log(1e3) / tones.decay
    turn = 2.0 * np.pi * tones.frequency

    def integral(turn: NDArray, phase: NDArray) -> NDArray:
        """Return that of exp(-fall t) cos(turn t + phase)."""
        return (fall * np.cos(phase) - turn * np.sin(phase)) / (fall**2 + turn**2)

    pairs = 0.5 * (
        integral(np.subtract.outer(turn, turn), np.subtract.outer(tones.phase, tones.phase))
        - integral(np.add.outer(turn, turn), np.add.outer(tones.phase, tones.phase))
    )
    whole = np.einsum("pi,ij,pj->p", tones.strength, pairs, tones.strength)
    # A sum of samples is the integral and half of the first; a quarter of it is left.
    return whole - 0.25 * np.square(tones.strength @ np.sin(tones.phase)) / SAMPLE_RATE


def _tier(tones: Tones) -> int:
    """Return the index of the tier that tones ring in."""
    if tones.decay < _BRIEF:
        return len(_TIERS) - 1
    return next(tier for tier, (_, end) in enumerate(_TIERS) if tones.band // 3 < end)


def _lost(frequency: NDArray[np.float64], divisor: int) -> NDArray[np.float64]:
    """Return what a lower rate loses of tones: by means over samples, and on the way up."""
    turn = 2.0 * np.pi * frequency / SAMPLE_RATE
    between = filter_response(interpolator(divisor) / divisor, np.ones(1), turn)
    return np.sinc(frequency * divisor / SAMPLE_RATE) * np.abs(between)


def _tier_table(divisor: int) -> dict[str, Any]:
    return {
        "divisor": divisor,
        "taps": TAPS,
        # Of the filter between samples, and of forces, which are means over the time before each.
        "late": (TAPS + 1) * divisor // 2 - 1,
        "interpolator": interpolator(divisor).tolist(),
    }


def _spread(plate: Plate, body: bool) -> NDArray[np.float64]:
    """Return the root of p^2 over what rings, times the distance. Shape: (distances, octaves).

    That changes little with the distance, so that few of them do.
    """
    apart = _DISTANCES[:, None]
    if body:
        return np.full((len(_DISTANCES), len(OCTAVES)), 1.0 / sqrt(2.0 * np.pi))
    return np.sqrt(plate.spread(OCTAVES, apart)) * apart
