"""Measure the speed of training, part by part: python -m mute.benchmark.

A training is timed in a process of its own, and so are the engine and the environment in it, which
do each rollout of the training again alone. Turns are taken in blocks, each with processes and a
seed of its own. Every figure is a median over the blocks' medians with its 95 % interval, and
blocks go on until the intervals of the ratios are as narrow as asked for; that they end just then
makes these slightly optimistic. `--against` names an environment with another version of MUTE: both
take turns on the machine, which only so can be compared. What each part is stands in
`benchmark_figures`, how turns are taken in `benchmark_turns`; `--until-walking` is
`benchmark_walking`'s.
`--peers` times other ways to step a Go1 after that, see `mute.command_lines.benchmark_peers`.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import json
import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from mute.command_lines.arguments import (
    Words,
    check_distinct,
    check_option,
    check_seed,
    command_line,
    parse,
    spelled,
    task_name,
)
from mute.command_lines.benchmark_figures import (
    CAPTIONS,
    MIN_BLOCKS,
    PARTS,
    comparison,
    figures_of,
    is_precise,
    shortfall,
    widest,
    with_interval,
)
from mute.command_lines.benchmark_peers import (
    PEER_COLUMNS,
    PeerRate,
    peer_names,
    peer_pythons,
    time_peers,
)
from mute.command_lines.benchmark_turns import (
    THIS,
    Block,
    Version,
    Worker,
    other_version,
    take_blocks,
    times_of,
)
from mute.command_lines.benchmark_walking import time_to_walk
from mute.evaluation.tables import print_table, write_json
from mute.support.errors import MuteError
from mute.support.provenance import machine_kind
from mute.support.ranges import Range
from mute.tasks import FLAT_TASK, make_task

__all__ = ["BenchmarkArgs", "main"]


@dataclass
class BenchmarkArgs:
    """Arguments of the benchmark."""

    task: str = FLAT_TASK
    """Task to measure; `module:task` imports a module of yours first, which registers it."""
    num_envs: tuple[int, ...] = (1024, 4096)
    """Numbers of environments."""
    precision: float = 0.03
    """Blocks go on until half the 95 % interval of each ratio's median over blocks is within this
    share of it. That is looked at after whole blocks, from the sixth on."""
    block_turns: int = 3
    """Turns of a block, after one that warms up; each block begins with fresh processes."""
    max_turns: int = 60
    """The most turns of each number of environments; what is not precise by then is told so."""
    rollouts: int | None = None
    """Exactly so many turns, however precise; a turn is a rollout of every part."""
    seed: int = 0
    """Seed of the order of the parts within a turn, and of the first block's trainings; that of
    each further block is one more."""
    against: str | None = None
    """PYTHON[:CHECKOUT]: the interpreter of an environment with another version of MUTE to compare
    with in the same turns, and the top of that version's tree unless it is installed there."""
    until_walking: bool = False
    """Instead of parts, time whole trainings until each first walks."""
    seeds: tuple[int, ...] = (0, 1, 2)
    """Seeds of the trainings of --until-walking."""
    peers: Words = ()
    """Other simulations to time on the CPU as well, in turns with this one: all, or some of
    gymnasium, mjlab, mujoco_playground and unilab; none if not given. All but gymnasium step as
    many robots as the smallest of --num-envs, after minutes of compiling, and are trained by their
    own loops. One that is not installed is told as such."""
    peers_from: Path | None = None
    """Folder with their virtual environments, which `python -m benchmarks.make_peers` makes."""
    mjlab_python: Path | None = None
    """Python interpreter that has mjlab, if that is elsewhere; this one if neither is given."""
    playground_python: Path | None = None
    """Python interpreter that has MuJoCo Playground (package playground), likewise."""
    unilab_python: Path | None = None
    """Python interpreter that has UniLab, likewise."""
    json: bool = False
    """Print JSON and nothing else."""
    out: Path | None = None
    """File to write the JSON to as well."""


_UNFINISHED = "not finished"
"""What a file says while more is being measured, and for ever if the machine is switched off."""

_PEER_ROUNDS = 6
"""Rounds of a peer unless --rollouts says how many: the fewest that have an interval."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Raises:
        MuteError: If an argument is bad, or a process fails; what was measured before that has
            then been written and printed.
        KeyboardInterrupt: If interrupted, likewise.
    """
    argv = command_line() if argv is None else list(argv)
    args = parse(BenchmarkArgs, argv, "Measure the speed of training, part by part.")
    peers = _check(args)
    versions = [THIS, *([other_version(args.against)] if args.against else [])]
    content: dict[str, Any] = {"task": task_name(args.task), "machine": machine_kind()}
    content |= {"load_before": os.getloadavg()[0], "stopped": None}
    content["options"] = spelled(args, _MEASURING)
    try:
        if args.until_walking:
            keep = functools.partial(_keep, args, content)
            time_to_walk(versions, args.task, args.seeds, content, keep)
        else:
            content |= {"precision": args.precision, "parts": PARTS, "rates": [], "peers": []}
            _measure(args, versions, content)
            _measure_peers(args, peers, content)
    except (KeyboardInterrupt, MuteError) as stop:
        content["stopped"] = str(stop) if isinstance(stop, MuteError) else "interrupted"
        if _has_figures(content):
            _tell(args, content)
        raise
    _tell(args, content)
    return 0


