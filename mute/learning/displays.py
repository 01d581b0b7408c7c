"""How a training shows where it stands: a live picture on a terminal, or a line an iteration."""

from __future__ import annotations

import time
from collections.abc import Iterator

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

__all__ = ["LiveDisplay", "PlainDisplay"]

_COLUMNS = {
    "Perf/total_fps": ("steps/s", "{:,.0f}"),
    "Train/mean_reward": ("reward", "{:.2f}"),
    "Gait/velocity_error_sq": ("tracking error (m/s)^2", "{:.4f}"),
    "Gait/landing_speed_low_beta": ("landing speed, beta < 0.25 (m/s)", "{:.3f}"),
    "Gait/landing_speed_high_beta": ("landing speed, beta > 0.75 (m/s)", "{:.3f}"),
    "Gait/apex_high_beta": ("apex, beta > 0.75 (m)", "{:.4f}"),
    "Noise/level_beta_0": ("level on wood, beta 0 (dBA, modelled)", "{:.1f}"),
    "Noise/level_beta_1": ("level on wood, beta 1 (dBA, modelled)", "{:.1f}"),
    "Train/mean_episode_length": ("episode (steps)", "{:.0f}"),
    "Loss/estimator_velocity_rmse": ("velocity RMSE (m/s)", "{:.3f}"),
    "Loss/estimator_phase_mae": ("phase MAE", "{:.3f}"),
}
"""Curves that the display shows, with their captions."""

_TROUBLE = {
    "Episode/unstable": ("unstable simulations a step", "{:.3g}"),
    "Episode/invalid_actions": ("robots a step with NaN or infinity for an action", "{:.3g}"),
}
"""Curves that it shows where they are not zero."""


class LiveDisplay:
    """One live progress display for a terminal; a context manager."""

    def __init__(self, title: str) -> None:
        """Prepare the display; it appears on entering."""
        self._progress = Progress(
            TextColumn(f"[bold]{title}"),
            BarColumn(),
            TextColumn("{task.completed}/{task.total} iterations"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
        )
        self._task = self._progress.add_task("train", total=None)
        self._live = Live(self._progress, console=Console(stderr=True), refresh_per_second=4)

    def __enter__(self) -> LiveDisplay:
        """Show the display."""
        self._live.start()
        return self

    def __exit__(self, *exc: object) -> None:
        """Leave the last state on the screen."""
        self._live.stop()

    def update(self, iteration: int, total: int, scalars: dict[str, float]) -> None:
        """Show an iteration's figures."""
        self._progress.update(self._task, completed=iteration + 1, total=total)
        self._live.update(Group(self._progress, _figures(scalars)))


class PlainDisplay:
    """One line an iteration, for logs; a context manager."""

    def __enter__(self) -> PlainDisplay:
        """Start the clock."""
        self._start, self._first = time.perf_counter(), None
        return self

    def __exit__(self, *exc: object) -> None:
        """Do nothing: every line is out already."""

    def update(self, iteration: int, total: int, scalars: dict[str, float]) -> None:
        """Print an iteration's figures and the time left."""
        self._first = iteration if self._first is None else self._first
        elapsed = time.perf_counter() - self._start
        left = elapsed / (iteration + 1 - self._first) * (total - iteration - 1)
        figures = [f"{caption} {figure}" for caption, figure in _shown(scalars)]
        print(
            f"{iteration + 1}/{total}", *figures, f"left {left / 60:.1f} min", sep=" | ", flush=True
        )


def _figures(scalars: dict[str, float]) -> RenderableType:
    table = Table.grid(padding=(0, 2))
    for caption, figure in _shown(scalars):
        table.add_row(caption, figure)
    return table


def _shown(scalars: dict[str, float]) -> Iterator[tuple[str, str]]:
    """Yield the caption and the figure of each curve that a display shows."""
    for tag, (caption, form) in (_COLUMNS | _TROUBLE).items():
        if tag in scalars and (tag in _COLUMNS or scalars[tag] != 0.0):
            yield caption, form.format(scalars[tag])
