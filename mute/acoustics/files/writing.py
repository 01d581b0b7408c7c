"""A WAV file that is written as its sound is made, in memory that does not grow.

The header is written here, not by soundfile: a disk that is full must be told as one line, and
libsndfile says nothing of a header that it cannot complete.
"""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mute.support.errors import MuteError

__all__ = ["WavWriter", "has_samples"]

_MOST_SAMPLES = 43200 * 48000
"""Samples at which a file ends though the walk goes on: it holds 4 GiB, 12 hours at 48 kHz."""

_HEADER_BYTES = 44
"""Length of what is before the samples."""


class WavWriter:
    """A mono WAV file of 16 bits that grows as samples come; what came is whole after `close`."""

    def __init__(self, path: Path, sample_rate: int, full_scale: float) -> None:
        """Open the file.

        Args:
            path: Of the file; its directory is made.
            sample_rate: Hz.
            full_scale: Sound pressure of the largest sample, Pa.

        Raises:
            MuteError: If it cannot be written.
        """
        self.path = path
        self.clipped = 0
        """Samples beyond full scale, cut off."""
        self._sample_rate = sample_rate
        self._full_scale = full_scale
        self._samples = 0
        with self._told():
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = path.open("wb")
            self._file.write(self._header())

    def write(self, pressure: NDArray) -> None:
        """Append samples in Pa, up to the longest that a file can be. Shape: (samples,).

        Raises:
            MuteError: If they cannot be written.
        """
        pressure = pressure[: _MOST_SAMPLES - self._samples]
        self._samples += len(pressure)
        scaled = np.rint(pressure * (32767.0 / self._full_scale))
        self.clipped += int(np.count_nonzero(np.abs(scaled) > 32767.0))
        with self._told():
            self._file.write(np.clip(scaled, -32767.0, 32767.0).astype("<i2").tobytes())

    def close(self) -> None:
        """Complete the file.

        Raises:
            MuteError: If it cannot be written.
        """
        # Not with `wave`, which would leave a traceback behind where the file cannot be completed.
        with self._told(), self._file:
            self._file.seek(0)
            self._file.write(self._header())

    def _header(self) -> bytes:
        length = 2 * self._samples
        return struct.pack(
            "<4sI4s4sIHHIIHH4sI",
            *(b"RIFF", _HEADER_BYTES - 8 + length, b"WAVE"),
            *(b"fmt ", 16, 1, 1, self._sample_rate, 2 * self._sample_rate, 2, 16),
            *(b"data", length),
        )

    @contextlib.contextmanager
    def _told(self) -> Iterator[None]:
        """Turn what the system says of the file into one line."""
        try:
            yield
        except OSError as error:
            raise MuteError(f"cannot write {self.path}: {error.strerror}") from error


def has_samples(path: Path) -> bool:
    """Tell whether a WAV file that was written here holds any sample."""
    return path.stat().st_size > _HEADER_BYTES
