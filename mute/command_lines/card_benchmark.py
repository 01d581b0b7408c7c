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
    "engine": ("engine", "{}"),
    "robot": ("robot", "{}"),
    "task": ("task", "{}"),
    "physics": ("a control step", "{}"),
    "num_envs": ("environments", "{}"),
    "environment": ("environment alone", "{}"),
    "loop": ("whole training loop", "{}"),
    "note": ("note", "{}"),
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
        "## Other simulations on the CPU\n\n"
        "`python -m benchmarks.make_peers --into DIR` makes their environments, and `python -m "
        "mute.benchmark --peers all --peers-from DIR` times them in turns with MUTE itself: the "
        "environment alone, and their own training loops, all of an iteration, without what is "
        "compiled before. Medians over rounds, in brackets the 95 % interval where there are six "
        "or more. mjlab, MuJoCo Playground and UniLab have robots and tasks of their own. On "
        f"{files.first['machine']}, beside the older run above (`docs/benchmark.json`):\n\n"
        f"{_peer_table(files.first['peers'])}\n\n"
        f"On {files.peers['machine']} (`docs/peers.json`):\n\n"
        f"{_peer_table(files.peers['peers'])}"
    )


def _peer_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return peers with intervals and shares of MUTE's rate, as far as a file knows them."""
    return markdown([_peer_cells(row) for row in rows], _PEERS)


def _peer_cells(row: Mapping[str, Any]) -> dict[str, Any]:
    cells = {name: row.get(name) for name in _PEERS}
    if row.get("decimation") is not None:
        cells["physics"] = f"{row['decimation']} x {1000 * row['physics_step']:g} ms"
    return cells | {part: _peer_rate(row, part) for part in ("environment", "loop")}


def _peer_rate(row: Mapping[str, Any], part: str) -> str | None:
    """Return a rate as in "1,234 [1,200, 1,300], 12% of mute"."""
    if row.get(part) is None:
        return None
    told = f"{row[part]:,.0f}"
    low, high = row.get("intervals", {}).get(part, (None, None))
    if low is not None and high is not None:
        told += f" [{low:,.0f}, {high:,.0f}]"
    share = row.get("over_mute", {}).get(part)
    return told if share is None or row["name"] == "mute" else f"{told}, {share:.0%} of mute"


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
