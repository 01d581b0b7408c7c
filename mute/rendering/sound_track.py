"""Put sound into a film that is whole already, with the ffmpeg that encoded its pictures."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

from mute.rendering.encoder import ffmpeg_program
from mute.support.errors import MuteError

__all__ = ["add_sound", "temporary_sound"]

_BITRATE = "128k"
"""Of the AAC sound, bit/s: for one channel, beyond what is heard."""


def add_sound(film: Path, sound: Path) -> None:
    """Give a silent film its sound; the pictures stay as they are encoded.

    Args:
        film: An .mp4 file; it is replaced when all went well, else left as it is.
        sound: A WAV file that begins with the film.

    Raises:
        MuteError: If the sound cannot be read, or the film not be written.
    """
    heard = film.with_name(f"{film.stem}.heard.mp4")
    try:
        # Absolute paths, of which ffmpeg takes none for an option or an address; in a session of
        # its own, Ctrl-C reaches it through this process alone.
        run = subprocess.run(
            [
                *(ffmpeg_program(), "-y", "-loglevel", "error"),
                *("-i", film.absolute(), "-i", sound.absolute(), "-map", "0:v", "-map", "1:a"),
                *("-c:v", "copy", "-c:a", "aac", "-b:a", _BITRATE, heard.absolute()),
            ],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
            start_new_session=True,
        )
        if run.returncode != 0:
            raise MuteError(_last_line(run.stderr) or f"ffmpeg ended with status {run.returncode}")
        os.replace(heard, film)
    except OSError as error:
        raise MuteError(_last_line(str(error))) from error
    finally:
        heard.unlink(missing_ok=True)


def temporary_sound(film: Path) -> Path:
    """Return where the sound of a film can grow until it is put in, beside the film."""
    return film.with_name(f"{film.stem}.{os.getpid()}.tmp.wav")


def _last_line(text: str) -> str:
    return text.strip().splitlines()[-1] if text.strip() else ""
