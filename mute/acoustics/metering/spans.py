"""Spans of a recording: from which sample to which, and from where on it is heard to settle."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mute.acoustics.files.reading import WavReader
from mute.acoustics.metering.levels import TIME_CONSTANTS, TimeWeighting
from mute.support.errors import MuteError

__all__ = ["Span", "find_span"]

_LEAD_IN = 16
"""Time constants of the detector that are heard before a span, where the recording has them: it
then differs by a ten-millionth from one that heard all. They are 2 s and more, in which every
filter answers, too."""


@dataclass(frozen=True)
class Span:
    """A part of a recording, in samples."""

    begin: int
    """Number of its first sample, from 0."""
    end: int
    """Number of the sample after its last."""
    sample_rate: int
    """Samples a second."""

    @property
    def begin_time(self) -> float:
        """Time of its begin since that of the recording, s."""
        return self.begin / self.sample_rate

    @property
    def end_time(self) -> float:
        """Time of its end since the begin of the recording, s."""
        return self.end / self.sample_rate

    def lead_in(self, time_weighting: TimeWeighting) -> int:
        """Return from which second of the recording on it must be heard for the span.

        It is a whole one, so that readings come at the same times as in the whole recording.
        """
        return max(math.floor(self.begin_time - _LEAD_IN * TIME_CONSTANTS[time_weighting]), 0)


def find_span(wav: WavReader, begin: float | None, end: float | None) -> Span:
    """Return the part of a recording between two times.

    Args:
        wav: Recording.
        begin: Value of --from, s, >= 0; None for the recording's begin.
        end: Value of --to, s, > `begin`; None for the recording's end.

    Raises:
        MuteError: If the recording ends before.
    """
    rate, frames = wav.sample_rate, wav.frames
    # Cut, not rounded: what is told to be allowed must be.
    length = f"{math.floor(1000 * frames / rate) / 1000:.3f} s"
    first = 0 if begin is None else _sample(begin, wav)
    last = frames if end is None else _sample(end, wav)
    if first >= frames:
        raise MuteError(
            f"{wav.path}: --from must be below {length}, where the recording ends, got {begin}"
        )
    if last > frames:
        raise MuteError(
            f"{wav.path}: --to must be at most {length}, where the recording ends, got {end}"
        )
    if first >= last:
        raise MuteError(
            f"{wav.path}: --to must be {1.0 / rate:.3g} s, a sample, or more after --from, "
            f"got {end}"
        )
    return Span(first, last, rate)


def _sample(time: float, wav: WavReader) -> int:
    """Return the number of the sample at a time, or of one beyond the end."""
    return math.floor(min(time * wav.sample_rate, wav.frames + 1.0) + 0.5)
