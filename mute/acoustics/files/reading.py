"""WAV files read in blocks by soundfile, so that a long recording needs little memory.

Reads integer PCM of 8 to 32 bits, float of 32 and 64 bits, A-law and mu-law, of any number of
channels, and scales all of them so that full scale is 1. What such a number is in Pa is not in the
file. Whatever is broken is refused with one line that names the file and what is wrong with it, or
read with a warning. Headers are read by `layout`, samples by libsndfile.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Literal, Self

import numpy as np
import soundfile
from numpy.typing import NDArray

from mute.acoustics.files.layout import BEGINNINGS, SampleBytes, find_layout
from mute.acoustics.files.opening import open_seekable
from mute.support.errors import MuteError

__all__ = ["WavReader", "read_wav"]

_SAMPLES_AT_ONCE = 1 << 18
"""Samples of all channels in a block: bounds the memory."""

_BYTES_AT_ONCE = 1 << 18
"""Bytes that are read at a time: libsndfile asks for few."""

_LARGEST = float(np.finfo(np.float32).max)
"""Largest sample that is read: beyond it, sums of squares could overflow."""

_LARGEST_CODES = {"ULAW": 32124 / 32768, "ALAW": 32256 / 32768}
"""Largest samples of encodings that do not reach full scale (ITU-T G.711)."""

_ALSA_BITS, _ALSA_BYTES = 24, 4
"""What ALSA calls S24_LE, which `arecord` writes: the low three bytes of four."""


class WavReader:
    """An open WAV file, or one that comes through a pipe.

    Example:
        with WavReader(path) as wav:
            for block in wav.blocks():
                ...
    """

    def __init__(self, path: Path, sample_rates: tuple[int, int] = (1, 2**31 - 1)) -> None:
        """Open a file and read its header.

        Args:
            path: Of the file or pipe; a pipe is read to its end.
            sample_rates: Lowest and highest that are allowed, Hz.

        Raises:
            MuteError: If there is no such file, it is no WAV file that can be read, or its sample
                rate is not allowed.
        """
        self.path = path
        with contextlib.ExitStack() as opened:
            file = opened.enter_context(open_seekable(path, BEGINNINGS))
            try:
                layout = find_layout(file, path)
            except OSError as error:
                raise MuteError(f"{path}: cannot be read: {error.strerror}") from error
            self._format = layout.format
            low, high = sample_rates
            if not low <= self.sample_rate <= high:
                raise MuteError(
                    f"{path}: sample rate {self.sample_rate} Hz, must be {low} to {high} Hz"
                )
            self._bytes = SampleBytes(file, layout)
            self._sound = opened.enter_context(
                soundfile.SoundFile(
                    io.BufferedReader(self._bytes, _BYTES_AT_ONCE),
                    samplerate=self.sample_rate,
                    channels=self.channels,
                    subtype=self._format.subtype,
                    endian="BIG" if self._format.big_endian else "LITTLE",
                    format="RAW",
                )
            )
            self.frames = self._sound.frames
            """Samples a channel."""
            self.warnings = list(layout.warnings)
            """What a user must know about the file, one line each."""
            self._shift = self._find_shift()
            self._closing = opened.pop_all()
        self.clipped = np.zeros(self.channels, dtype=np.int64)
        """Samples at full scale in the blocks that were read. Shape: (channels,)."""
        self.peak = np.zeros(self.channels)
        """Largest magnitude in the blocks that were read. Shape: (channels,)."""

    @property
    def channels(self) -> int:
        """Number of channels."""
        return self._format.channels

    @property
    def sample_rate(self) -> int:
        """Samples a second."""
        return self._format.sample_rate

    @property
    def is_float(self) -> bool:
        """Whether samples are floating-point numbers, which can go beyond full scale."""
        return self._format.subtype in ("FLOAT", "DOUBLE")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._closing.close()

    def blocks(
        self, length: int | None = None, begin: int = 0, end: int | None = None
    ) -> Iterator[NDArray[np.float64]]:
        """Yield the samples, or a part of them; `clipped` and `peak` begin anew.

        Args:
            length: Samples a channel in each block but the last. Default: what memory bears.
            begin: Number of the first sample, from 0.
            end: Number after that of the last, <= `frames`. Default: the end of the recording.

        Yields:
            Samples, full scale is 1. Shape: (channels, <= length).

        Raises:
            MuteError: If a sample is no number or above `_LARGEST`, or the file cannot be read to
                its end.
        """
        self.clipped[:], self.peak[:] = 0, 0.0
        done = begin
        dtype = "int32" if self._shift else "float64"
        for raw in self._raw_blocks(dtype, length, begin, end):
            block = np.left_shift(raw, self._shift) / 2.0**31 if self._shift else raw
            self._refuse_unmeasurable(block, done)
            self.clipped += self._at_full_scale(block)
            np.maximum(self.peak, np.abs(block).max(axis=1), out=self.peak)
            yield block
            done += block.shape[1]

    def _raw_blocks(
        self,
        dtype: Literal["float64", "int32"],
        length: int | None = None,
        begin: int = 0,
        end: int | None = None,
    ) -> Iterator[NDArray]:
        """Yield the samples as soundfile converts them. Shape: (channels, <= length)."""
        length = length or max(_SAMPLES_AT_ONCE // self.channels, 1)
        stop: int = self.frames if end is None else end
        for first in range(begin, stop, length):
            wanted = min(length, stop - first)
            self._sound.seek(first)
            frames = self._sound.read(wanted, dtype=dtype, always_2d=True)
            if self._bytes.error:
                raise MuteError(f"{self.path}: cannot be read: {self._bytes.error.strerror}")
            if len(frames) < wanted:
                raise MuteError(f"{self.path}: truncated while it was read")
            yield frames.T

    def _find_shift(self) -> int:
        """Return by how many bits integers must be shifted up, so that they fill their bytes.

        The samples tell on which side the bits lie that are not in use: those below a sample are
        zero (which the format's specification asks for), those above it repeat its sign or are
        zero. Samples that would go with both are quiet or coarse; then they lie where ALSA puts
        24 bits in 4 bytes, and otherwise where the specification does.

        Raises:
            MuteError: If the samples go with neither.
        """
        spare = self._format.spare_bits
        if spare == 0:
            return 0
        unused_below = (1 << spare) - 1 << 32 - 8 * self._format.sample_bytes
        high = signed = unsigned = True
        for block in self._raw_blocks("int32"):
            high = high and not np.any(block & unused_below)
            top = block >> 31 - spare  # with the sample's own sign
            signed = signed and bool(np.all((top == 0) | (top == -1)))
            unsigned = unsigned and not np.any(block >> 32 - spare)
        low = signed or unsigned
        bits, sample_bytes = self._format.bits, self._format.sample_bytes
        where = f"{self.path}: {bits} bits in {sample_bytes} bytes"
        if not (low or high):
            raise MuteError(f"{where}, but its samples use them all")
        take_low = low if not high else low and (bits, sample_bytes) == (_ALSA_BITS, _ALSA_BYTES)
        if low and high:
            side = "low" if take_low else "high"
            self.warnings.append(f"{where} may lie low or high in them, taken to lie {side}")
        return spare if take_low else 0

    def _refuse_unmeasurable(self, block: NDArray[np.float64], done: int) -> None:
        measurable = np.abs(block) <= _LARGEST  # which NaN is not
        if measurable.all():
            return
        channel, sample = np.argwhere(~measurable)[0]
        raise MuteError(
            f"{self.path}: sample {done + sample} of channel {channel + 1} is "
            f"{block[channel, sample]}, not a number that can be measured"
        )

    def _at_full_scale(self, block: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return how many samples have a value at which converters clip. Shape: (channels,)."""
        if self.is_float:  # which can go on beyond 1, so only 1 itself is suspicious
            return np.count_nonzero(np.abs(block) == 1.0, axis=1)
        largest = _LARGEST_CODES.get(self._format.subtype)
        if largest is not None:
            return np.count_nonzero(np.abs(block) >= largest, axis=1)
        largest = 1.0 - 2.0 ** (1 - self._format.bits)
        return np.count_nonzero((block >= largest) | (block <= -1.0), axis=1)


def read_wav(path: Path) -> tuple[NDArray[np.float64], int]:
    """Return all samples of a WAV file, full scale is 1, and its sample rate in Hz.

    Returns:
        Samples, shape: (channels, samples), and the sample rate.

    Raises:
        MuteError: If there is no such file, it is no WAV file that can be read, or holds a NaN.
    """
    with WavReader(path) as wav:
        return np.concatenate(list(wav.blocks()), axis=1), wav.sample_rate
