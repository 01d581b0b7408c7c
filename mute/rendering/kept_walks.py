"""Walks that are kept while they are measured: as sound, and as films with their sound."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from mute.acoustics.files.writing import has_samples
from mute.envs.quadruped_env import QuadrupedEnv
from mute.rendering.sound_track import temporary_sound

if TYPE_CHECKING:
    from mute.rendering.video import Video

__all__ = ["Filming", "KeptWalks", "filming"]


@dataclass(frozen=True)
class KeptWalks:
    """What is kept of which walks, by their index."""

    wav: Mapping[int, Path] = field(default_factory=dict)
    """Files for their sound."""
    video: Mapping[int, Path] = field(default_factory=dict)
    """Files for their films."""
    on_note: Callable[[str], None] = lambda note: None
    """Told in one line of each file that is not as one would wish: clipped, silent, or
    missing because the walk was too short."""
    kept: list[Path] = field(default_factory=list)
    """The files that are whole, once their walks are over."""

    def spaced(self, stride: int) -> KeptWalks:
        """Return the same with every index multiplied: of the first robots of groups."""
        wav = {index * stride: path for index, path in self.wav.items()}
        video = {index * stride: path for index, path in self.video.items()}
        return KeptWalks(wav, video, self.on_note, self.kept)

    def note_clipped(self, samples: Mapping[int, int]) -> None:
        """Tell of each walk whose sound has samples beyond full scale, given their numbers."""
        for index, count in samples.items():
            if count:
                path = self.wav.get(index) or self.video[index]
                self.on_note(f"{path}: {count} samples are clipped")


@dataclass(frozen=True)
class Filming:
    """Films that are being made."""

    sounds: Mapping[int, Path]
    """WAV files to be written, by robot, and to be whole before the films are: those that are
    kept, and one for each film beyond."""
    videos: Mapping[int, Video]

    def record(self) -> None:
        """Take in the control step that the environment has just made.

        Raises:
            MuteError: If a file cannot be written.
        """
        for video in self.videos.values():
            video.record()


@contextlib.contextmanager
def filming(env: QuadrupedEnv, walks: KeptWalks, start: float) -> Iterator[Filming]:
    """Film robots of an environment; the films are whole on leaving.

    Args:
        env: Where they walk.
        walks: What to keep, by robot.
        start: Time at which films and sounds begin, s.

    Raises:
        MuteError: If nothing renders, or a film cannot be written.
    """
    extra = {
        robot: temporary_sound(path)
        for robot, path in walks.video.items()
        if robot not in walks.wav
    }
    sounds = {**walks.wav, **extra}
    videos: dict[int, Video] = {}
    try:
        with contextlib.ExitStack() as stack:
            for robot, path in walks.video.items():
                from mute.rendering.video import Video  # an encoder, which only a film needs

                video = Video(path, env, sounds[robot], robot, start)
                if robot in extra:
                    stack.callback(extra[robot].unlink, missing_ok=True)
                videos[robot] = stack.enter_context(video)
            yield Filming(sounds, videos)
    except KeyboardInterrupt:  # which keeps what there is
        _finish(walks, videos)
        raise
    _finish(walks, videos)


def _finish(walks: KeptWalks, videos: Mapping[int, Video]) -> None:
    """Drop sounds that never began, list what is kept, and tell of what is not as wished."""
    for path in filter(Path.exists, walks.wav.values()):
        if has_samples(path):
            walks.kept.append(path)
        else:
            path.unlink()
            walks.on_note(f"{path} is not written: the walk ended before its sound began")
    for video in videos.values():
        if video.never_began:
            walks.on_note(f"{video.path} is not written: the walk ended before it began")
        else:
            walks.kept.append(video.path)
        if video.silent_because:
            walks.on_note(f"{video.path} is without sound: {video.silent_because}")
