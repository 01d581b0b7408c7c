"""Tables in Markdown, and figures with their spread."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence
from typing import Any

from mute.support.errors import MuteError

__all__ = [
    "cut_short",
    "markdown",
    "mean_and_spread",
    "spread_of_trials",
    "times",
    "usual_rows",
    "with_part",
]


def markdown(rows: Sequence[Mapping[str, Any]], columns: Mapping[str, tuple[str, str]]) -> str:
    """Return rows as a Markdown table.

    Args:
        rows: Values by name.
        columns: By name, a column's caption and the format of its values.
    """
    lines = ["| " + " | ".join(caption for caption, _ in columns.values()) + " |"]
    lines.append("|" + " --- |" * len(columns))
    for row in rows:
        cells = [
            "-" if row[name] is None else form.format(row[name])
            for name, (_, form) in columns.items()
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def cut_short(stopped: str | None) -> str:
    """Return what to say of a run that was stopped, with a space before it; nothing of others."""
    return f" The run was cut short: {stopped}." if stopped else ""


def mean_and_spread(values: Sequence[float], form: str) -> str:
    """Return the mean of values and, of several, their sample standard deviation.

    Args:
        values: One or more.
        form: Of each of the two figures, as `{:.2f}`.
    """
    if len(values) == 1:
        return form.format(values[0])
    return f"{form.format(statistics.mean(values))} ± {form.format(statistics.stdev(values))}"


def spread_of_trials(row: Mapping[str, Any], name: str) -> str | None:
    """Return a level with its spread, where it has one, and from how many trials if not from all.

    Args:
        row: A row of `evaluate.py noise`.
        name: Of the level.
    """
    mean, deviation = row[f"{name}_mean"], row[f"{name}_std"]
    if mean is None:
        return None
    level = f"{mean:.1f}" if deviation is None else f"{mean:.1f} ± {deviation:.1f}"
    heard = row.get("trials_heard", row["trials"])
    return level if heard == row["trials"] else f"{level} ({heard} of {row['trials']} trials)"


def times(value: float | None, factor: float) -> float | None:
    """Return a value in another unit; what is missing stays so."""
    return None if value is None else factor * value


def usual_rows(rows: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return the rows of a table of levels that are of robots as they are."""
    return [row for row in rows if row["robots"] == "different"]


def with_part(page: str, mark: str, part: str) -> str:
    """Return a page with another part between its marks, `<!-- mark -->` and `<!-- /mark -->`.

    Raises:
        MuteError: If the marks are not there.
    """
    begin, end = f"<!-- {mark} -->", f"<!-- /{mark} -->"
    if begin not in page or end not in page:
        raise MuteError(f"the page has no {begin} and {end}")
    before, rest = page.split(begin, 1)
    return f"{before}{begin}\n\n{part}\n\n{end}{rest.split(end, 1)[1]}"
