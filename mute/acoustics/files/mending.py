"""WAV files as libsndfile should see them: headers mended in memory, the files left alone.

libsndfile knows the formats. What it does not do right, or without a word, is done here:

- a sample may lie in more bytes than its bits need (`arecord -f S24_LE`: 24 bits in 4 bytes); how
  many is in the block align, not in the bits;
- a recording that was cut off, or went through a pipe, has a length in its header that is not that
  of its samples; so has one of which the last bytes are missing;
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

__all__ = ["BEGINNINGS", "MendedFile", "WavLayout", "find_layout"]

BEGINNINGS = (b"RIFF", b"RIFX", b"RF64", b"BW64")
"""First four bytes of what is read: WAV files, of big-endian numbers, and of 64-bit lengths."""

_PCM, _FLOAT, _EXTENSIBLE = 1, 3, 0xFFFE
_BYTES = {_PCM: (1, 2, 3, 4), _FLOAT: (4, 8), 6: (1,), 7: (1,)}
"""Bytes of a sample that are read, by encoding; 6 and 7 are A-law and mu-law."""

_FORMAT_BYTES = 40
"""Length of the longest format chunk that means anything here."""

_MAX_CHANNELS = 1024
"""Channels that libsndfile takes."""

_PLACEHOLDERS = {0x7FFFF000, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF}
"""Lengths that writers put before samples whose number they cannot know."""

_STREAMED = 0x7FFF0000
"""Length from which on a header that promises more than there is holds a placeholder, less what
else is in the file, too (chosen)."""

_NO_LENGTH = 0xFFFFFFFF
"""Length that stands for one of 64 bits elsewhere, or for an unknown one."""

_KNOWN_CHUNKS = {b"data", b"fmt ", b"fact", b"LIST", b"PEAK", b"bext", b"cue ", b"JUNK"}
"""Names by which a chunk is known that begins where a pad byte should be."""


@dataclass(frozen=True)
class _Format:
    """What a format chunk says."""

    chunk: bytes
    """The chunk itself, without name and length."""
    code: int
    channels: int
    sample_rate: int
    sample_bytes: int
    """Bytes that a sample of one channel takes."""
    stated_bits: int
    """Bits of a sample, as all formats state them."""
    valid_bits: int
    """Of these, bits that hold the sample."""


@dataclass(frozen=True)
class WavLayout:
    """Where the samples of a WAV file lie, and how."""

    header: bytes
    """What libsndfile is to read before the samples."""
    begin: int
    """Place of the first sample in the file, bytes."""
    length: int
    """Bytes of whole frames; a frame is one sample of every channel."""
    channels: int
    sample_rate: int
    sample_bytes: int
    """Bytes that a sample of one channel takes."""
    bits: int
    """Of these, bits that hold the sample."""
    spare_bits: int
    """Bits of a sample that are not in use, where it is not said on which side; else 0."""
    warnings: tuple[str, ...]
    """What a user must know about the file, one line each."""


class MendedFile(io.RawIOBase):
    """A WAV file with another header, for libsndfile to read; a view, which copies nothing."""

    def __init__(self, file: BinaryIO, layout: WavLayout) -> None:
        """Put the header of a layout before the samples of a file, which is not closed here."""
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
        end = len(self._layout.header) + self._layout.length
        start = {os.SEEK_SET: 0, os.SEEK_CUR: self._position, os.SEEK_END: end}[whence]
        self._position = max(start + offset, 0)
        return self._position

    def readinto(self, buffer: bytearray | memoryview) -> int:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Read bytes into a buffer and return how many they are."""
        header = self._layout.header
        into_samples = self._position - len(header)
        if into_samples < 0:
            data = header[self._position :][: len(buffer)]
        else:
            wanted = max(min(len(buffer), self._layout.length - into_samples), 0)
            try:
                self._file.seek(self._layout.begin + into_samples)
                data = self._file.read(wanted)
            except OSError as error:
                self.error, data = error, b""
        buffer[: len(data)] = data
        self._position += len(data)
        return len(data)


