"""The files that the meter keeps: the readings as CSV, a picture; one of each for a recording."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mute.acoustics.metering.recordings import MeasuredRecording
from mute.command_lines.arguments import make_directory
from mute.support.errors import MuteError
from mute.support.files import write_file

__all__ = ["KeptFiles", "kept_files"]


@dataclass(frozen=True)
class KeptFiles:
    """Where what is kept of a recording goes."""

    history: Path | None
    """CSV of the readings."""
    plot: Path | None
    """PNG."""

    def write(self, recording: MeasuredRecording) -> list[Path]:
        """Write the files that were asked for, each whole or not at all, and return them.

        Raises:
            DiskError: If one cannot be written.
        """
        written = []
        if self.history is not None:
            write_file(self.history, _csv(recording).encode())
            written.append(self.history)
        if self.plot is not None:
            # matplotlib takes a second
            from mute.evaluation.recording_figure import draw_recording

            write_file(self.plot, draw_recording(recording))
            written.append(self.plot)
        return written


def kept_files(
    recordings: Sequence[Path], history: Path | None, plot: Path | None, inputs: Sequence[Path]
) -> list[KeptFiles]:
    """Return where the files of each recording go, before anything is measured.

    Args:
        recordings: What is measured. Of one, the options name files; of several, directories.
        history: Value of --history.
        plot: Value of --plot.
        inputs: Files that are read beside the recordings.

    Raises:
        MuteError: If two of the files would be one, or one would replace what is read, or there is
            no such place.
    """
    read = [*recordings, *inputs]
    histories = _places("history", history, ".csv", recordings, read)
    plots = _places("plot", plot, ".png", recordings, read)
    for option, directory in (("history", history), ("plot", plot)):
        if directory is not None and len(recordings) > 1:
            make_directory(directory, option)
    return [KeptFiles(*places) for places in zip(histories, plots, strict=True)]


def _places(
    option: str, given: Path | None, suffix: str, recordings: Sequence[Path], read: Sequence[Path]
) -> Sequence[Path | None]:
    """Return where the files of one kind go.

    Raises:
        MuteError: If two would be one, or one would replace what is read, or it is no such place.
    """
    if given is None:
        return [None] * len(recordings)
    if len(recordings) == 1:
        if given.suffix.lower() != suffix or given.is_dir():
            raise MuteError(f"--{option} must name a {suffix} file, got {str(given)!r}")
        places = [given]
    else:
        if given.suffix.lower() == suffix or given.is_file():
            raise MuteError(
                f"--{option} must name a directory for several recordings, got {str(given)!r}"
            )
        places = [given / f"{recording.stem}{suffix}" for recording in recordings]
    _check_clashes(option, places, recordings)
    sources = {os.path.realpath(path) for path in read}
    replaced = [place for place in places if os.path.realpath(place) in sources]
    if replaced:
        raise MuteError(f"--{option} must not replace what is measured, got {replaced[0]}")
    return places


def _check_clashes(option: str, places: Sequence[Path], recordings: Sequence[Path]) -> None:
    """Refuse recordings whose files would be the same, on a disk that knows no capitals, too.

    Raises:
        MuteError: If there are any.
    """
    owners: dict[str, Path] = {}
    for place, recording in zip(places, recordings, strict=True):
        name = str(place).casefold()
        if name in owners:
            raise MuteError(
                f"--{option}: {owners[name]} and {recording} would both be kept as {place}; "
                "measure recordings of one name in calls of their own"
            )
        owners[name] = recording


def _csv(recording: MeasuredRecording) -> str:
    """Return the readings as a table; digital silence is -inf."""
    heard = recording.heard
    rows = zip(heard.reading_times.tolist(), heard.readings.tolist(), strict=True)
    return "".join(["time_s,level\n", *(f"{time:.2f},{level!r}\n" for time, level in rows)])
