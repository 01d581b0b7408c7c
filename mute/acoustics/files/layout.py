"""Where the samples of a WAV file lie, and how: what its header says, as far as that can be true.

libsndfile decodes the samples. The header is read here, because libsndfile reads some wrong, and
others without a word:

- a sample may lie in more bytes than its bits need (`arecord -f S24_LE`: 24 bits in 4 bytes); how
  many is in the block align, not in the bits;
- a recording that was cut off, or went through a pipe, has a length in its header that is not that
  of its samples;
- a chunk of odd length lacks its pad byte; BW64 is RF64 by another name (ITU-R BS.2088).

Layout: Microsoft and IBM, Multimedia Programming Interface and Data Specifications 1.0 (1991),
Microsoft's WAVEFORMATEXTENSIBLE, and EBU Tech 3306 for RF64.
"""

from __future__ import annotations

import io
import os
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from mute.support.errors import MuteError

__all__ = ["BEGINNINGS", "SampleBytes", "WavFormat", "WavLayout", "find_layout"]

BEGINNINGS = (b"RIFF", b"RIFX", b"RF64", b"BW64")
"""First four bytes of what is read: WAV files, of big-endian numbers, and of 64-bit lengths."""

_PCM, _EXTENSIBLE = 1, 0xFFFE
_SUBTYPES = {
    (_PCM, 1): "PCM_U8",
    (_PCM, 2): "PCM_16",
    (_PCM, 3): "PCM_24",
    (_PCM, 4): "PCM_32",
    (3, 4): "FLOAT",
    (3, 8): "DOUBLE",
    (6, 1): "ALAW",
    (7, 1): "ULAW",
}
"""What soundfile calls samples, by their encoding and bytes."""

_FORMAT_BYTES = 26
"""Length of what means anything here of the longest format chunk."""

_MAX_CHANNELS = 1024
"""Channels that libsndfile takes."""

_NO_LENGTH = 0xFFFFFFFF
"""Length that stands for one of 64 bits elsewhere, or for an unknown one."""

_PLACEHOLDERS = {0, 0x7FFFF000, 0x7FFFFFFF, 0x80000000, _NO_LENGTH, 2**64 - 1}
"""Lengths that writers put before samples whose number they do not know yet."""

_KNOWN_CHUNKS = {b"data", b"fmt ", b"fact", b"LIST", b"PEAK", b"bext", b"cue ", b"JUNK"}
"""Names by which a chunk is known that begins where a pad byte should be."""


@dataclass(frozen=True)
class WavFormat:
    """How samples are encoded."""

    subtype: str
    """What soundfile calls the encoding."""
    big_endian: bool
    channels: int
    sample_rate: int
    sample_bytes: int
    """Bytes that a sample of one channel takes."""
    bits: int
    """Of these, bits that hold the sample."""
    spare_bits: int
    """Bits of a sample that are not in use, where it is not said on which side; else 0."""


@dataclass(frozen=True)
class WavLayout:
    """Where the samples of a WAV file lie, and how."""

    format: WavFormat
    begin: int
    """Place of the first sample in the file, bytes."""
    length: int
    """Bytes of whole frames; a frame is one sample of every channel."""
    warnings: tuple[str, ...]
    """What a user must know about the file, one line each."""


class SampleBytes(io.RawIOBase):
    """The samples of a WAV file and nothing else of it; a view, which copies nothing."""

    def __init__(self, file: BinaryIO, layout: WavLayout) -> None:
        """Show a part of a file, which is not closed here."""
        self.error: OSError | None = None
        """What went wrong in reading: an exception could not pass through libsndfile."""
        self._file = file
        self._layout = layout
        self._position = 0

    def readable(self) -> bool:
        """Return True."""
        return True

    def seekable(self) -> bool:
        """Return True."""
        return True

    def tell(self) -> int:
        """Return the place of the next byte."""
        return self._position

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Go to a place and return it."""
        end = self._layout.length
        start = {os.SEEK_SET: 0, os.SEEK_CUR: self._position, os.SEEK_END: end}[whence]
        self._position = max(start + offset, 0)
        return self._position

    def readinto(self, buffer: bytearray | memoryview) -> int:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Read bytes into a buffer and return how many they are."""
        wanted = max(min(len(buffer), self._layout.length - self._position), 0)
        try:
            self._file.seek(self._layout.begin + self._position)
            data = self._file.read(wanted)
        except OSError as error:
            self.error, data = error, b""
        buffer[: len(data)] = data
        self._position += len(data)
        return len(data)


