"""A walk that is heard as it goes: the level of the first robot, and its sound if it is kept.

A `LiveListener` is a `Listener` of one robot, set up for a window or for lines of text. Levels are
modelled (`mute.acoustics`) and always come from the cheap path, so that keeping the sound changes
no figure. Tables of many trials are `mute.evaluation`'s.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import TracebackType

from mute.acoustics.listener import Listener
from mute.acoustics.microphone import Microphone
from mute.acoustics.soundscape import SOURCES
from mute.envs.quadruped_env import QuadrupedEnv

__all__ = ["LiveListener"]

_STRETCH = 0.2
"""Time that is worked on at once, s: longer ones save little more, and would make a window jerk."""


class LiveListener:
    """Hears the first robot of an environment.

    A context manager: the file of the sound is whole however the walk ends. Memory grows by the
    readings of the level alone, some 200 bytes a second.
    """

    def __init__(
        self,
        env: QuadrupedEnv,
        surface: str,
        settle_time: float = 1.0,
        seed: int = 0,
        wav: Path | None = None,
        microphone: Microphone | None = None,
        sources: Sequence[str] = SOURCES,
    ) -> None:
        """Begin to listen.

        Args:
            env: The environment, with `scene.foot_forces`; call `listen` after each of its steps.
            surface: Name of the floor to hear.
            settle_time: Time that `levels` leaves out, at the start and after each fall, s.
            seed: Of the noise in the sound.
            wav: File for the sound from the first step on, as a film has it; it begins on entering.
            microphone: Where to listen. Default: on the trunk.
            sources: What to hear, of `soundscape.SOURCES`.

        Raises:
            ValueError: If floor or source is not known, or the environment measures no forces.
        """
        self.surface = surface
        self.wav = wav
        self._env = env
        self._listener = Listener(
            env,
            [surface],
            microphone=microphone,
            sources=sources,
            settle_time=settle_time,
            seed=seed,
            wav=wav,
            stretch=_STRETCH,
            robots=slice(1),
            from_energies=True,
            wav_start=0.0,
        )

    @property
    def clipped(self) -> int:
        """Samples of the complete file that were beyond full scale."""
        return sum(self._listener.clipped.values())

    def __enter__(self) -> LiveListener:
        """Begin the file, if there is to be one.

        Raises:
            MuteError: If it cannot be written.
        """
        self._listener.__enter__()
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Complete the file.

        Raises:
            MuteError: If it cannot be written.
        """
        self._listener.__exit__(exc_type, exc, traceback)

    def restart(self) -> None:
        """Measure anew, of a robot that is about to be reset; a sound that is kept goes on."""
        self._listener.restart()

    def begin_anew(self) -> None:
        """Begin `levels` anew, of a robot that goes on; `level` and a sound that is kept go on."""
        self._listener.begin_anew()

    def listen(self) -> None:
        """Hear the control step that the environment has just made."""
        self._listener.listen(self._env.episode_length_buf == 0)

    def level(self) -> float:
        """Return what a meter with Fast time weighting shows now, dBA; NaN before a first step."""
        return self._listener.level()

    def levels(self) -> dict[str, float]:
        """Return `mnl`, `pnl` and `laeq`, dBA; NaN where the time was too short.

        They are of the time since the start, or since they began anew, without the last stretch
        until it is left.
        """
        levels = self._listener.levels()[0]
        return {"mnl": levels.mnl, "pnl": levels.pnl, "laeq": levels.laeq}
