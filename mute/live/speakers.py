"""Loudspeakers that play the sound of a walk as it goes, through sounddevice.

An optional extra, `pip install 'mute[sound]'`; on Linux the library PortAudio comes from the
system's packages. Whoever plays is told at once what is missing, before a walk begins.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import importlib
import os
import sys
import time
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from mute.acoustics.listener import SAMPLE_RATE
from mute.live.loudness import Loudness
from mute.live.sample_queue import SampleQueue
from mute.support.errors import MuteError

__all__ = [
    "MakeStream",
    "Play",
    "Speakers",
    "Stream",
    "check_default_output",
    "open_default_output",
]

_DEVICE_LATENCY = 0.03
"""Time for which a device is asked to hold samples, s. With less, Python could be late."""

_LONGEST_END = 0.3
"""Time that a device is given to take what waits at the end, s: one that is gone takes nothing."""

_INSTALL_PORTAUDIO = "on Debian: apt install libportaudio2"


class Stream(Protocol):
    """An output that plays, as sounddevice has it."""

    latency: Any
    """Time from a sample's being given to its being heard, s."""

    def stop(self) -> object:
        """Play what was given, and end."""

    def close(self) -> object:
        """Give the device back."""


Play = Callable[[NDArray[np.float32], bool], None]
"""Fills an array of shape (frames,) with the next samples; is told whether the last were late."""

MakeStream = Callable[[int, Play], Stream]
"""Opens an output at a sample rate in Hz, which asks for samples from then on."""


class Speakers:
    """Loudspeakers, silent until they are given something; a context manager that closes them."""

    def __init__(self, make_stream: MakeStream | None = None) -> None:
        """Open the output.

        Args:
            make_stream: Opens it. Default: `open_default_output`.

        Raises:
            MuteError: If a library or a device is missing, or the device cannot be opened.
        """
        self.sample_rate = SAMPLE_RATE
        """Hz."""
        self._queue = SampleQueue(SAMPLE_RATE)
        self._loudness = Loudness(SAMPLE_RATE)
        self._late = 0
        self._stream = (make_stream or open_default_output)(SAMPLE_RATE, self._fill)

    def __enter__(self) -> Speakers:
        """Do nothing more."""
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Play what waits, and close the output."""
        self._queue.end()
        deadline = time.monotonic() + _LONGEST_END
        while self._queue.waiting and time.monotonic() < deadline:
            time.sleep(0.005)
        try:
            self._stream.stop()
        finally:
            self._stream.close()

    def play(self, pressure: NDArray[np.floating]) -> None:
        """Play the next samples of a walk.

        Args:
            pressure: Sound pressure, Pa. Shape: (samples,).
        """
        self._queue.feed(self._loudness.play(pressure))

    @property
    def gaps(self) -> int:
        """How often the sound ran out, or came too late for the device."""
        return self._queue.gaps + self._late

    @property
    def latency(self) -> float:
        """Mean time from a control step's being made to its being heard, s."""
        return self._queue.mean_wait + float(self._stream.latency)

    def summary(self) -> str:
        """Return in a line how the playing went."""
        queue = self._queue
        if queue.mean_wait == 0.0:
            return "nothing was heard"
        told = f"heard {1e3 * self.latency:.0f} ms after it was walked"
        if self.gaps:
            told += f", {self.gaps} gaps of {queue.silence:.2f} s in all"
        if queue.left_out:
            told += f", {queue.left_out:.2f} s left out to catch up"
        return told

    def _fill(self, out: NDArray[np.float32], late: bool) -> None:
        if late and self._queue.plays:
            self._late += 1
        self._queue.play(out)


def check_default_output() -> None:
    """Check that the system's default output is there and takes what is played.

    Raises:
        MuteError: If sounddevice, PortAudio or a device is missing, or the device refuses.
    """
    with _quiet_libraries():
        library = _find_library()
        device = _find_device(library)
        with _told_of(library, device):
            library.check_output_settings(
                channels=_channels(device), dtype="float32", samplerate=SAMPLE_RATE
            )


def open_default_output(sample_rate: int, play: Play) -> Stream:
    """Return a stream that plays on the system's default output.

    Args:
        sample_rate: Hz.
        play: Is asked for samples.

    Raises:
        MuteError: If sounddevice, PortAudio or a device is missing, or the device refuses.
    """

    def callback(out: NDArray[np.float32], _frames: int, _time: object, status: Any) -> None:  # noqa: ANN401
        play(out[:, 0], bool(status.output_underflow))
        out[:, 1:] = out[:, :1]

    with _quiet_libraries():
        library = _find_library()
        device = _find_device(library)
        with _told_of(library, device):
            stream = library.OutputStream(
                samplerate=sample_rate,
                channels=_channels(device),
                dtype="float32",
                latency=_DEVICE_LATENCY,
                callback=callback,
            )
            try:
                stream.start()
            except BaseException:
                stream.close()
                raise
    return stream


def _find_device(library: Any) -> dict[str, Any]:  # noqa: ANN401
    """Return what sounddevice knows of the default output.

    Raises:
        MuteError: If there is none.
    """
    try:
        return library.query_devices(kind="output")
    except (library.PortAudioError, ValueError) as error:
        raise MuteError("--sound: this machine has no device that plays sound") from error


def _channels(device: dict[str, Any]) -> int:
    return min(2, int(device["max_output_channels"]))


@contextlib.contextmanager
def _told_of(library: Any, device: dict[str, Any]) -> Iterator[None]:  # noqa: ANN401
    """Turn an error of the library into one of the device.

    Raises:
        MuteError: If there was one.
    """
    try:
        yield
    except (library.PortAudioError, ValueError) as error:
        what = " ".join(str(error).split())
        raise MuteError(f"--sound: {device['name']} does not play: {what}") from error


def _find_library() -> Any:  # noqa: ANN401
    """Return sounddevice.

    Raises:
        MuteError: If it, or PortAudio, is not installed.
    """
    try:
        return importlib.import_module("sounddevice")
    except ImportError as error:
        raise MuteError(
            f"--sound needs the library sounddevice ({error}): pip install 'mute[sound]'"
        ) from error
    except OSError as error:
        raise MuteError(f"--sound needs PortAudio ({error}); {_INSTALL_PORTAUDIO}") from error


_AlsaHandler = ctypes.CFUNCTYPE(
    None, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p
)


@functools.cache
def _silence() -> Any:  # noqa: ANN401
    """Return what takes all that ALSA would write, a line for each time that it is late.

    Made once, and only where it is needed: ALSA keeps it for good, and some machines let no program
    make functions as it runs.
    """
    return _AlsaHandler(lambda *_: None)


@contextlib.contextmanager
def _quiet_libraries() -> Iterator[None]:
    """Keep what sound libraries write to standard error, lines of each device that is not there."""
    with contextlib.suppress(OSError, AttributeError, MemoryError):  # on Linux alone, and for good
        ctypes.CDLL("libasound.so.2").snd_lib_error_set_handler(_silence())
    sys.stderr.flush()
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)
