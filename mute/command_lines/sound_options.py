"""What the command lines that measure sound share: sources, microphone, policies, progress."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from mute.acoustics import soundscape
from mute.acoustics.audible_env import listening_cfg
from mute.acoustics.microphone import Microphone
from mute.command_lines.arguments import Words, check_distinct
from mute.command_lines.policy_options import PolicyArgs
from mute.controllers import load_policy
from mute.controllers.learned import Policy
from mute.rendering.kept_walks import KeptWalks
from mute.support.errors import MuteError

__all__ = [
    "MicrophonePlace",
    "SoundArgs",
    "Sources",
    "check_sources",
    "find_microphone",
    "load_audible_policy",
    "progress_bar",
    "tell",
    "tell_kept",
]

Sources = Annotated[Words, tyro.conf.arg(help="What to hear: impacts, scuffing, drive, fan.")]
"""Type of the option --sources."""

MicrophonePlace = Annotated[
    str,
    tyro.conf.arg(
        help="Where to listen: trunk, or X,Y,Z of a listener who walks along, m forward, left, and "
        "up from the ground under the robot: 0,1,1.2; or world:X,Y,Z, a place that stays, from "
        "where a walk begins: world:2,1,1.2. Trials of tables and sweeps walk off in all "
        "directions."
    ),
]
"""Type of the option --microphone."""


@dataclass
class SoundArgs(PolicyArgs):
    """The arguments of every evaluation of what a policy sounds like."""

    sources: Sources = soundscape.SOURCES
    microphone: MicrophonePlace = "trunk"

    def check_sound(self) -> None:
        """Check --sources and --microphone.

        Raises:
            MuteError: If one is bad.
        """
        check_sources(self.sources)
        find_microphone(self.microphone)


_FARTHEST = 100.0
"""Largest coordinate of a microphone, m."""

_WORLD = "world:"
"""What stands before the place of a microphone that does not move."""


def check_sources(sources: Sequence[str]) -> None:
    """Check --sources.

    Raises:
        MuteError: If there is none, one is not known, or one is named twice.
    """
    check_distinct("sources", sources)
    try:
        soundscape.check_sources(sources)
    except ValueError as error:
        raise MuteError(f"--{error}") from error


def find_microphone(text: str) -> Microphone:
    """Return the microphone that --microphone names.

    Args:
        text: `trunk`, or `X,Y,Z`: the place of a listener who walks along, m forward, to the left,
            and up from the ground under the robot; or `world:X,Y,Z`: a place in the world, m.

    Raises:
        MuteError: If it is none of these, below the ground, or too far away.
    """
    if text == "trunk":
        return Microphone()
    place = text.removeprefix(_WORLD)
    try:
        x, y, z = (float(part) for part in place.split(","))
    except ValueError:
        raise MuteError(
            f"--microphone must be trunk, X,Y,Z or {_WORLD}X,Y,Z in m, got {text!r}"
        ) from None
    if not (all(abs(value) <= _FARTHEST for value in (x, y, z)) and z >= 0.0):
        raise MuteError(
            f"--microphone must be within {_FARTHEST:g} m and not below the ground, got {text!r}"
        )
    return Microphone((x, y, z), "beside" if place == text else "world")


def load_audible_policy(path: Path) -> Policy:
    """Return a policy that can be heard.

    Raises:
        MuteError: If it cannot be used, or acts at times that lie between the physics steps.
    """
    policy = load_policy(path)
    try:
        listening_cfg(policy.cfg.env)
    except ValueError as error:
        raise MuteError(f"{path} cannot be heard: {error}") from error
    return policy


@contextlib.contextmanager
def progress_bar(title: str, total: float) -> Iterator[Callable[[float], None]]:
    """Show on standard error how far a work is and what time is left.

    Args:
        title: What is done.
        total: What there is to do, in any unit.

    Yields:
        What is told how much is done in all.
    """
    columns = (TextColumn(title), BarColumn(), TextColumn("left"), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task = progress.add_task(title, total=total)
        yield lambda done: progress.update(task, completed=done)


def tell(note: str) -> None:
    """Print a line on standard error."""
    print(note, file=sys.stderr)


def tell_kept(kept: Iterable[KeptWalks]) -> None:
    """Print which sounds and films have been kept, if any."""
    paths = [str(path) for walks in kept for path in walks.kept]
    if paths:
        print(f"kept: {', '.join(paths)}")
