"""What the command lines share: parsing, devices, and one clear line for bad input."""

from __future__ import annotations

import contextlib
import io
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, TypeVar

import torch
import tyro

from mute.errors import MuteError

__all__ = ["REPOSITORY", "parse", "resolve_device", "selected_task"]

REPOSITORY = Path(__file__).resolve().parents[2]
"""Root of the repository, where the resources are."""

_Args = TypeVar("_Args")
_Result = TypeVar("_Result")


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
        return _in_one_line(read)
    except ValueError as error:
        raise MuteError(str(error)) from error


def selected_task(argv: Sequence[str], default: str) -> str:
    """Return the value of --task, before the full command line can be known.

    The other options and their defaults depend on the task.

    Raises:
        MuteError: If the option has no value.
    """

    def only_task(task: Annotated[str, tyro.conf.arg(name="task")] = default) -> str:
        return task

    without_help = [word for word in argv if word not in ("-h", "--help")]
    task, _ = _in_one_line(
        lambda: tyro.cli(only_task, args=without_help, return_unknown_args=True, add_help=False)
    )
    return task


def resolve_device(device: str) -> str:
    """Return 'cpu' or 'cuda' for 'auto', 'cpu' or 'cuda'.

    Raises:
        MuteError: If it is another word, or if there is no such device.
    """
    if device not in ("auto", "cpu", "cuda"):
        raise MuteError(f"--device must be auto, cpu or cuda, got {device!r}")
    if device == "auto":
        return "cuda" if torch.cuda.is_available() else "cpu"
    if device == "cuda" and not torch.cuda.is_available():
        raise MuteError("--device cuda: torch sees no CUDA device here, use --device cpu")
    return device


def command_line() -> list[str]:
    """Return the arguments that the program was started with."""
    return sys.argv[1:]


def _in_one_line(parser: Callable[[], _Result]) -> _Result:
    """Return what a parser of tyro's returns; what it prints in a box becomes a `MuteError`."""
    box = io.StringIO()
    try:
        with contextlib.redirect_stderr(box):
            return parser()
    except SystemExit as stop:
        if not stop.code:
            raise
        raise MuteError(_first_paragraph(box.getvalue())) from None


def _first_paragraph(box: str) -> str:
    """Return what stands in a box of tyro's between its title and the next rule or empty line."""
    plain = re.sub(r"\x1b\[[0-9;]*m", "", box)  # on a terminal, tyro's text is coloured
    lines: list[str] = []
    for line in plain.splitlines()[1:]:
        text = line.strip("│╰╯ ")
        if set(text) <= {"─", "-"}:
            if lines:
                break
            continue  # without UTF-8, a rule follows the title
        lines.append(text)
    return f"{' '.join(lines).rstrip('.')}; see --help"
