"""States of a gamepad from a process that reads it, see `gamepad_reader`."""

from __future__ import annotations

import contextlib
import json
import queue
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO

from mute.live.gamepad import PadState

__all__ = ["GamepadProcess", "gamepad_process"]

_READER = Path(__file__).with_name("gamepad_reader.py")

_STOPPED = "no gamepad can be read any more: what reads it has ended"


class GamepadProcess:
    """What the process has written, line by line."""

    def __init__(self, lines: IO[str]) -> None:
        """Begin to listen, in a thread.

        Args:
            lines: What it writes.
        """
        self._lines = lines
        self._events = queue.SimpleQueue[PadState | str | None]()
        self._is_leaving = False
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def read(self) -> list[PadState | str | None]:
        """Return what came since the last call, in order.

        States; None where a gamepad that was there is gone; a text to tell the user.
        """
        events: list[PadState | str | None] = []
        with contextlib.suppress(queue.Empty):
            while True:
                events.append(self._events.get_nowait())
        return events

    def leave(self) -> None:
        """Take note that the process is about to end."""
        self._is_leaving = True

    def join(self) -> None:
        """Wait until all is read that was written before the process ended."""
        self._thread.join()

    def _listen(self) -> None:
        told = False
        for line in self._lines:
            try:
                event = _event(json.loads(line))
            except (ValueError, KeyError, TypeError):
                continue  # a library may write there, too
            told = told or isinstance(event, str)
            self._events.put(event)
        if not self._is_leaving:
            self._events.put(None)
            if not told:
                self._events.put(_STOPPED)


def _event(line: dict) -> PadState | str | None:
    """Return what a line says."""
    if "note" in line:
        return line["note"]
    if line["pad"] is None:
        return None
    return PadState(line["pad"], tuple(line["axes"]), frozenset(line["buttons"]))


@contextlib.contextmanager
def gamepad_process(
    command: Sequence[str] | None = None, closing_time: float = 2.0
) -> Iterator[GamepadProcess]:
    """Yield the states of a gamepad, and end what reads it afterwards.

    Args:
        command: What is run to read it. Default: `gamepad_reader` in this Python.
        closing_time: Longest time that it may take to end once it is asked to, s.
    """
    # -P: the folder of that file holds modules of MUTE's, whose names others may have, too.
    process = subprocess.Popen(
        command or [sys.executable, "-P", str(_READER)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    states = GamepadProcess(process.stdout)
    try:
        yield states
    finally:
        states.leave()
        with contextlib.suppress(OSError):
            process.stdin.close()
        try:
            process.wait(closing_time)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        states.join()
        process.stdout.close()
