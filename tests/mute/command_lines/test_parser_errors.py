"""Tests of tyro's complaints in one line: these fail where a new tyro draws its box otherwise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import pytest

from mute.command_lines.arguments import parse
from mute.command_lines.parser_errors import in_one_line
from mute.support.errors import MuteError


@dataclass
class _Args:
    must: int
    """A number that has to be given."""
    colour: Literal["red", "blue"] = "red"
    """A word of two."""
    a_rather_long_name_for_a_number: float = 0.0
    """A number whose name fills a narrow line."""


_BAD = [
    (["--must", "1", "--nope", "3"], ("Unrecognized options", "--nope")),
    (["--must", "x"], ("--must", "'x'")),
    (["--must"], ("--must", "Missing value")),
    ([], ("must", "A number that has to be given")),
    (["--must", "1", "--colour", "green"], ("--colour", "'green'", "red", "blue")),
    (
        ["--must", "1", "--a-rather-long-name-for-a-number", "y"],
        ("--a-rather-long-name-for-a-number", "'y'"),
    ),
]


@pytest.mark.parametrize("columns", ["40", "100"])
@pytest.mark.parametrize("colour", [False, True])
@pytest.mark.parametrize(("words", "told"), _BAD)
def test_a_complaint_is_one_line_of_words_that_names_option_and_value(
    words: list[str],
    told: tuple[str, ...],
    colour: bool,
    columns: str,
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setenv("COLUMNS", columns)
    if colour:
        monkeypatch.setenv("FORCE_COLOR", "1")
    with pytest.raises(MuteError) as error:
        parse(_Args, words, "Do nothing.")
    line = str(error.value)
    assert all(word in line for word in told), line
    assert line.isascii() and line.isprintable()
    assert line.endswith("; see --help")
    assert "---" not in line
    # The box repeats how the option is used below a rule; that is for --help.
    assert "usage" not in line.lower()


def test_a_box_of_another_kind_still_comes_out_in_its_words():
    def parser() -> None:
        import sys

        print("Something is wrong.", file=sys.stderr)
        raise SystemExit(2)

    with pytest.raises(MuteError, match=r"^Something is wrong; see --help$"):
        in_one_line(parser)


def test_help_is_no_complaint(capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit) as stop:
        parse(_Args, ["--help"], "Do nothing.")
    assert not stop.value.code
    assert "--colour" in capsys.readouterr().out
