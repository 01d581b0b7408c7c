"""Print a policy's card, its noise and a benchmark as Markdown tables: python -m mute.card."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mute.command_lines.arguments import command_line, parse
from mute.evaluation.paper_levels import PAPER_LEVELS
from mute.evaluation.tables import read_json
from mute.support.errors import MuteError
from mute.support.provenance import REPOSITORY
from mute.support.resources import RESOURCES
from mute.tasks import DEFAULT_TASK

__all__ = ["CardArgs", "main", "markdown"]

_RANGE = {
    "beta": ("beta", "{:g}"),
    "fall_rate": ("falls", "{:.1%}"),
    "velocity_error_sq": ("velocity error (m/s)^2", "{:.4f}"),
    "velocity_rmse": ("estimator: velocity RMSE (m/s)", "{:.3f}"),
    "height_rmse": ("height RMSE (m)", "{:.4f}"),
    "phase_mae": ("phase MAE", "{:.3f}"),
}
_AT_SPEED = {
    "beta": ("beta", "{:g}"),
    "landing_speed_mean": ("landing speed (m/s)", "{:.3f}"),
    "landing_speed_rms": ("its RMS", "{:.3f}"),
    "apex_mean": ("apex (cm)", "{:.1f}"),
    "duty_factor": ("duty factor", "{:.2f}"),
    "stride_frequency": ("strides/s a foot", "{:.2f}"),
    "power": ("power, control steps (W)", "{:.1f}"),
}
_NOISE = {
    "surface": ("floor", "{}"),
    "beta": ("beta", "{:g}"),
    "mnl": ("MNL (dBA)", "{}"),
    "pnl": ("PNL (dBA)", "{}"),
    "paper": ("paper, real robot: MNL, PNL", "{}"),
    "speed_mean": ("actual speed (m/s)", "{:.2f}"),
    "velocity_error_sq": ("velocity error (m/s)^2", "{:.3f}"),
    "landing_speed_rms": ("landing speed, RMS (m/s)", "{:.3f}"),
    "apex_cm": ("apex (cm)", "{:.1f}"),
    "stride_frequency": ("strides/s a foot", "{:.2f}"),
    "cost_of_transport": ("cost of transport", "{:.2f}"),
}
_SOURCES = {
    "surface": ("floor", "{}"),
    "beta": ("beta", "{:g}"),
    "laeq_impacts": ("impacts", "{:.1f}"),
    "laeq_scuffing": ("scuffing", "{:.1f}"),
    "laeq_drive": ("drive", "{:.1f}"),
    "laeq_fan": ("fan", "{:.1f}"),
    "laeq_mean": ("all", "{:.1f}"),
}
_RATES = {
    "num_envs": ("environments", "{:d}"),
    "engine": ("engine alone", "{:,.0f}"),
    "environment": ("environment", "{:,.0f}"),
    "collection": ("collection", "{:,.0f}"),
    "learning": ("learning", "{:,.0f}"),
    "loop": ("whole loop", "{:,.0f}"),
    "loop_over_engine": ("loop / engine", "{:.0%}"),
    "peak_memory_mb": ("memory (MB)", "{:,.0f}"),
}
_PEERS = {
    "name": ("peer", "{}"),
    "version": ("version", "{}"),
    "num_envs": ("environments", "{}"),
    "steps_per_second": ("control steps/s", "{:,.0f}"),
    "note": ("what it steps", "{}"),
}


@dataclass
class CardArgs:
    """Arguments of the card."""

    card: Path = RESOURCES / "go1" / f"{DEFAULT_TASK}.json"
    """Card that `mute.command_lines.release` wrote."""
    noise: Path = REPOSITORY / "docs" / "noise" / "noise.json"
    """File that `evaluate.py noise` wrote."""
    benchmark: Path = REPOSITORY / "docs" / "benchmark.json"
    """File that `mute.command_lines.benchmark --out` wrote."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Raises:
        MuteError: If a file is missing.
    """
    argv = command_line() if argv is None else list(argv)
    args = parse(CardArgs, argv, "Print a policy's card, its noise and a benchmark as Markdown.")
    for path in (args.card, args.noise, args.benchmark):
        if not path.is_file():
            raise MuteError(f"no file at {path}")
    card, benchmark = read_json(args.card), read_json(args.benchmark)
    figures = card["figures"]
    print(
        f"`{card['command']}`, seed {card['seed']}, commit {card['commit'][:10]}: "
        f"{card['iterations']} iterations, {card['steps'] / 1e6:.1f} M steps, "
        f"{card['wall_time_minutes']:.0f} min on {card['machine']}.\n"
    )
    print(f"Over the command range, {figures['trials']} trials of {figures['seconds']:g} s:\n")
    print(markdown(figures["range"], _RANGE))
    print(f"\nAt an actual forward speed of {figures['speed']:g} m/s:\n")
    in_cm = [row | {"apex_mean": _times(row["apex_mean"], 100.0)} for row in figures["at_speed"]]
    print(markdown(in_cm, _AT_SPEED))
    noise = read_json(args.noise)
    print(
        f"\nModelled noise at the trunk, {noise[0]['command_speed']:g} m/s commanded, "
        f"{noise[0]['trials']} trials:\n"
    )
    print(markdown([_noise_row(row) for row in noise], _NOISE))
    print("\nEquivalent level of each source there (dBA, modelled):\n")
    print(markdown(noise, _SOURCES))
    print(f"\nControl steps/s of `{benchmark['task']}` on {benchmark['machine']}:\n")
    print(markdown(benchmark["rates"], _RATES))
    if benchmark.get("peers"):
        print("\nOther simulations of a Go1 on the same CPU, timed after that:\n")
        print(markdown(benchmark["peers"], _PEERS))
    return 0


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


def _noise_row(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return a row of `evaluate.py noise` with its spreads, and the paper's levels, in words."""
    measured = PAPER_LEVELS.get(f"mute beta {row['beta']:g}", {}).get(row["surface"])
    return {
        **row,
        "mnl": _spread(row, "mnl"),
        "pnl": _spread(row, "pnl"),
        "paper": None if measured is None else f"{measured[0]:.1f}, {measured[1]:.1f}",
        "apex_cm": _times(row["apex_mean"], 100.0),
    }


def _spread(row: Mapping[str, Any], name: str) -> str | None:
    """Return a level with its spread, where it has one, and from how many trials if not from all.

    Args:
        row: A row of `evaluate.py noise`.
        name: Of the level.
    """
    mean, deviation = row[f"{name}_mean"], row[f"{name}_std"]
    if mean is None:
        return None
    level = f"{mean:.1f}" if deviation is None else f"{mean:.1f} +- {deviation:.1f}"
    heard = row.get("trials_heard", row["trials"])
    return level if heard == row["trials"] else f"{level} ({heard} of {row['trials']} trials)"


def _times(value: float | None, factor: float) -> float | None:
    return None if value is None else factor * value
