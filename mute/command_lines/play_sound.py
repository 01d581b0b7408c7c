"""The option --sound of `play.py`: a walk that is watched is heard through the loudspeakers."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator, Sequence

from mute.acoustics.live_sound import LiveSound
from mute.acoustics.microphone import Microphone
from mute.evaluation.session import Session
from mute.live.speakers import MakeStream, Speakers, check_default_output
from mute.support.errors import MuteError

__all__ = ["check_sound", "played_aloud"]


def check_sound(in_real_time: bool) -> None:
    """Check that a walk can be heard as it goes, before anything that takes time.

    Args:
        in_real_time: Whether it is walked at the speed of real time.

    Raises:
        MuteError: If it is not, or a library or a device is missing.
    """
    if not in_real_time:
        raise MuteError(
            "--sound plays a walk while it is watched, and no window opens here; see --viewer web"
        )
    check_default_output()


@contextlib.contextmanager
def played_aloud(
    session: Session,
    surface: str,
    seed: int,
    microphone: Microphone,
    sources: Sequence[str],
    make_stream: MakeStream | None = None,
) -> Iterator[None]:
    """Play the first robot of a walk, and say at the end how that went.

    Args:
        session: The walk.
        surface: Name of the floor to hear.
        seed: Of the noise in the sound.
        microphone: Where to listen.
        sources: What to hear.
        make_stream: Opens the output. Default: the system's.

    Raises:
        MuteError: If a library or a device is missing, or the device cannot be opened.
    """
    with Speakers(make_stream) as speakers:
        sound = LiveSound(
            session.env, surface, speakers.play, speakers.sample_rate, seed, microphone, sources
        )
        session.followers.append(sound)
        try:
            yield
        finally:
            session.followers.remove(sound)
            sound.close()
            print(f"loudspeakers: {speakers.summary()}", file=sys.stderr)
