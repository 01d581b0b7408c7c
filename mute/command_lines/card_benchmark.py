"""The page `docs/benchmark.md`: how fast training and hearing are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mute.command_lines.card_tables import markdown

__all__ = ["BenchmarkFiles", "benchmark_page"]

_RATES = {
    "num_envs": ("environments", "{:d}"),
    "engine": ("engine alone", "{:,.0f}"),
    "nominal_engine": ("engine, nominal robots", "{:,.0f}"),
    "environment": ("environment", "{:,.0f}"),
    "collection": ("collection", "{:,.0f}"),
    "learning": ("learning", "{:,.0f}"),
    "loop": ("whole loop", "{:,.0f}"),
    "environment_over_engine": ("environment / engine", "{:.0%}"),
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
_PARTS = {
    "name": ("part", "{}"),
    "robots": ("robots", "{}"),
    "wall": ("took (s)", "{:.2f}"),
    "real_time": ("times as fast as the robots walk", "{:.1f}"),
}
_PARTS_OF_SOUND = {
    "whole": "physics, policy, sound and meter",
    "recorder": "of that: finding landings and sliding",
    "sound": "of that: making and measuring sound",
    "lone recorder": "one robot: finding landings and sliding",
    "lone energies": "one robot: levels without sound",
    "lone walk": "one robot: everything",
}


@dataclass(frozen=True)
class BenchmarkFiles:
    """What the files hold, as plain data."""

    first: Mapping[str, Any]
    """Rates on the faster machine, with those of nominal robots as the engine's, and peers."""
    matched: Mapping[str, Any]
    """Rates on the slower one, compared with physics of the training's own robots."""
    peers: Mapping[str, Any]
    """Peers on a third machine."""
    sound: Mapping[str, Any]
    """What it takes to hear robots."""


def benchmark_page(files: BenchmarkFiles) -> str:
    """Return the whole page."""
    return "\n\n".join((_head(), _training(files), _peers(files), _sound(files))) + "\n"


def _head() -> str:
    return (
        "<!-- Made by `python -m mute.card --out docs`; do not edit. -->\n\n"
        "# Speed\n\n"
        "Control steps a second: environments times steps, each of 20 ms. All of it was timed on "
        "CPUs with 2 cores; the GPU has not been measured. Single runs on a shared machine differ "
        "by some percent, so use the ratios within one table. This page is made by `python -m "
        "mute.card --out docs`; the figures are those of the commits that wrote the files, some "
        "of which are older than today's networks."
    )


def _training(files: BenchmarkFiles) -> str:
    first, matched = files.first, files.matched
    nominal = {row["num_envs"]: row["loop"] / row["nominal_engine"] for row in matched["rates"]}
    shares = ", ".join(f"{share:.0%} at {number}" for number, share in nominal.items())
    turns = " and ".join(str(row["rollouts"]) for row in matched["rates"])
    return (
        "## Training\n\n"
        "`python -m mute.benchmark --num-envs 1024 4096 --out FILE` times every part in turns with "
        "the bare engine and takes medians over turns. The engine steps the training's own robots "
        "from the same states with the same actions, so what is missing to 100 % is what training "
        f"adds to physics. On {matched['machine']}, without bfloat16 units, "
        f"{turns} turns (`docs/benchmark_no_bfloat16.json`):\n\n"
        f"{_rates(matched['rates'])}\n\n"
        f"Nominal robots that stand are stepped faster; of their rate the loop's is {shares}.\n\n"
        f"An older run on {first['machine']}, of a faster kind, in which the engine is that of "
        "nominal robots (`docs/benchmark.json`):\n\n"
        f"{_rates(first['rates'])}"
    )


def _peers(files: BenchmarkFiles) -> str:
    return (
        "## Other simulations of a Go1 on the CPU\n\n"
        "`python -m mute.benchmark --peers all --mjlab-python PYTHON --playground-python PYTHON` "
        "times them after that. Each but the first has a robot and a task of its own. On "
        f"{files.first['machine']}, beside the older run above (`docs/benchmark.json`):\n\n"
        f"{markdown(files.first['peers'], _PEERS)}\n\n"
        f"On {files.peers['machine']} (`docs/peers.json`):\n\n"
        f"{markdown(files.peers['peers'], _PEERS)}"
    )


def _sound(files: BenchmarkFiles) -> str:
    sound = files.sound
    parts = [{**part, "name": _PARTS_OF_SOUND[part["name"]]} for part in sound["parts"]]
    return (
        "## Sound\n\n"
        f"`python -m benchmarks.sound --out docs/noise/benchmark.json`: {sound['trials']} trials "
        f"of {sound['seconds']:g} s on {sound['floor']}, physics at 1 ms, sound at 48 kHz, on "
        f"{sound['machine']}:\n\n"
        f"{markdown(parts, _PARTS)}\n\n"
        f"The process takes {sound['memory_mb']:.0f} MB, and {sound['memory_growth_mb']:.0f} MB "
        "more for walks of twice the length."
    )


def _rates(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the table of rates, without columns that a file has no figures for."""
    columns = {name: column for name, column in _RATES.items() if name in rows[0]}
    return markdown(rows, columns)
