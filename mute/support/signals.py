"""Signals that ask a program to end, and what it does about them.

Ctrl-C is SIGINT; a terminal that closes sends SIGHUP, whoever shuts a machine down SIGTERM, and the
schedulers of clusters SIGUSR1 or SIGXCPU before they end a job by force. All of them are taken
alike. One that the program has been started to ignore stays ignored: `nohup` does so with SIGHUP,
and a script's shell with SIGINT for what it starts in the background.
"""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any

__all__ = [
    "EXIT_SIGNAL",
    "STOP_SIGNALS",
    "Interruption",
    "StopRequest",
    "exit_status",
    "interrupted_by_signals",
]

EXIT_SIGNAL = 128
"""What shells add to a signal's number for the exit status of a program that it ended."""

STOP_SIGNALS = (
    signal.SIGINT,
    signal.SIGTERM,
    signal.SIGHUP,
    signal.SIGUSR1,
    signal.SIGXCPU,
)
"""Signals that ask a program to end."""

_Handler = Callable[[int, FrameType | None], Any] | int | None


class Interruption(KeyboardInterrupt):
    """A signal that asks the program to end; it takes the way of Ctrl-C."""

    def __init__(self, number: int) -> None:
        """Remember which signal it was."""
        super().__init__()
        self.number = number


def exit_status(stop: KeyboardInterrupt) -> int:
    """Return the exit status after a signal, as shells report it: 128 and its number."""
    return EXIT_SIGNAL + (stop.number if isinstance(stop, Interruption) else signal.SIGINT)


@contextlib.contextmanager
def interrupted_by_signals() -> Iterator[None]:
    """Raise an `Interruption` in here at the first signal that asks to end.

    A second Ctrl-C raises once more. Other signals do not, so that what is being kept can be
    completed: a scheduler repeats itself, and one process may be told by several others.
    """
    asked = False

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal asked
        if asked and number != signal.SIGINT:
            return
        asked = True
        raise Interruption(number)

    previous = _take_over(interrupt)
    try:
        yield
    finally:
        _put_back(interrupt, previous)


class StopRequest:
    """Takes a signal as a request that work heeds when it is ready; a context manager.

    A second signal says no more, but for Ctrl-C: that ends at once, except while `finishing`.
    """

    def __init__(self, lasting: bool = False) -> None:
        """Prepare; signals are taken from entering on.

        Args:
            lasting: Take requests to the end of the process, and a second Ctrl-C for no more than
                the first.
        """
        self.number: int | None = None
        """The signal that came first; None without any."""
        self._finishing = False
        self._lasting = lasting
        self._previous: dict[signal.Signals, _Handler] = {}

    def __enter__(self) -> StopRequest:
        """Take signals for requests."""
        self.number = None
        self._previous = _take_over(self._request)
        return self

    def __exit__(self, *exc: object) -> None:
        """Put back what was done about signals before."""
        if not self._lasting:
            _put_back(self._request, self._previous)

    @property
    def exit_status(self) -> int:
        """Exit status after the signal; that of Ctrl-C where another process was told."""
        return EXIT_SIGNAL + (signal.SIGINT if self.number is None else self.number)

    @contextlib.contextmanager
    def finishing(self) -> Iterator[None]:
        """Keep work in here, which a second Ctrl-C does not prevent."""
        self._finishing = True
        try:
            yield
        finally:
            self._finishing = False

    def _request(self, number: int, frame: FrameType | None) -> None:
        repeated = self.number is not None and number == signal.SIGINT
        if repeated and not (self._lasting or self._finishing):
            raise KeyboardInterrupt
        self.number = number if self.number is None else self.number


def _take_over(handler: _Handler) -> dict[signal.Signals, _Handler]:
    """Let a handler take the signals that ask to end and are not ignored.

    Returns:
        What took them before; nothing outside the main thread, which alone may change that.
    """
    if threading.current_thread() is not threading.main_thread():
        return {}
    previous = {number: signal.getsignal(number) for number in STOP_SIGNALS}
    taken = {number: old for number, old in previous.items() if old not in (signal.SIG_IGN, None)}
    for number in taken:
        signal.signal(number, handler)
    return taken


def _put_back(handler: _Handler, previous: dict[signal.Signals, _Handler]) -> None:
    """Undo `_take_over`, but for a signal that somebody else has taken over since."""
    for number, old in previous.items():
        if signal.getsignal(number) == handler:
            signal.signal(number, old)
