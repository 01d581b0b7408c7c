"""Standard output and error whose reader may go away while the program has work to do.

A pipe breaks when its reader ends (`train.py --plain | head -3`), a terminal when its window or
connection closes, and a file when its disk is full.
"""

from __future__ import annotations

import contextlib
import errno
import os
import sys
from collections.abc import Iterable, Iterator
from typing import Any, TextIO, cast

__all__ = ["open_missing_streams", "patient_output", "silence"]

_READER_GONE = (errno.EPIPE, errno.EIO)
"""Errors of a pipe whose reader has ended, and of a terminal that is gone."""


def open_missing_streams() -> None:
    """Open standard streams that the program was started without (`>&-`), to nowhere.

    Otherwise the next file would take their number, and with it what libraries print.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            # The lowest free number, which is the stream's: those before it are open by now.
            nowhere = os.open(os.devnull, os.O_RDWR)
            setattr(sys, name, os.fdopen(nowhere, mode))


def silence(stream: TextIO) -> None:
    """Let what goes to a broken stream, and what still waits in it, go nowhere."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, stream.fileno())
    finally:
        os.close(nowhere)


@contextlib.contextmanager
def patient_output() -> Iterator[None]:
    """Go on in here where standard output or error breaks: what is said then goes nowhere.

    That the output is incomplete is told at the end, unless nobody is left to read it.
    """
    out, error = _Patient(sys.stdout), _Patient(sys.stderr)
    with (
        contextlib.redirect_stdout(cast(TextIO, out)),
        contextlib.redirect_stderr(cast(TextIO, error)),
    ):
        yield
        if out.broken_by is not None and out.broken_by.errno not in _READER_GONE:
            print(f"warning: cannot write standard output: {out.broken_by.strerror}", file=error)


class _Patient:
    """A text stream that goes silent instead of failing."""

    def __init__(self, stream: TextIO) -> None:
        self.broken_by: OSError | None = None
        self._stream = stream

    def write(self, text: str) -> int:
        """Write, or go silent."""
        with self._going_on():
            self._stream.write(text)
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        """Write lines, or go silent."""
        for line in lines:
            self.write(line)

    def flush(self) -> None:
        """Write out, or go silent."""
        with self._going_on():
            self._stream.flush()

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401
        return getattr(self._stream, name)

    @contextlib.contextmanager
    def _going_on(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self.broken_by = self.broken_by or error
            silence(self._stream)
