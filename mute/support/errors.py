"""Errors that a user can put right, and how the command lines show them.

A mistake in an argument or a file is told in one line; one in the program keeps its traceback.
"""

from __future__ import annotations

import contextlib
import errno
import signal
import sys
from collections.abc import Callable
from typing import NoReturn

from mute.support.signals import EXIT_SIGNAL, exit_status, interrupted_by_signals
from mute.support.streams import open_missing_streams, silence

EXIT_USER_ERROR = 2
"""Exit status after a mistake of the user's, the one that argument parsers use."""

EXIT_CLOSED_PIPE = EXIT_SIGNAL + signal.SIGPIPE
"""Exit status where the reader of the output has had enough, as shells report it."""

_FULL = (errno.ENOSPC, errno.EDQUOT)


class MuteError(Exception):
    """A mistake of the user's or a bad file; its message is complete in one line."""


def run_cli(main: Callable[[], int | None]) -> NoReturn:
    """Run a command line's main function and end the process with its exit status.

    A `MuteError` is printed to standard error as the line `error: ...`, with status 2, and so is a
    full disk. A signal that asks to end, Ctrl-C the first of them, is one line and status 128 and
    its number. Where the reader of the output is gone, the program ends quietly with status 141.
    Every other exception passes through with its traceback.

    Args:
        main: Does the work and returns the exit status; None counts as 0.

    Raises:
        SystemExit: Always.
    """
    open_missing_streams()
    with interrupted_by_signals():
        status = _status(main)
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:  # the interpreter would try once more
            silence(stream)
    sys.exit(status)


def _status(main: Callable[[], int | None]) -> int | str | None:
    """Run a main function and return the exit status after telling what went wrong."""
    try:
        status = main() or 0
        sys.stdout.flush()
        return status
    except SystemExit as stop:
        return stop.code
    except MuteError as error:
        _tell(f"error: {' '.join(str(error).splitlines())}")
    except KeyboardInterrupt as stop:
        _tell("interrupted")
        return exit_status(stop)
    except BrokenPipeError:
        return EXIT_CLOSED_PIPE
    except OSError as error:
        if error.errno not in _FULL:
            raise
        _tell(f"error: cannot write {error.filename or 'the output'}: {error.strerror}")
    return EXIT_USER_ERROR


def _tell(line: str) -> None:
    with contextlib.suppress(OSError):
        print(line, file=sys.stderr, flush=True)
