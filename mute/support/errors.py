"""Errors that a user can put right, and how the command lines show them.

A mistake in an argument or a file is told in one line; one in the program keeps its traceback.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import NoReturn

EXIT_USER_ERROR = 2
"""Exit status after a mistake of the user's, the one that argument parsers use."""

EXIT_INTERRUPTED = 130
"""Exit status after Ctrl-C, as shells report it: 128 + SIGINT."""


class MuteError(Exception):
    """A mistake of the user's or a bad file; its message is complete in one line."""


def run_cli(main: Callable[[], int | None]) -> NoReturn:
    """Run a command line's main function and end the process with its exit status.

    A `MuteError` is printed to standard error as the line `error: ...`, with status 2; Ctrl-C as
    one line with status 130. Every other exception passes through with its traceback.

    Args:
        main: Does the work and returns the exit status; None counts as 0.

    Raises:
        SystemExit: Always.
    """
    try:
        status = main()
    except MuteError as error:
        print(f"error: {' '.join(str(error).splitlines())}", file=sys.stderr)
        status = EXIT_USER_ERROR
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        status = EXIT_INTERRUPTED
    sys.exit(status or 0)
