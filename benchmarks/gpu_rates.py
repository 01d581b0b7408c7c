"""Time MUTE and mjlab in turns on one device: python -m benchmarks.gpu_rates --num-envs 4096.

Environments alone and whole training loops, as `mute.benchmark --peers` times them on the CPU.
Prints a JSON object after each round, a line each, with all that is known until then.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mute.command_lines.arguments import check_option, command_line, parse
from mute.command_lines.benchmark_peers import ITSELF, PeerRate, peer_pythons, time_peers
from mute.support.errors import run_cli
from mute.support.plain_data import without_nan
from mute.support.ranges import Range
from mute.tasks import FLAT_TASK

from .gpu_memory import memory_in_use

__all__ = ["GpuRatesArgs", "main"]


@dataclass
class GpuRatesArgs:
    """Arguments of the timing."""

    num_envs: int = 4096
    """Robots of each."""
    rounds: int = 6
    """Rounds that count."""
    device: str = "cuda"
    """cuda or cpu."""
    peers_from: Path | None = None
    """Folder with mjlab's environment, which `python -m benchmarks.make_peers` makes."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status: 1 if MUTE itself has no rate.

    Raises:
        MuteError: If an argument is bad.
    """
    argv = command_line() if argv is None else list(argv)
    args = parse(GpuRatesArgs, argv, "Time MUTE and mjlab in turns on one device.")
    check_option("num-envs", args.num_envs, Range(1, 2**20, whole=True))
    check_option("rounds", args.rounds, Range(1, 10**6, whole=True))
    names = ["mjlab"] if args.peers_from is not None else []
    pythons = peer_pythons(names, args.peers_from, {})
    peak: float | None = None

    def after_round(rates: Sequence[PeerRate]) -> None:
        nonlocal peak
        used = memory_in_use() if args.device != "cpu" else None  # nothing is timed now
        if used is not None:
            peak = max(used, peak or 0.0)
        content: dict[str, Any] = {rate.name: dataclasses.asdict(rate) for rate in rates}
        if not names:
            content["mjlab"] = {"note": "not timed: no --peers-from with its environment was given"}
        content["peak_gpu_memory_mb"] = peak
        print(json.dumps(without_nan(content)), flush=True)

    rates = time_peers(
        names, pythons, args.num_envs, args.rounds, FLAT_TASK, device=args.device,
        after_round=after_round,
    )  # fmt: skip
    return int(next(rate for rate in rates if rate.name == ITSELF).loop is None)


if __name__ == "__main__":
    run_cli(main)
