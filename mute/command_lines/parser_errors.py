"""tyro's complaints in one line.

tyro draws its errors in a box on standard error and exits; it has no public way to have them as
data. So the text of the box is read, here and nowhere else. Where a new version draws it in another
way, its words still come out, on one line.
"""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Callable
from typing import TypeVar

from mute.support.errors import MuteError

__all__ = ["in_one_line"]

_Result = TypeVar("_Result")

_COLOUR = re.compile(r"\x1b\[[0-9;]*m")
_FRAME = "│╭╮╰╯ "
"""What the box's sides are drawn with; without UTF-8 it has none."""
_RULE = {"─", "-"}
"""What its rules are made of, with and without UTF-8."""


def in_one_line(parser: Callable[[], _Result]) -> _Result:
    """Return what a parser of tyro's returns.

    Raises:
        MuteError: In place of the box that it prints.
        SystemExit: After --help.
    """
    box = io.StringIO()
    try:
        with contextlib.redirect_stderr(box):
            return parser()
    except SystemExit as stop:
        if not stop.code:
            raise
        raise MuteError(f"{_complaint(box.getvalue())}; see --help") from None


def _complaint(box: str) -> str:
    """Return what stands between the box's title and the next rule or empty line."""
    lines = [line.strip(_FRAME) for line in _COLOUR.sub("", box).splitlines()]
    complaint: list[str] = []
    for text in lines[1:]:
        if not set(text) <= _RULE:
            complaint.append(text)
        elif complaint:
            break  # but without UTF-8, a rule follows the title
    return " ".join(complaint or lines).strip().rstrip(".")
