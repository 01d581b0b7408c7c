"""WAV files, in and out: read in blocks, so that a long recording needs little memory.

Reads integer PCM of 8, 16, 24 and 32 bits and float of 32 and 64 bits, of any number of channels,
and scales all of them so that full scale is 1. What such a number is in Pa is not in the file.
Whatever is broken is refused with one line that names the file and what is wrong with it.

Layout: Microsoft and IBM, Multimedia Programming Interface and Data Specifications 1.0 (1991), and
Microsoft's WAVEFORMATEXTENSIBLE.
"""

from __future__ import annotations

import math
import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Literal, Self

import numpy as np
from numpy.typing import NDArray

from mute.support.errors import MuteError
from mute.support.files import replace_file

__all__ = [
    "PCM",
    "WavEncoding",
    "WavFormat",
    "WavReader",
    "has_samples",
    "read_wav",
    "wav_header",
    "write_wav",
]

WavEncoding = Literal["float32", "int16", "int24"]
"""Encodings that are written."""

PCM, _FLOAT, _EXTENSIBLE = 1, 3, 0xFFFE
_READABLE = {(PCM, 8), (PCM, 16), (PCM, 24), (PCM, 32), (_FLOAT, 32), (_FLOAT, 64)}
_UNTIL_THE_END = 0xFFFFFFFF
"""Length in the header of a file that was written to a pipe."""

_FORMAT_BYTES = 40
"""Length of the longest format chunk that is understood here."""

_BLOCK = 1 << 16
"""Samples a channel in a block."""

_LARGEST = float(np.finfo(np.float32).max)
"""Largest sample that is read: beyond it, sums of squares could overflow."""


@dataclass(frozen=True)
class WavFormat:
    """How the samples of a file are stored."""

    code: int
    channels: int
    sample_rate: int
    bits: int
    """Bits that a sample takes."""
    valid_bits: int
    """Of these, bits that hold the sample."""

    @property
    def frame_bytes(self) -> int:
        """Bytes of one sample of every channel."""
        return self.channels * self.bits // 8


class WavReader:
    """An open WAV file.

    Example:
        with WavReader(path) as wav:
            for block in wav.blocks():
                ...
    """

    def __init__(self, path: Path) -> None:
        """Open a file and read its header.

        Raises:
            MuteError: If there is no such file, or it is not a whole WAV file.
        """
        self.path = path
        try:
            self._file = path.open("rb")
        except FileNotFoundError:
            raise MuteError(f"no file at {path}") from None
        except OSError as error:
            raise MuteError(f"{path}: cannot be read: {error.strerror}") from error
        try:
            self._format, self.frames = _read_header(self._file, path)
        except BaseException:
            self._file.close()
            raise
        self.clipped = np.zeros(self.channels, dtype=np.int64)
        """Samples at full scale in the blocks that were read. Shape: (channels,)."""

    @property
    def channels(self) -> int:
        """Number of channels."""
        return self._format.channels

    @property
    def sample_rate(self) -> int:
        """Samples a second."""
        return self._format.sample_rate

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._file.close()

    def blocks(self, length: int = _BLOCK) -> Iterator[NDArray[np.float64]]:
        """Yield the samples in turn; the file can be gone through once.

        Args:
            length: Samples a channel in each block but the last.

        Yields:
            Samples, full scale is 1. Shape: (channels, <= length).

        Raises:
            MuteError: If a sample is no number or above `_LARGEST`, or the file has become shorter.
        """
        done = 0
        while done < self.frames:
            frames = min(length, self.frames - done)
            data = self._file.read(frames * self._format.frame_bytes)
            if len(data) < frames * self._format.frame_bytes:
                raise MuteError(f"{self.path}: truncated while it was read")
            block = _decode(data, self._format).reshape(frames, self.channels).T
            self._refuse_unmeasurable(block, done)
            self.clipped += _at_full_scale(block, self._format)
            yield block
            done += frames

    def _refuse_unmeasurable(self, block: NDArray[np.float64], done: int) -> None:
        measurable = np.abs(block) <= _LARGEST  # which NaN is not
        if measurable.all():
            return
        channel, sample = np.argwhere(~measurable)[0]
        raise MuteError(
            f"{self.path}: sample {done + sample} of channel {channel + 1} is "
            f"{block[channel, sample]}, not a number that can be measured"
        )


