"""Targets on the screen: each figure beside what it has to be, and how many are met."""

from __future__ import annotations

from collections.abc import Sequence

from mute.evaluation.reliability.figures import Figure, shown
from mute.evaluation.tables import print_table

__all__ = ["print_targets"]


def print_targets(title: str, figures: Sequence[Figure]) -> None:
    """Print a table of the figures and, below it, how many targets are met; nothing of none.

    Args:
        title: Title of the table.
        figures: What is judged.
    """
    if not figures:
        return
    rows = [
        {
            "part": figure.part,
            "figure": figure.name,
            "value": shown(figure.value, figure.unit),
            "target": figure.target.text(figure.unit),
            "met": "met" if figure.met else "NOT MET",
        }
        for figure in figures
    ]
    print_table(title, rows, list(rows[0]))
    print(f"{sum(figure.met for figure in figures)} of {len(rows)} targets are met")
