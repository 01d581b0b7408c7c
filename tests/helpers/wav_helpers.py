"""WAV files made byte by byte, so that they can be wrong, and files made by soundfile."""

import struct
from pathlib import Path

import numpy as np
import soundfile
from numpy.typing import ArrayLike, NDArray

RATE = 48000


def tone(rms=1.0, frequency=1000.0, seconds=2.0, rate=RATE):
    """Return a sine that begins at a zero."""
    times = np.arange(round(seconds * rate)) / rate
    return rms * np.sqrt(2.0) * np.sin(2.0 * np.pi * frequency * times)


def integers(samples: ArrayLike, bits: int) -> NDArray[np.int64]:
    """Return samples, full scale is 1, as integers of some bits."""
    return np.rint(np.asarray(samples) * 2.0 ** (bits - 1)).astype(np.int64)


def packed(values: NDArray[np.int64], sample_bytes: int, big_endian: bool = False) -> bytes:
    """Return integers in so many bytes each, the low ones of 8."""
    data = np.ascontiguousarray(values, dtype="<i8").view(np.uint8).reshape(-1, 8)
    data = data[:, :sample_bytes]
    return (data[:, ::-1] if big_endian else data).tobytes()


def wav_bytes(
    code,
    bits,
    data,
    channels=1,
    rate=8000,
    extra=b"",
    promised=None,
    align=None,
    name=b"RIFF",
    before=b"",
    after=b"",
):
    """Return a WAV file, made by hand.

    Args:
        code: Of the encoding.
        bits: Of a sample.
        data: The samples.
        channels: Number of channels.
        rate: Hz.
        extra: What follows the first 16 bytes of the format chunk.
        promised: Length of the samples in the header. Default: the true one.
        align: Bytes of a frame. Default: as the bits need.
        name: First four bytes.
        before: Chunks before the format.
        after: Chunks after the samples.
    """
    order = ">" if name == b"RIFX" else "<"
    frame = channels * (bits // 8) if align is None else align
    byte_rate = rate * frame % 2**32
    fmt = struct.pack(f"{order}HHIIHH", code, channels, rate, byte_rate, frame, bits) + extra
    promised = len(data) if promised is None else promised
    chunks = before + b"fmt " + struct.pack(f"{order}I", len(fmt)) + fmt
    chunks += b"data" + struct.pack(f"{order}I", promised) + data + after
    return name + struct.pack(f"{order}I", (4 + len(chunks)) % 2**32) + b"WAVE" + chunks


def write_bytes(directory: Path, content: bytes) -> Path:
    """Write a recording and return its path."""
    path = directory / "recording.wav"
    path.write_bytes(content)
    return path


def write_sound(path: Path, samples: ArrayLike, rate: int, subtype: str = "FLOAT") -> None:
    """Write samples of shape (samples,) or (channels, samples), full scale is 1, with soundfile."""
    soundfile.write(path, np.atleast_2d(samples).T, rate, subtype, format="WAV")