def find_layout(file: BinaryIO, path: Path) -> WavLayout:
    """Return where the samples of an open file lie.

    Args:
        file: The file, at any place.
        path: Its name for messages.

    Raises:
        MuteError: If it is no WAV file, is broken, or holds no samples or those of an encoding
            that is not read.
    """
    size = file.seek(0, os.SEEK_END)
    if size == 0:
        raise MuteError(f"{path}: empty file")
    file.seek(0)
    riff = file.read(12)
    if riff[:4] not in BEGINNINGS or (len(riff) == 12 and riff[8:] != b"WAVE"):
        raise MuteError(f"{path}: not a WAV file (it does not begin with RIFF and WAVE)")
    order = ">" if riff[:4] == b"RIFX" else "<"
    chunk, begin, promised = _find_chunks(file, order, path)
    wav_format = _parse_format(chunk, order, path)
    there = size - begin
    if promised == 0 and _is_last_chunk(file, begin, size, order):
        there = 0
    untrue = promised in _PLACEHOLDERS or promised > there
    length = there if untrue else promised
    frame = wav_format.sample_bytes * wav_format.channels
    whole = length - length % frame
    if whole == 0:
        raise MuteError(f"{path}: holds no samples")
    seconds = whole / (frame * max(wav_format.sample_rate, 1))
    warnings: tuple[str, ...] = ()
    if untrue:
        warnings = (f"{path}: {_lie(promised, there)}; measured to its end ({seconds:.3f} s)",)
    elif length > whole:
        ends = f"its samples end with {length - whole} bytes of a frame, which are left out"
        warnings = (f"{path}: {ends}",)
    return WavLayout(wav_format, begin, whole, warnings)


def _find_chunks(file: BinaryIO, order: str, path: Path) -> tuple[bytes, int, int]:
    """Return the format chunk, the place of the samples, and the bytes that are promised of them.

    Raises:
        MuteError: If either chunk is missing.
    """
    wav_format, long_length, place = None, _NO_LENGTH, 12
    while True:
        file.seek(place)
        head = file.read(8)
        if len(head) < 8 or not head[:4].decode("latin-1").isprintable():
            raise MuteError(f"{path}: broken WAV file: it ends before its samples begin")
        name, length = struct.unpack(f"{order}4sI", head)
        begin = place + 8
        if name == b"data":
            break
        if name == b"fmt ":
            wav_format = file.read(min(length, _FORMAT_BYTES))
        elif name == b"ds64" and length >= 16:
            long_length = int.from_bytes(file.read(16)[8:], "little")
        place = begin + length
        if length % 2:
            file.seek(place)
            place += file.read(4) not in _KNOWN_CHUNKS  # else the pad byte is missing
    if wav_format is None:
        raise MuteError(f"{path}: broken WAV file: no format before the samples")
    return wav_format, begin, long_length if length == _NO_LENGTH else length


def _parse_format(chunk: bytes, order: str, path: Path) -> WavFormat:
    """Return what a format chunk says.

    Raises:
        MuteError: If it is broken or names an encoding that is not read here.
    """
    if len(chunk) < 16:
        raise MuteError(f"{path}: broken WAV file: its format is cut off")
    code, channels, sample_rate, _, block_align, bits = struct.unpack(f"{order}HHIIHH", chunk[:16])
    valid_bits = bits
    if code == _EXTENSIBLE and len(chunk) == _FORMAT_BYTES:
        valid_bits, _, code = struct.unpack(f"{order}HIH", chunk[18:])
    if not 1 <= channels <= _MAX_CHANNELS:
        raise MuteError(
            f"{path}: broken WAV file: {channels} channels, must be 1 to {_MAX_CHANNELS}"
        )
    needed = -(-bits // 8)
    if (code, needed) not in _SUBTYPES or bits < 8 or (code != _PCM and bits % 8):
        raise MuteError(
            f"{path}: WAV encoding {code:#06x} with {bits} bits is not read; PCM of 8 to 32 bits, "
            "float of 32 or 64 bits, A-law and mu-law are"
        )
    sample_bytes, rest = divmod(block_align or channels * needed, channels)
    subtype = _SUBTYPES.get((code, sample_bytes))
    # Whether 8 bits have a sign in more than a byte is nowhere said.
    may_be_wider = code == _PCM and 1 < needed < sample_bytes
    if rest or subtype is None or not (sample_bytes == needed or may_be_wider):
        raise MuteError(
            f"{path}: broken WAV file: {block_align} bytes for {channels} samples of {bits} bits"
        )
    return WavFormat(
        subtype=subtype,
        big_endian=order == ">",
        channels=channels,
        sample_rate=sample_rate,
        sample_bytes=sample_bytes,
        bits=valid_bits if 0 < valid_bits < bits else bits,
        spare_bits=8 * sample_bytes - bits,
    )


def _is_last_chunk(file: BinaryIO, begin: int, size: int, order: str) -> bool:
    """Tell whether exactly one chunk follows, so that those bytes are no samples."""
    file.seek(begin)
    head = file.read(8)
    if len(head) < 8 or not head[:4].isalnum():
        return False
    length = struct.unpack(f"{order}I", head[4:])[0]
    return begin + 8 + length <= size <= begin + 8 + length + length % 2


def _lie(promised: int, there: int) -> str:
    """Return in words what is not true of a length in a header."""
    if promised == 0:
        return "its header promises no samples, as if it was cut off"
    if promised in _PLACEHOLDERS:
        return "its header does not know its length, as of a pipe"
    return f"cut off: {promised - there} of {promised} bytes of samples are missing"