def find_layout(file: BinaryIO, path: Path) -> WavLayout:
    """Return where the samples of an open file lie, with a header that is true of them.

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
    frame = wav_format.sample_bytes * wav_format.channels
    length = _length(promised, there, frame, path)
    whole = length - length % frame
    if whole == 0:
        raise MuteError(f"{path}: holds no samples")
    seconds = whole / (frame * max(wav_format.sample_rate, 1))
    return WavLayout(
        header=_header(wav_format, order, whole, path),
        begin=begin,
        length=whole,
        channels=wav_format.channels,
        sample_rate=wav_format.sample_rate,
        sample_bytes=wav_format.sample_bytes,
        bits=wav_format.valid_bits,
        spare_bits=8 * wav_format.sample_bytes - wav_format.stated_bits,
        warnings=_warnings(promised, there, length % frame, seconds, path),
    )


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
            wav_format = file.read(min(length - length % 2, _FORMAT_BYTES))
        elif name == b"ds64" and length >= 16:
            long_length = int.from_bytes(file.read(16)[8:], "little")
        place = begin + length
        if length % 2:
            file.seek(place)
            place += file.read(4) not in _KNOWN_CHUNKS  # else the pad byte is missing
    if wav_format is None:
        raise MuteError(f"{path}: broken WAV file: no format before the samples")
    return wav_format, begin, long_length if length == _NO_LENGTH else length


def _parse_format(chunk: bytes, order: str, path: Path) -> _Format:
    """Return what a format chunk says.

    Raises:
        MuteError: If it is broken or names an encoding that is not read here.
    """
    if len(chunk) < 16:
        raise MuteError(f"{path}: broken WAV file: its format is cut off")
    code, channels, sample_rate, _, block_align, bits = struct.unpack(f"{order}HHIIHH", chunk[:16])
    valid_bits = bits
    if code == _EXTENSIBLE and len(chunk) >= 26:
        valid_bits, _, code = struct.unpack(f"{order}HIH", chunk[18:26])
    if not 1 <= channels <= _MAX_CHANNELS:
        raise MuteError(
            f"{path}: broken WAV file: {channels} channels, must be 1 to {_MAX_CHANNELS}"
        )
    needed = -(-bits // 8)
    sample_bytes, rest = divmod(block_align or channels * needed, channels)
    if code not in _BYTES or needed not in _BYTES[code] or bits < 8 or (code != _PCM and bits % 8):
        raise MuteError(
            f"{path}: WAV encoding {code:#06x} with {bits} bits is not read; PCM of 8 to 32 bits, "
            "float of 32 or 64 bits, A-law and mu-law are"
        )
    held = sample_bytes == needed or (code == _PCM and needed > 1 and sample_bytes in _BYTES[code])
    if rest or not held or sample_bytes < needed:
        raise MuteError(
            f"{path}: broken WAV file: {block_align} bytes for {channels} samples of {bits} bits"
        )
    if not 0 < valid_bits < bits:
        valid_bits = bits
    return _Format(chunk, code, channels, sample_rate, sample_bytes, bits, valid_bits)


def _is_last_chunk(file: BinaryIO, begin: int, size: int, order: str) -> bool:
    """Tell whether exactly one chunk follows, so that those bytes are no samples."""
    file.seek(begin)
    head = file.read(8)
    if len(head) < 8 or not head[:4].isalnum():
        return False
    length = struct.unpack(f"{order}I", head[4:])[0]
    return begin + 8 + length <= size <= begin + 8 + length + length % 2


def _is_placeholder(promised: int, there: int) -> bool:
    """Tell whether a length in a header was put there before the samples were."""
    return promised in _PLACEHOLDERS or promised >= max(_STREAMED, there + 1)


def _length(promised: int, there: int, frame: int, path: Path) -> int:
    """Return how many bytes of samples to read, the last of them perhaps of part of a frame.

    Raises:
        MuteError: If more than a frame of what is promised is missing.
    """
    if promised == 0 or _is_placeholder(promised, there):
        return there
    if promised - there > frame:
        raise MuteError(
            f"{path}: truncated: {promised} bytes of samples are promised, {there} are there"
        )
    return min(promised, there)


def _warnings(promised: int, there: int, rest: int, seconds: float, path: Path) -> tuple[str, ...]:
    """Return what is wrong with a length in a header."""
    to_its_end = f"measured to its end ({seconds:.3f} s)"
    if promised == 0:
        return (f"{path}: its header promises no samples, as if it was cut off; {to_its_end}",)
    if _is_placeholder(promised, there):
        return (f"{path}: its header does not know its length, as of a pipe; {to_its_end}",)
    if promised > there:
        return (f"{path}: lacks {promised - there} of {promised} bytes; {to_its_end}",)
    if rest:
        return (f"{path}: its samples end with {rest} bytes of a frame, which are left out",)
    return ()


def _header(wav_format: _Format, order: str, length: int, path: Path) -> bytes:
    """Return a header for samples that follow it at once.

    Raises:
        MuteError: If there are more than a file of big-endian numbers can hold.
    """
    chunk = wav_format.chunk
    align = wav_format.sample_bytes * wav_format.channels
    bits = 8 * wav_format.sample_bytes
    chunk = chunk[:12] + struct.pack(f"{order}HH", align, bits) + chunk[16:]
    format_chunk = b"fmt " + struct.pack(f"{order}I", len(chunk)) + chunk
    size = 4 + len(format_chunk) + 8 + length
    if size < _NO_LENGTH:
        name = b"RIFX" if order == ">" else b"RIFF"
        start = struct.pack(f"{order}4sI4s", name, size, b"WAVE")
        return start + format_chunk + struct.pack(f"{order}4sI", b"data", length)
    if order == ">":
        raise MuteError(f"{path}: {length} bytes of samples, RIFX files hold 4 GB at most")
    start = struct.pack("<4sI4s", b"RF64", _NO_LENGTH, b"WAVE")
    lengths = struct.pack("<4sIQQQI", b"ds64", 28, size + 36, length, length // align, 0)
    return start + lengths + format_chunk + struct.pack("<4sI", b"data", _NO_LENGTH)
