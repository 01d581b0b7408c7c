"""The ffmpeg that writes films: tried before a walk begins, so that none is lost to it."""

from __future__ import annotations

import functools
import os
import subprocess

import imageio_ffmpeg

from mute.support.errors import MuteError

__all__ = ["ffmpeg_program"]

_VARIABLE = "IMAGEIO_FFMPEG_EXE"
"""Environment variable that names the program; imageio-ffmpeg takes it as it is."""
_ENCODERS = ("libx264", "aac")
"""What films need: of the pictures, and of the sound."""


def ffmpeg_program() -> str:
    """Return the ffmpeg that encodes films; imageio-ffmpeg uses the same.

    Raises:
        MuteError: If there is none, or it does not run or lacks an encoder; names the environment
            variable that chose it, if one did.
    """
    given = os.environ.get(_VARIABLE, "")
    try:
        program = imageio_ffmpeg.get_ffmpeg_exe()
    except RuntimeError as error:
        raise MuteError(f"--video: there is no ffmpeg: {error}") from error
    fault = _fault_of(program)
    if not fault:
        return program
    if given:
        raise MuteError(
            f"--video: {_VARIABLE}={given} {fault}; unset it to use the ffmpeg that comes with "
            "imageio-ffmpeg"
        )
    raise MuteError(f"--video: {program} {fault}; install imageio-ffmpeg anew")


@functools.cache
def _fault_of(program: str) -> str:
    """Return what keeps a program from encoding films; nothing where it can."""
    try:
        run = subprocess.run(
            [program, "-hide_banner", "-encoders"],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
        )
    except OSError as error:
        return f"cannot be run: {error.strerror}"
    words = set(run.stdout.split())
    missing = [name for name in _ENCODERS if name not in words]
    return f"is no ffmpeg that encodes {' and '.join(missing)}" if missing else ""
