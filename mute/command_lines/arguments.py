"""What the command lines share: parsing, devices, and one clear line for bad input."""

from __future__ import annotations

import dataclasses
import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any, TypeVar

import tyro

from mute.command_lines.parser_errors import in_one_line
from mute.config_versions import MOVED
from mute.support.errors import MuteError
from mute.support.plugins import load_plugin
from mute.support.ranges import Range

__all__ = [
    "LONGEST_WALK",
    "MANY_ROBOTS",
    "Numbers",
    "Words",
    "check_betas",
    "check_distinct",
    "check_option",
    "check_seed",
    "check_trials",
    "check_video",
    "check_wav",
    "check_words",
    "command_line",
    "current_spelling",
    "is_given",
    "make_directory",
    "parse",
    "resolve_device",
    "selected_task",
    "spelled",
    "task_name",
]


def _split(words: Sequence[str]) -> list[str]:
    return [part for word in words for part in word.split(",") if part]


Numbers = Annotated[
    tuple[float, ...],
    tyro.constructors.PrimitiveConstructorSpec(
        nargs="*",
        metavar="X[,X...]",
        instance_from_str=lambda words: tuple(float(part) for part in _split(words)),
        is_instance=lambda value: isinstance(value, tuple),
        str_from_instance=lambda value: [",".join(f"{number:g}" for number in value)],
    ),
]
"""Numbers, separated by commas or blanks."""

Words = Annotated[
    tuple[str, ...],
    tyro.constructors.PrimitiveConstructorSpec(
        nargs="*",
        metavar="NAME[,NAME...]",
        instance_from_str=lambda words: tuple(_split(words)),
        is_instance=lambda value: isinstance(value, tuple),
        str_from_instance=lambda value: [",".join(value)],
    ),
]
"""Names, separated by commas or blanks."""

MANY_ROBOTS = Range(1, 16384, whole=True)
"""How many robots may walk side by side."""

LONGEST_WALK = 86400.0
"""Longest time that a robot may be asked to walk, s."""

_Args = TypeVar("_Args")


def parse(
    args_type: type[_Args], argv: Sequence[str], description: str, default: _Args | None = None
) -> _Args:
    """Parse a command line into a dataclass.

    Raises:
        MuteError: If an argument is unknown, not of its type, or out of its range.
        SystemExit: After --help.
    """

    def read() -> _Args:
        if default is None:
            return tyro.cli(args_type, args=list(argv), description=description)
        return tyro.cli(args_type, args=list(argv), description=description, default=default)

    try:
        return in_one_line(read)
    except ValueError as error:
        raise MuteError(str(error)) from error


def current_spelling(argv: Sequence[str]) -> list[str]:
    """Return a command line with the options of earlier versions as they are called now."""
    return [_current_option(word) if word.startswith("--") else word for word in argv]


def _current_option(word: str) -> str:
    option, equals, value = word.removeprefix("--").partition("=")
    moved = MOVED.get(option.replace("-", "_"))
    return f"--{moved.replace('_', '-')}{equals}{value}" if moved else word


def spelled(args: Any, names: Sequence[str]) -> str:  # noqa: ANN401
    """Return, as they are typed, the options that differ from their defaults.

    Args:
        args: A dataclass of arguments whose fields have plain defaults.
        names: The fields to look at.

    Returns:
        A word for each, with a space before it; nothing if all are as they are.
    """
    words: list[str] = []
    for field in dataclasses.fields(args):
        value = getattr(args, field.name)
        if field.name not in names or value == field.default:
            continue
        option = field.name.replace("_", "-")
        if isinstance(value, bool):
            words.append(f"--{option}" if value else f"--no-{option}")
        else:
            values = value if isinstance(value, tuple) else (value,)
            words += [f"--{option}", *map(str, values)]
    return "".join(f" {word}" for word in words)


def is_given(option: str, argv: Sequence[str]) -> bool:
    """Tell whether a command line has an option, with whatever value.

    Args:
        option: Its name, with the dashes.
        argv: Words of the command line.
    """
    return any(word.partition("=")[0].replace("_", "-") == option for word in argv)


def selected_task(argv: Sequence[str], default: str) -> str:
    """Return the value of --task, before the full command line can be known.

    The other options and their defaults depend on the task.

    Raises:
        MuteError: If the option has no value.
    """

    def only_task(task: Annotated[str, tyro.conf.arg(name="task")] = default) -> str:
        return task

    without_help = [word for word in argv if word not in ("-h", "--help")]
    task, _ = in_one_line(
        lambda: tyro.cli(only_task, args=without_help, return_unknown_args=True, add_help=False)
    )
    return task


