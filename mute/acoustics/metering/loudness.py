"""Zwicker loudness in sone, from the library MOSQITO if it is installed.

The method for sounds that vary in time of ISO 532-1:2017, in a free field. An optional extra,
`pip install 'mute[loudness]'`; everything else works without it. It takes the whole signal at once
and several times its length, so it is for recordings of seconds to minutes.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from mute.support.errors import MuteError

__all__ = ["Loudness", "zwicker_loudness"]

_SAMPLE_RATE = 48000
"""The one rate that the library takes, Hz."""

_SHORTEST = 0.01
"""Shortest sound of which a loudness is taken, s: a few of the library's steps of 2 ms."""


@dataclass(frozen=True)
class Loudness:
    """Loudness of a sound."""

    n5: float
    """Exceeded for 5 % of the time, sone: what ISO 532-1 gives as that of a varying sound."""
    maximum: float
    """Largest, sone."""


def zwicker_loudness(pressure: NDArray, sample_rate: int) -> Loudness:
    """Return the loudness of a sound.

    Args:
        pressure: Pa. Shape: (samples,).
        sample_rate: Hz.

    Raises:
        MuteError: If MOSQITO is not installed.
        ValueError: If the sound is too short, or louder than the method allows: 120 dB in a third
            octave up to 250 Hz.
    """
    method = _find_method()
    if len(pressure) < _SHORTEST * sample_rate:
        raise ValueError(
            f"a sound of {_SHORTEST:g} s or more is needed, got {len(pressure) / sample_rate:.4f} s"
        )
    if sample_rate != _SAMPLE_RATE:
        common = math.gcd(sample_rate, _SAMPLE_RATE)
        pressure = signal.resample_poly(pressure, _SAMPLE_RATE // common, sample_rate // common)
    over_time, *_ = method(pressure, _SAMPLE_RATE, field_type="free")
    return Loudness(n5=float(np.percentile(over_time, 95.0)), maximum=float(np.max(over_time)))


def _find_method() -> Callable[..., Any]:
    try:
        return importlib.import_module("mosqito").loudness_zwtv
    except ImportError as error:
        raise MuteError(
            f"loudness needs the library mosqito ({error}): pip install 'mute[loudness]'"
        ) from error