_MEASURING = ("num_envs", "precision", "block_turns", "max_turns", "rollouts", "seed", "seeds")
"""Options that decide on what is measured and how long."""


def _has_figures(content: Mapping[str, Any]) -> bool:
    return any(content.get(name) for name in ("rates", "walking", "peers"))


def _keep(args: BenchmarkArgs, content: Mapping[str, Any]) -> None:
    """Write what was measured so far."""
    if args.out is not None and _has_figures(content):
        write_json(args.out, {**content, "stopped": _UNFINISHED})


def _check(args: BenchmarkArgs) -> tuple[str, ...]:
    """Check the arguments and return the peers.

    Raises:
        MuteError: If one is bad.
    """
    make_task(task_name(args.task))
    peers = peer_names(args.peers)
    check_distinct("num-envs", args.num_envs)
    for num_envs in args.num_envs:
        check_option("num-envs", num_envs, Range(1, 2**20, whole=True))
    check_option("precision", args.precision, Range(0.001, 1.0))
    check_option("block-turns", args.block_turns, Range(1, 10**4, whole=True))
    least = MIN_BLOCKS * args.block_turns
    check_option("max-turns", args.max_turns, Range(least, 10**6, whole=True))
    if args.rollouts is not None:
        check_option("rollouts", args.rollouts, Range(1, 10**6, whole=True))
    check_seed(args.seed)
    check_distinct("seeds", args.seeds)
    for seed in args.seeds:
        check_option("seeds", seed, Range(0, 2**31 - 1, whole=True))
    if args.until_walking and peers:
        raise MuteError("--peers goes with the parts, not with --until-walking: leave one away")
    return peers


def _measure(args: BenchmarkArgs, versions: Sequence[Version], content: dict[str, Any]) -> None:
    """Add a row of rates for each number of environments, one that is cut short as well.

    Raises:
        MuteError: If a process fails.
    """
    for num_envs in args.num_envs:
        blocks: list[Block] = []

        def begin(number: int, num_envs: int = num_envs) -> list[Worker]:
            seed = args.seed + number
            return [Worker(version, args.task, num_envs, seed) for version in versions]

        taken = take_blocks(begin, args.block_turns, args.seed)
        try:
            with contextlib.closing(taken), _progress(args, num_envs) as show:
                for blocks in taken:
                    show(blocks)
                    if _enough(blocks, args):
                        break
        except MuteError as error:
            raise MuteError(f"--num-envs {num_envs}: {error}") from error
        finally:
            if blocks:
                content["versions"] = _same_versions(blocks)
                content["rates"].append(_row(num_envs, blocks, args.precision))
                _keep(args, content)


def _turns(blocks: Sequence[Block]) -> int:
    return sum(block.turns for block in blocks)


def _enough(blocks: Sequence[Block], args: BenchmarkArgs) -> bool:
    """Return whether there is no need for another turn, or no leave."""
    turns = _turns(blocks)
    if args.rollouts is not None:
        return turns >= args.rollouts
    if turns >= args.max_turns:
        return True
    whole = blocks[-1].turns == args.block_turns
    return whole and is_precise(times_of(blocks), args.precision)


def _same_versions(blocks: Sequence[Block]) -> dict[str, dict[str, Any]]:
    """Return what the processes of all blocks say of their versions.

    Raises:
        MuteError: If a tree or an environment has changed in between.
    """
    first, *others = (
        {name: _versions(ready) for name, ready in block.ready.items()} for block in blocks
    )
    for other in others:
        for name, version in other.items():
            if version != first[name]:
                raise MuteError(
                    f"the {name} version has changed while it was measured, from {first[name]} to "
                    f"{version}: keep its tree as it is and begin anew"
                )
    return first


def _versions(ready: Mapping[str, Any]) -> dict[str, Any]:
    left_out = ("control_steps", "peak_memory_mb")
    return {name: value for name, value in ready.items() if name not in left_out}


