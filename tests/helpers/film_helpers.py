"""What tests of films share."""

from __future__ import annotations

import subprocess
from pathlib import Path

import imageio_ffmpeg
import numpy as np


def sound_of(film: Path) -> np.ndarray:
    """Return the samples of a film's sound, full scale is 1; none where it is silent."""
    ffmpeg = [imageio_ffmpeg.get_ffmpeg_exe(), "-loglevel", "error", "-i", str(film)]
    run = subprocess.run(
        [*ffmpeg, "-map", "0:a", "-ac", "1", "-f", "s16le", "-"], capture_output=True, check=False
    )
    return np.frombuffer(run.stdout, "<i2") / 32768.0
