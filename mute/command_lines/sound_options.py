"""What the command lines that measure sound share: sources, microphone, policies, progress."""

from __future__ import annotations

import contextlib
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from mute.acoustics import soundscape
from mute.acoustics.microphone import Microphone
from mute.acoustics.physics.room import ROOMS, Room
from mute.acoustics.room_sound import check_rooms_heard
from mute.command_lines.arguments import Words, check_distinct
from mute.command_lines.policy_options import DriverArgs, check_audible
from mute.controllers import load_policy
from mute.controllers.learned import Policy
from mute.rendering.kept_walks import KeptWalks
from mute.support.errors import MuteError
from mute.support.ranges import Range

__all__ = [
    "MicrophonePlace",
    "RoomName",
    "SoundArgs",
    "Sources",
    "check_sources",
    "find_microphone",
    "find_room",
    "load_audible_policy",
    "progress_bar",
    "tell",
    "tell_kept",
    "warn_if_not_known_well",
]

Sources = Annotated[Words, tyro.conf.arg(help="What to hear: impacts, body, drive, scuffing, fan.")]
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


RoomName = Annotated[
    str,
    tyro.conf.arg(
        help="Where that is: open, office, corridor, ward, or V,A: a volume in m3 and an "
        "absorption area in m2, as 60,10. Walls add to the levels, which come from energies then."
    ),
]
"""Type of the option --room."""


@dataclass
class SoundArgs(DriverArgs):
    """The arguments of every evaluation of what a policy sounds like."""

    sources: Sources = soundscape.SOURCES
    microphone: MicrophonePlace = "trunk"
    room: RoomName = "open"

    def check_sound(self, kept: Path | None = None) -> None:
        """Check --sources, --microphone and --room.

        Args:
            kept: File that sound is to be kept in, if any.

        Raises:
            MuteError: If one is bad, or sound of a room is to be kept and what makes it is missing.
        """
        check_sources(self.sources)
        find_microphone(self.microphone)
        if find_room(self.room).has_walls and kept is not None:
            check_rooms_heard()


_KNOWN_WELL = 0.3
"""Half width of a 95 % interval that a mean level should be known within, dB."""

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


_VOLUMES = Range(1.0, 1e6)
_ABSORPTIONS = Range(0.1, 1e6)
_FLAT_ROOM = 2.5
"""Height of a room that is given by its volume, m, unless it is smaller than a cube of that."""
_LENGTH_TO_WIDTH = 1.25
_LONGEST_REVERBERATION = 10.0
"""s; cathedrals have less."""


def find_room(text: str) -> Room:
    """Return the room that --room names.

    Args:
        text: A name of `ROOMS`, or `V,A`: volume, m^3, and absorption area, m^2.

    Raises:
        MuteError: If it is neither, or out of range.
    """
    if text in ROOMS:
        return ROOMS[text]
    try:
        volume, absorption = (float(part) for part in text.split(","))
    except ValueError:
        raise MuteError(
            f"--room must be one of {', '.join(ROOMS)}, or V,A in m3 and m2, got {text!r}"
        ) from None
    for name, value, allowed in (
        ("volume", volume, _VOLUMES),
        ("absorption area", absorption, _ABSORPTIONS),
    ):
        if not allowed.holds(value):
            raise MuteError(f"--room: the {name} must be {allowed}, got {text!r}")
    height = min(_FLAT_ROOM, volume ** (1.0 / 3.0))
    width = math.sqrt(volume / height / _LENGTH_TO_WIDTH)
    length = _LENGTH_TO_WIDTH * width
    room = Room(absorption, (length, width, height))
    surface = 2.0 * (length * width + length * height + width * height)
    if absorption >= surface:
        raise MuteError(
            f"--room: the absorption area must be below the {surface:.0f} m2 of walls, floor and "
            f"ceiling, got {text!r}"
        )
    if room.reverberation_time > _LONGEST_REVERBERATION:
        raise MuteError(
            f"--room: the reverberation time must be <= {_LONGEST_REVERBERATION:g} s, and is "
            f"{room.reverberation_time:.3g} s of {text!r}"
        )
    return room


def load_audible_policy(path: Path) -> Policy:
    """Return a policy that can be heard.

    Raises:
        MuteError: If it cannot be used, or acts at times that lie between the physics steps.
    """
    policy = load_policy(path)
    check_audible(policy, str(path))
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


def warn_if_not_known_well(*half_widths: float) -> None:
    """Say where so few robots walked that a mean level is not known well.

    Args:
        half_widths: Of the 95 % intervals of MNL, dB; NaN, of a single robot, is let be.
    """
    wide = [half_width for half_width in half_widths if half_width > _KNOWN_WELL]
    if wide:
        tell(
            f"the 95 % interval of an MNL is up to ±{max(wide):.1f} dB; more --trials make it "
            "narrower"
        )


def tell_kept(kept: Iterable[KeptWalks]) -> None:
    """Print which sounds and films have been kept, if any."""
    paths = [str(path) for walks in kept for path in walks.kept]
    if paths:
        print(f"kept: {', '.join(paths)}")
