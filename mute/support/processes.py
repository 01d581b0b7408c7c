"""Work in a process of its own, so that its memory is that of this work alone."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import resource
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import ParamSpec, TypeVar

from mute.support.errors import MuteError

__all__ = ["call_apart", "peak_memory_mb"]

_P = ParamSpec("_P")
_T = TypeVar("_T")


def call_apart(function: Callable[_P, _T], *arguments: _P.args, **named: _P.kwargs) -> _T:
    """Call a function in a new process and return what it returns.

    The process begins empty, with this one's environment variables. What it prints goes to the
    standard error; it ends with this call, whatever ends that, `kill -9` too.

    Args:
        function: One that a new process can import: of the top level of a module, or of the program
            that runs.
        arguments: What it takes; that and what it returns can be pickled.
        named: Likewise.

    Raises:
        MuteError: If the call fails, in one line.
    """
    others = multiprocessing.active_children()
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, context, initializer=_begin) as pool:
        try:
            with _without_interrupts():  # Ctrl-C ends it by way of this process
                future = pool.submit(function, *arguments, **named)
            return future.result()
        except Exception as error:
            reason = " ".join(str(error).split()) or type(error).__name__
            raise MuteError(f"the measurement failed: {reason}") from error
        except BaseException:
            for child in set(multiprocessing.active_children()) - set(others):
                child.kill()
            raise


def _begin() -> None:
    """Print aside, and end when the process that waits is gone."""
    os.dup2(2, 1)
    waiting = multiprocessing.parent_process()
    assert waiting is not None

    def end_with_it() -> None:
        waiting.join()
        os._exit(1)

    threading.Thread(target=end_with_it, daemon=True).start()


@contextlib.contextmanager
def _without_interrupts() -> Iterator[None]:
    """Ignore Ctrl-C, as processes go on to do that are started in here."""
    previous = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)


def peak_memory_mb() -> float:
    """Return the largest memory that this process has held, MB."""
    status = Path("/proc/self/status")
    if status.exists():
        # What `getrusage` tells begins with the memory of the process that started this one.
        (peak,) = (line for line in status.read_text().splitlines() if line.startswith("VmHWM:"))
        return int(peak.split()[1]) / 1024.0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20  # macOS: bytes
