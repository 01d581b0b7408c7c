"""Figures of noise levels in the manner of the paper's: a line for MNL, a band up to PNL."""

from __future__ import annotations

import io
import itertools
from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mute.evaluation.noise_levels import NoiseRow
from mute.evaluation.plotting import COLOURS, STYLE
from mute.support.files import write_file

__all__ = ["draw_beta_sweep", "draw_speed_sweep", "save_figure"]


def draw_speed_sweep(rows: Sequence[NoiseRow], directory: Path) -> list[Path]:
    """Draw levels against the actual speed, a line for each beta; return the files."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(5.2, 3.4), layout="constrained")
        axes = figure.subplots()
        betas = dict.fromkeys(row.beta for row in rows)
        for colour, beta in zip(itertools.cycle(COLOURS), betas, strict=False):
            own = sorted((row for row in rows if row.beta == beta), key=lambda row: row.speed_mean)
            _draw_levels(axes, [row.speed_mean for row in own], own, colour, f"beta = {beta:g}")
        axes.set_xlabel("actual speed (m/s)")
        axes.set_title(f"{rows[0].surface}: MNL (line) to PNL (band), modelled", fontsize=9)
        axes.legend(frameon=False)
        return save_figure(figure, directory / "sweep_speed")


def draw_beta_sweep(rows: Sequence[NoiseRow], directory: Path) -> list[Path]:
    """Draw levels and the squared tracking error against beta; return the files."""
    ordered = sorted(rows, key=lambda row: row.beta)
    betas = [row.beta for row in ordered]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(5.2, 3.4), layout="constrained")
        axes = figure.subplots()
        _draw_levels(axes, betas, ordered, COLOURS[0], "level")
        axes.set_xlabel("quiet factor beta")
        axes.set_title(
            f"{rows[0].surface}, {rows[0].command_speed:g} m/s commanded: "
            "MNL (line) to PNL (band), modelled",
            fontsize=9,
        )
        other = axes.twinx()
        other.plot(betas, [row.velocity_error_sq for row in ordered], color=COLOURS[1], marker="s")
        other.set_ylabel("squared tracking error ((m/s)$^2$)", color=COLOURS[1])
        other.set_ylim(bottom=0.0)
        other.grid(visible=False)
        return save_figure(figure, directory / "sweep_beta")


def save_figure(figure: Figure, stem: Path) -> list[Path]:
    """Write a figure as PNG and SVG, each whole or not at all, and return the files.

    Raises:
        DiskError: If one cannot be written.
    """
    paths = [stem.with_suffix(suffix) for suffix in (".png", ".svg")]
    for path in paths:
        picture, form = io.BytesIO(), path.suffix.removeprefix(".")
        metadata = {"Date": None} if form == "svg" else None
        figure.savefig(picture, format=form, dpi=160, metadata=metadata)
        write_file(path, picture.getvalue())
    return paths


def _draw_levels(
    axes: Axes, x: Sequence[float], rows: Sequence[NoiseRow], colour: str, label: str
) -> None:
    mnl = [row.mnl_mean for row in rows]
    axes.plot(x, mnl, color=colour, marker="o", markersize=3.5, label=label)
    pnl = [row.pnl_mean for row in rows]
    axes.fill_between(x, mnl, pnl, color=colour, alpha=0.18, linewidth=0.0)
    axes.set_ylabel("level (dBA)")
