"""Recordings opened for reading at any place, those that come through a pipe too."""

from __future__ import annotations

import os
import stat
import tempfile
from pathlib import Path
from typing import BinaryIO

from mute.support.errors import MuteError

__all__ = ["open_seekable"]

_MOST_PIPED = 1 << 32
"""Bytes that are taken from a pipe: 12 hours of 16 bits at 48 kHz."""

_AT_ONCE = 1 << 20
"""Bytes that are copied at a time."""


def open_seekable(path: Path, beginnings: tuple[bytes, ...]) -> BinaryIO:
    """Open a recording; what comes through a pipe is kept in a nameless temporary file.

    Args:
        path: A file, or a pipe such as /dev/stdin.
        beginnings: First four bytes of files that are wanted. A pipe that begins otherwise is
            refused before it is waited for.

    Raises:
        MuteError: If there is nothing at the path, it cannot be read, or the pipe does not end
            within `_MOST_PIPED` bytes.
    """
    try:
        file = path.open("rb")
    except FileNotFoundError:
        raise MuteError(f"no file at {path}") from None
    except OSError as error:
        raise MuteError(f"{path}: cannot be read: {error.strerror}") from error
    if stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        return file
    with file:
        return _spooled(file, path, beginnings)


def _spooled(pipe: BinaryIO, path: Path, beginnings: tuple[bytes, ...]) -> BinaryIO:
    """Return what comes through a pipe as a file that can be read at any place."""
    spool = None
    try:
        spool = tempfile.TemporaryFile()  # noqa: SIM115 - the caller closes it
        data = pipe.read(4)
        if data and data not in beginnings:
            return _rewound(spool, data)
        while data:
            spool.write(data)
            if spool.tell() > _MOST_PIPED:
                raise MuteError(
                    f"{path}: more than {_MOST_PIPED} bytes come through this pipe; "
                    "measure a file of it"
                )
            data = pipe.read(_AT_ONCE)
        return _rewound(spool)
    except BaseException as error:
        if spool is not None:
            spool.close()
        if isinstance(error, OSError):
            raise MuteError(f"{path}: cannot be read through: {error.strerror}") from error
        raise


def _rewound(spool: BinaryIO, data: bytes = b"") -> BinaryIO:
    """Return a file at its beginning, with more bytes written first."""
    spool.write(data)
    spool.flush()
    spool.seek(0)
    return spool
