"""Samples on their way from the thread that walks to the one that plays.

A short supply is kept, against control steps that are late. Where it runs out, the sound fades
within some milliseconds, silence follows, and a little more is kept from then on; where too much
waits, as after a stall that was caught up with, the oldest is left out. At such joints the
difference between what was heard and what follows is let go as an exponential, so nothing clicks.
"""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import NDArray

__all__ = ["LONGEST_WAIT", "SampleQueue"]

_FIRST_SUPPLY = 0.04
"""Supply with which playing begins, s: two control steps."""
_MORE = 0.01
"""By how much more is kept after each time that it ran out, s."""
_MOST_KEPT = 0.06
"""Longest supply that is kept, s."""
LONGEST_WAIT = 0.08
"""Time that samples wait at most, s: where more wait, the oldest are left out."""
_LETTING_GO = 0.003
"""Time constant of a difference at a joint, s."""
_NOTHING = 1e-7
"""Difference below which there is none: below the last bit of any converter."""


class SampleQueue:
    """A line of samples, fed by one thread and played by another."""

    def __init__(self, sample_rate: int) -> None:
        """Begin empty.

        Args:
            sample_rate: Hz.
        """
        self._rate = sample_rate
        self._lock = threading.Lock()
        self._samples = np.zeros(0, dtype=np.float32)
        self._supply = self._count(_FIRST_SUPPLY)
        self._plays = False
        self._ended = False
        self._last, self._difference = 0.0, 0.0
        self._follows = True
        self._kept = float(np.exp(-1.0 / (_LETTING_GO * sample_rate)))
        self._waited, self._played = 0.0, 0
        self._gaps, self._silent, self._left_out = 0, 0, 0

    @property
    def waiting(self) -> int:
        """Samples that wait to be heard."""
        return len(self._samples)

    @property
    def plays(self) -> bool:
        """Whether there is sound now, and not silence for want of samples."""
        return self._plays

    @property
    def gaps(self) -> int:
        """How often it ran out of samples."""
        return self._gaps

    @property
    def silence(self) -> float:
        """Time of all these gaps together, s."""
        return self._silent / self._rate

    @property
    def left_out(self) -> float:
        """Time of all that was left out since playing began, s."""
        return self._left_out / self._rate

    @property
    def mean_wait(self) -> float:
        """Mean time that what was played had waited, s; 0 before anything was."""
        return self._waited / self._played / self._rate if self._played else 0.0

    def feed(self, samples: NDArray[np.float32]) -> None:
        """Add the next samples. Shape: (samples,)."""
        with self._lock:
            waiting = np.concatenate((self._samples, samples))
            if len(waiting) > self._count(LONGEST_WAIT):
                gone = len(waiting) - max(self._supply, len(samples))
                waiting = waiting[gone:]
                if self._played:
                    self._left_out += gone
                self._follows = False
            self._samples = waiting

    def end(self) -> None:
        """Take note that no more comes: to run out is no gap from now on."""
        with self._lock:
            self._ended = True

    def play(self, out: NDArray[np.float32]) -> None:
        """Give the next samples, or silence where there are none.

        Args:
            out: Where to. Shape: (samples,).
        """
        with self._lock:
            was_playing = self._plays
            if len(self._samples) >= self._supply or (self._ended and len(self._samples)):
                self._plays = True
            made = min(len(out), len(self._samples)) if self._plays else 0
            if made:
                # Silence before it does not lead into it either.
                self._join(out[:made], self._follows and was_playing)
            if made < len(out):
                self._stop(len(out) - made)
                self._fade(out[made:])

    def _join(self, out: NDArray[np.float32], follows: bool) -> None:
        """Give samples that wait."""
        count = len(out)
        self._waited += count * len(self._samples)
        self._played += count
        out[:] = self._samples[:count]
        self._samples = self._samples[count:]
        if not follows:
            self._difference = self._last - float(out[0])
            self._follows = True
        self._let_go(out)

    def _stop(self, missing: int) -> None:
        """Take note that samples are missing."""
        if self._plays and not self._ended:
            self._gaps += 1
            self._supply = min(self._supply + self._count(_MORE), self._count(_MOST_KEPT))
        if self._plays:
            self._difference = self._last
        self._plays = False
        if self._gaps and not self._ended:
            self._silent += missing

    def _fade(self, out: NDArray[np.float32]) -> None:
        """Give what is left of the sound before, and silence."""
        out[:] = 0.0
        self._let_go(out)

    def _let_go(self, out: NDArray[np.float32]) -> None:
        """Add what is left of a difference, which falls from sample to sample."""
        if self._difference:
            out += self._difference * self._kept ** np.arange(len(out), dtype=np.float32)
            self._difference *= self._kept ** len(out)
            if abs(self._difference) < _NOTHING:
                self._difference = 0.0
        self._last = float(out[-1])

    def _count(self, seconds: float) -> int:
        return round(seconds * self._rate)