def read_wav(path: Path) -> tuple[NDArray[np.float64], int]:
    """Return all samples of a WAV file, full scale is 1, and its sample rate in Hz.

    Returns:
        Samples, shape: (channels, samples), and the sample rate.

    Raises:
        MuteError: If there is no such file, it is not a whole WAV file, or holds a NaN.
    """
    with WavReader(path) as wav:
        return np.concatenate(list(wav.blocks()), axis=1), wav.sample_rate


def has_samples(path: Path) -> bool:
    """Tell whether a WAV file that was written here holds any sample."""
    header = wav_header(WavFormat(PCM, channels=1, sample_rate=1, bits=8, valid_bits=8), 0)
    return path.stat().st_size > len(header)


def write_wav(
    path: Path, samples: NDArray, sample_rate: int, encoding: WavEncoding = "float32"
) -> None:
    """Write samples as a WAV file, whole or not at all.

    Args:
        path: File; its directory is made.
        samples: Full scale is 1; float32 also holds what goes beyond, such as pressures in Pa.
            Shape: (samples,) or (channels, samples).
        sample_rate: Hz.
        encoding: How to store them.

    Raises:
        ValueError: If a sample is not finite, beyond full scale in int16 or int24, or there are
            more than a WAV file can hold.
    """
    samples = np.atleast_2d(samples)
    peak = float(np.abs(samples).max(initial=0.0))
    if not math.isfinite(peak):
        raise ValueError("samples must be finite")
    if encoding != "float32" and peak > 1.0:
        raise ValueError(f"samples must be within -1 and 1 for {encoding}, got {peak:g}")
    data = _encode(samples.T, encoding)
    bits = int(encoding.removeprefix("float").removeprefix("int"))
    code = _FLOAT if encoding == "float32" else PCM
    header = wav_header(WavFormat(code, len(samples), sample_rate, bits, bits), len(data))
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, header + data + b"\0" * (len(data) % 2))


def _read_header(file: BinaryIO, path: Path) -> tuple[WavFormat, int]:
    """Return the format and the number of samples a channel; the file is left at the first one."""
    size = os.fstat(file.fileno()).st_size
    if size == 0:
        raise MuteError(f"{path}: empty file")
    riff = file.read(12)
    if riff[:4] != b"RIFF" or (len(riff) == 12 and riff[8:] != b"WAVE"):
        raise MuteError(f"{path}: not a WAV file (it does not begin with RIFF and WAVE)")
    wav_format = None
    while True:
        chunk = file.read(8)
        if len(chunk) < 8:
            raise MuteError(f"{path}: broken WAV file: it ends before its samples begin")
        name, length = struct.unpack("<4sI", chunk)
        begin = file.tell()
        if name == b"data":
            break
        if name == b"fmt ":
            wav_format = _parse_format(file.read(min(length, _FORMAT_BYTES)), path)
        file.seek(begin + length + length % 2)
    if wav_format is None:
        raise MuteError(f"{path}: broken WAV file: no format before the samples")
    there = size - file.tell()
    if length == _UNTIL_THE_END:
        length = there - there % wav_format.frame_bytes  # the last byte may be padding
    if there < length:
        raise MuteError(
            f"{path}: truncated: {length} bytes of samples are promised, {there} are there"
        )
    frames, rest = divmod(length, wav_format.frame_bytes)
    if rest:
        raise MuteError(f"{path}: broken WAV file: its {length} bytes end within a sample")
    if frames == 0:
        raise MuteError(f"{path}: holds no samples")
    return wav_format, frames


