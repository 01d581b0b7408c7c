"""Figures as tables: on the console, and as CSV and JSON for other programs."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from mute.support.files import write_file
from mute.support.plain_data import without_nan

__all__ = ["print_table", "read_json", "write_csv", "write_json"]

Row = Mapping[str, Any]

_FILE_WIDTH = 240
"""Width of a table that goes to a file or a pipe, characters."""


def print_table(title: str, rows: Sequence[Row], columns: Sequence[str]) -> None:
    """Print some columns of a table, wider than 80 columns where no terminal sets a width."""
    table = Table(title=title, title_justify="left")
    for column in columns:
        table.add_column(column, justify="right", overflow="fold")
    for row in rows:
        table.add_row(*(_shown(row[column]) for column in columns))
    console = Console()
    if not console.is_terminal:
        console.width = max(console.width, _FILE_WIDTH)
    console.print(table)


def write_csv(path: Path, rows: Sequence[Row]) -> None:
    """Write a table as CSV with a header, whole or not at all.

    Raises:
        DiskError: If it cannot be written.
    """
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, fieldnames=list(rows[0]))
    writer.writeheader()
    writer.writerows(rows)
    write_file(path, text.getvalue().encode())


def write_json(path: Path, content: object) -> None:
    """Write plain data as JSON, whole or not at all; NaN becomes null, as JSON lacks a number.

    Raises:
        DiskError: If it cannot be written.
    """
    write_file(path, (json.dumps(without_nan(content), indent=2) + "\n").encode())


def read_json(path: Path) -> Any:  # noqa: ANN401
    """Return what a JSON file holds."""
    return json.loads(path.read_text())


def _shown(value: Any) -> str:  # noqa: ANN401
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
