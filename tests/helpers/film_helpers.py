"""What tests of films share."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest

from mute.rendering import backend
from mute.support.errors import MuteError


def rendering_environment() -> dict[str, str]:
    """Return the variables of a process that can render off-screen; skip where none can."""
    try:
        found = backend.find_backend(os.environ)
    except MuteError as error:
        pytest.skip(str(error))
    return {**os.environ, "MUJOCO_GL": found, "OMP_NUM_THREADS": "1"}


def dark_pixels(picture: np.ndarray) -> np.ndarray:
    """Return where the robot's black parts are; floor and sky have none. Shape: (n, 2)."""
    return np.argwhere(picture.max(axis=2) < 45)


def sound_of(film: Path) -> np.ndarray:
    """Return the samples of a film's sound, full scale is 1; none where it is silent."""
    ffmpeg = [imageio_ffmpeg.get_ffmpeg_exe(), "-loglevel", "error", "-i", str(film)]
    run = subprocess.run(
        [*ffmpeg, "-map", "0:a", "-ac", "1", "-f", "s16le", "-"], capture_output=True, check=False
    )
    return np.frombuffer(run.stdout, "<i2") / 32768.0