def _parse_format(data: bytes, path: Path) -> WavFormat:
    """Return what a format chunk says.

    Raises:
        MuteError: If it is broken or names an encoding that is not read here.
    """
    if len(data) < 16:
        raise MuteError(f"{path}: broken WAV file: its format is cut off")
    code, channels, sample_rate, _, _, bits = struct.unpack("<HHIIHH", data[:16])
    valid_bits = bits
    if code == _EXTENSIBLE and len(data) >= 26:
        valid_bits, _, code = struct.unpack("<HIH", data[18:26])
    if (code, bits) not in _READABLE:
        raise MuteError(
            f"{path}: WAV encoding {code:#06x} with {bits} bits is not read; "
            "PCM of 8, 16, 24 or 32 bits and float of 32 or 64 bits are"
        )
    if channels == 0 or sample_rate == 0:
        raise MuteError(
            f"{path}: broken WAV file: {channels} channels at a sample rate of {sample_rate} Hz"
        )
    if not 0 < valid_bits < bits:
        valid_bits = bits
    return WavFormat(code, channels, sample_rate, bits, valid_bits)


def _decode(data: bytes, wav_format: WavFormat) -> NDArray[np.float64]:
    """Return samples as they follow each other in the file, full scale is 1."""
    if wav_format.code == _FLOAT:
        return np.frombuffer(data, dtype=f"<f{wav_format.bits // 8}").astype(np.float64)
    if wav_format.bits == 8:  # the only one without a sign
        return np.frombuffer(data, dtype=np.uint8) / 128.0 - 1.0
    if wav_format.bits == 24:
        padded = np.zeros((len(data) // 3, 4), dtype=np.uint8)
        padded[:, 1:] = np.frombuffer(data, dtype=np.uint8).reshape(-1, 3)
        return padded.view("<i4")[:, 0] / 2.0**31
    whole = np.frombuffer(data, dtype=f"<i{wav_format.bits // 8}")
    return whole.astype(np.float64) / 2.0 ** (wav_format.bits - 1)


def _at_full_scale(block: NDArray[np.float64], wav_format: WavFormat) -> NDArray[np.int64]:
    """Return how many samples have a value at which converters clip. Shape: (channels,)."""
    if wav_format.code == _FLOAT:  # which can go on beyond 1, so only 1 itself is suspicious
        return np.count_nonzero(np.abs(block) == 1.0, axis=1)
    largest = 1.0 - 2.0 ** (1 - wav_format.valid_bits)
    return np.count_nonzero((block >= largest) | (block <= -1.0), axis=1)


def _encode(frames: NDArray, encoding: WavEncoding) -> bytes:
    """Return samples of shape (samples, channels) as the bytes of a file."""
    if encoding == "float32":
        return frames.astype("<f4").tobytes()
    scale = 2.0**15 if encoding == "int16" else 2.0**23
    whole = np.clip(np.rint(frames * scale), -scale, scale - 1.0)
    if encoding == "int16":
        return whole.astype("<i2").tobytes()
    return np.ascontiguousarray(whole, dtype="<i4").view(np.uint8).reshape(-1, 4)[:, :3].tobytes()


def wav_header(wav_format: WavFormat, data_bytes: int) -> bytes:
    """Return the bytes before the samples.

    Raises:
        ValueError: If there are more samples than a WAV file can hold.
    """
    frame = wav_format.frame_bytes
    content = struct.pack(
        "<HHIIHH",
        wav_format.code,
        wav_format.channels,
        wav_format.sample_rate,
        wav_format.sample_rate * frame,
        frame,
        wav_format.bits,
    )
    chunks = b"fmt " + struct.pack("<I", len(content)) + content
    if wav_format.code == _FLOAT:  # all but PCM tell the number of samples once more
        chunks += struct.pack("<4sII", b"fact", 4, data_bytes // frame)
    chunks += struct.pack("<4sI", b"data", data_bytes)
    riff_bytes = 4 + len(chunks) + data_bytes + data_bytes % 2
    if riff_bytes >= _UNTIL_THE_END:
        raise ValueError(f"samples must fit in 4 GB, got {data_bytes} bytes")
    return struct.pack("<4sI4s", b"RIFF", riff_bytes, b"WAVE") + chunks