def _row(num_envs: int, blocks: Sequence[Block], precision: float) -> dict[str, Any]:
    """Return the figures of one number of environments, as plain data."""
    times = times_of(blocks)
    ready = {name: dict(about) for name, about in blocks[0].ready.items()}
    for name, about in ready.items():
        about["peak_memory_mb"] = max(block.ready[name]["peak_memory_mb"] for block in blocks)
    row = {"num_envs": num_envs, "blocks": len(blocks), "turns": _turns(blocks)}
    row |= {"not_precise": shortfall(times, precision)}
    row |= figures_of(times["new"], ready["new"])
    if "old" in times:
        memory = {name: each["peak_memory_mb"] for name, each in ready.items()}
        row |= {"old": figures_of(times["old"], ready["old"])}
        row |= {"new_over_old": comparison(times, memory)}
    return row


@contextlib.contextmanager
def _progress(args: BenchmarkArgs, num_envs: int) -> Iterator[Callable[[Sequence[Block]], None]]:
    """Show the turns of one number of environments; yield what is to be called after each."""
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("turn {task.completed}"))
    ends = (TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn())
    console = Console(stderr=True)
    with Progress(*columns, *ends, console=console, disable=args.json) as progress:
        name = f"{num_envs} environments"
        shown = progress.add_task(name, total=args.rollouts)

        def show(blocks: Sequence[Block]) -> None:
            turns, width = _turns(blocks), widest(times_of(blocks))[1]
            known = f", ±{width:.1%}" if math.isfinite(width) else ""
            total = args.rollouts or _turns_in_all(turns, width, args)
            progress.update(shown, completed=turns, total=total, description=f"{name}{known}")

        yield show


def _turns_in_all(turns: int, width: float, args: BenchmarkArgs) -> int | None:
    """Return about how many turns it takes: intervals shrink as the root of their number grows."""
    if not math.isfinite(width):
        return None
    needed = math.ceil(turns * (width / args.precision) ** 2)
    return min(args.max_turns, max(turns, MIN_BLOCKS * args.block_turns, needed))


def _measure_peers(args: BenchmarkArgs, peers: Sequence[str], content: dict[str, Any]) -> None:
    """Add a row for each peer and for MUTE beside them, anew after each of their rounds."""
    if not peers:
        return
    given = {
        "mjlab": args.mjlab_python,
        "mujoco_playground": args.playground_python,
        "unilab": args.unilab_python,
    }
    pythons = peer_pythons(peers, args.peers_from, given)
    rounds, robots = args.rollouts or _PEER_ROUNDS, min(args.num_envs)

    def keep(rates: Sequence[PeerRate]) -> None:
        content["peers"] = [dataclasses.asdict(rate) for rate in rates]
        _keep(args, content)

    keep(time_peers(peers, pythons, robots, rounds, args.task, after_round=keep))


def _tell(args: BenchmarkArgs, content: Mapping[str, Any]) -> None:
    """Write and print what was measured."""
    if args.out is not None:
        write_json(args.out, content)
    if args.json:
        print(json.dumps(content))
        return
    if args.until_walking:
        shown = content["walking"]
        print_table(f"{content['definition']}; {content['machine']}", shown, list(shown[0]))
        print("".join(_told_of_walks(content)), end="")
        return
    print("\n".join(f"{CAPTIONS[name]}: {sentence}" for name, sentence in content["parts"].items()))
    for row in content["rates"]:
        title = f"{row['num_envs']} environments, medians of {row['blocks']} blocks, 95 % intervals"
        table = list(_table(row))
        print_table(f"{title}; {content['machine']}", table, list(table[0]))
        if row["not_precise"]:
            print(f"{row['num_envs']} environments: {row['not_precise']}", file=sys.stderr)
    if content["peers"]:
        print_table("peers, control steps/s", content["peers"], list(PEER_COLUMNS))


def _told_of_walks(content: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines that compare the versions' walks."""
    median, neither = content["median_old_over_new"], content["neither_walks"]
    if median is not None:
        never = {"never": "the old version never walks", 0.0: "the new version never walks"}
        told = never.get(median) or f"{median:.2f}"
        yield f"old / new, median over seeds: {told}\n"
    if neither:
        yield f"seeds with which neither version walks, left out: {neither}\n"


def _table(row: Mapping[str, Any]) -> Iterator[dict[str, str]]:
    """Yield the lines of the table of one number of environments."""
    for name, caption in CAPTIONS.items():
        form = "{:,.0f}" if name in PARTS else "{:.1%}"
        line = {"control steps/s, or ratio": caption, "new": with_interval(row, name, form)}
        if "old" in row:
            line["old"] = with_interval(row["old"], name, form)
            compared = name in PARTS
            line["new / old"] = (
                with_interval(row["new_over_old"], name, "{:.3f}") if compared else "-"
            )
        yield line
    line = {"control steps/s, or ratio": "peak memory (MB)", "new": f"{row['peak_memory_mb']:,.0f}"}
    if "old" in row:
        line["old"] = f"{row['old']['peak_memory_mb']:,.0f}"
        line["new / old"] = f"{row['new_over_old']['peak_memory_mb']:.3f}"
    yield line
