"""Programs that are run for someone, and asked to end before they are made to."""

from __future__ import annotations

import contextlib
import signal
import subprocess
from collections.abc import Sequence

__all__ = ["end_program", "run_program"]

_GRACE = 30.0
"""How long a program may take to end when asked to, s: a training ends its iteration and saves."""


def run_program(command: Sequence[str]) -> int:
    """Run a program, of which only errors are shown, and return its exit status.

    Whatever ends the wait asks the program to end, too, and waits for what it saves.
    """
    process = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        process_group=0,  # Ctrl-C asks this process alone
    )
    try:
        return process.wait()
    finally:
        end_program(process)


def end_program(process: subprocess.Popen[bytes]) -> None:
    """End a program, halted or not, even if whoever waits for that is interrupted once more."""
    try:
        process.terminate()  # none that has ended
        process.send_signal(signal.SIGCONT)  # one that is halted learns of no other signal
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(_GRACE)
    finally:
        process.kill()  # takes a halted one as well
        process.wait()