def task_name(asked: str) -> str:
    """Return the name of a task that a user asked for.

    Of `module:task`, the module is imported, which registers the task.

    Raises:
        MuteError: If the module cannot be imported.
    """
    module, colon, name = asked.rpartition(":")
    if colon:
        load_plugin(module, "--task")
    return name


def resolve_device(device: str) -> str:
    """Return 'cpu' or 'cuda' for 'auto', 'cpu' or 'cuda'.

    Raises:
        MuteError: If it is another word, or if there is no such device.
    """
    if device not in ("auto", "cpu", "cuda"):
        raise MuteError(f"--device must be auto, cpu or cuda, got {device!r}")
    import torch  # takes seconds, and the meter needs none of it

    if device == "auto":
        return "cuda" if torch.cuda.is_available() else "cpu"
    if device == "cuda" and not torch.cuda.is_available():
        raise MuteError("--device cuda: torch sees no CUDA device here, use --device cpu")
    return device


def check_option(option: str, value: float, allowed: Range) -> None:
    """Check a number.

    Args:
        option: Name of the option, without the dashes.
        value: What was given.
        allowed: What it may be.

    Raises:
        MuteError: If it is out of its range.
    """
    if not allowed.holds(value):
        raise MuteError(f"--{option} must be {allowed}, got {value}")


def check_trials(trials: int, seconds: float) -> None:
    """Check --trials and --seconds.

    Raises:
        MuteError: If there are none or too many, or they are too short to measure or too long.
    """
    check_option("trials", trials, MANY_ROBOTS)
    check_option("seconds", seconds, Range(1.0, LONGEST_WALK, above=True))


def check_betas(betas: Sequence[float]) -> None:
    """Check --beta.

    Raises:
        MuteError: If there is none, or one is out of its range.
    """
    if not betas or any(not 0.0 <= beta <= 1.0 for beta in betas):
        given = " ".join(map(str, betas)) or "none"
        raise MuteError(f"--beta must be numbers in [0, 1], got {given}")


def check_distinct(option: str, values: Sequence[object]) -> None:
    """Check that an option with a list has something in it, each once.

    Args:
        option: Its name, without the dashes.
        values: What was given.

    Raises:
        MuteError: If it is empty or repeats itself.
    """
    if not values:
        raise MuteError(f"--{option} must name at least one, got none")
    repeated = next((value for value in values if values.count(value) > 1), None)
    if repeated is not None:
        raise MuteError(f"--{option} must name each but once, got {repeated} again")


def check_words(option: str, words: Sequence[str], known: Iterable[str]) -> None:
    """Check that an option with a list names some of what there is, each once.

    Args:
        option: Its name, without the dashes.
        words: What was given.
        known: What there is.

    Raises:
        MuteError: If it is empty, repeats itself, or names something else.
    """
    check_distinct(option, words)
    unknown = next((word for word in words if word not in known), None)
    if unknown is not None:
        raise MuteError(f"--{option} must be of {', '.join(known)}, got {unknown!r}")


def check_seed(seed: int) -> None:
    """Check --seed.

    Raises:
        MuteError: If it is negative or takes more than 31 bits.
    """
    check_option("seed", seed, Range(0, 2**31 - 1, whole=True))


def check_wav(path: Path | None) -> None:
    """Check --wav.

    Raises:
        MuteError: If it names a file of another kind.
    """
    if path is not None and path.suffix.lower() != ".wav":
        raise MuteError(f"--wav must name a .wav file, got {str(path)!r}")


def check_video(path: Path | None) -> None:
    """Check --video.

    Raises:
        MuteError: If it names a file of another kind.
    """
    if path is not None and path.suffix.lower() != ".mp4":
        raise MuteError(f"--video must name an .mp4 file, got {str(path)!r}")


def make_directory(path: Path, option: str = "out") -> None:
    """Make the directory of an option, before any work whose figures could not be kept.

    Args:
        path: The directory.
        option: Name of the option, without the dashes.

    Raises:
        MuteError: If it cannot be made or written to.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise MuteError(
            f"--{option} {path}: cannot be made a directory: {error.strerror}"
        ) from error
    if not os.access(path, os.W_OK):
        raise MuteError(f"--{option} {path}: cannot be written to")


def command_line() -> list[str]:
    """Return the arguments that the program was started with."""
    return sys.argv[1:]
