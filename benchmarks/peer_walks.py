"""Find when peers' own policies walk: python -m benchmarks.peer_walks --peers-from DIR.

One peer after the other trains in its own loop, with its own task's rewards. Every few minutes of
training what it has learnt walks, by its own task's commands on its own robot, nominal and without
noise on its actions or on what it sees; whether that is a walk is decided as for MUTE: error below
0.05 (m/s)^2, falls below 1 %. A peer ends with its first walk, or when its minutes are over: then
the row says how far it came, and nothing is extrapolated. Minutes are those of training alone,
without what is compiled before the first iteration ends. For MUTE itself, `evaluate.py progress`
tells the same of checkpoints that are closer together: a peer may have walked as much earlier than
told as its trials are apart, which the file says.
"""

from __future__ import annotations

import dataclasses
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rich.console import Console

from mute.command_lines.arguments import Words, check_option, check_trials, command_line, parse
from mute.command_lines.benchmark_peers import ALL_PEERS, Peer, peer_names, peer_pythons
from mute.evaluation.progress import walks
from mute.evaluation.tables import print_table, write_json
from mute.support.errors import MuteError, run_cli
from mute.support.plain_data import without_nan
from mute.support.provenance import machine_kind
from mute.support.ranges import Range
from mute.tasks import FLAT_TASK

__all__ = ["PeerWalk", "PeerWalksArgs", "Trial", "main", "train_until_walking"]

_COLUMNS = (
    "name",
    "num_envs",
    "walks",
    "minutes",
    "steps",
    "velocity_error_sq",
    "fall_rate",
    "note",
)


@dataclass
class PeerWalksArgs:
    """Arguments of the search."""

    peers: Words = (ALL_PEERS,)
    """All, or some of mjlab, mujoco_playground and unilab: those that learn."""
    peers_from: Path | None = None
    """Folder with their environments, which `python -m benchmarks.make_peers` makes."""
    num_envs: int = 1024
    """Robots of a training."""
    minutes: float = 30.0
    """Minutes of training of each."""
    every: float = 5.0
    """Minutes of training between two trials."""
    trials: int = 128
    """Robots of a trial."""
    seconds: float = 10.0
    """Duration of a trial."""
    json: bool = False
    """Print JSON and nothing else."""
    out: Path | None = None
    """File to write the JSON to as well, after each trial."""


@dataclass
class Trial:
    """How a policy walked at some time of its training."""

    minutes: float
    """Time trained until then, min."""
    steps: int
    """Control steps of training until then, environments times steps."""
    velocity_error_sq: float
    """Mean of |v_xy^cmd - v_xy|^2, (m/s)^2."""
    fall_rate: float
    """Share of the robots that fell."""
    walks: bool
    """Whether that is a walk."""


@dataclass
class PeerWalk:
    """A peer's training until it walks, or until its time is over."""

    name: str
    """Its name."""
    version: str | None
    """Version of its package."""
    engine: str | None
    """Engine and its version."""
    robot: str | None
    """Name of the robot."""
    task: str | None
    """Name of the task."""
    num_envs: int | None
    """Robots of the training."""
    trials: list[Trial] = field(default_factory=list)
    """Its policy's trials, in order."""
    note: str = ""
    """Why it did not train or walk to the end, or what else should be known."""

    def as_row(self) -> dict[str, Any]:
        """Return it as plain data with the last trial's figures, which are None without one."""
        last = self.trials[-1] if self.trials else None
        names = [each.name for each in dataclasses.fields(Trial)]
        return dataclasses.asdict(self) | {name: getattr(last, name, None) for name in names}


def train_until_walking(
    peer: Peer, args: PeerWalksArgs, keep: Callable[[PeerWalk], None] = lambda _walk: None
) -> PeerWalk:
    """Train a peer until its policy walks, or its minutes are over.

    Args:
        peer: The peer, which has not trained yet.
        args: How long, and what a trial is.
        keep: Given what is known after each trial.
    """
    about = peer.rate
    walk = PeerWalk(
        about.name, about.version, about.engine, about.robot, about.task, about.num_envs
    )
    walk.note = peer.fault or about.note
    iterations: list[float] = []
    steps, due = 0, args.every
    while peer.fault is None:
        answer = peer.ask("loop")
        if "steps" not in answer:
            walk.note = answer.get("error", "it has no training")
            break
        steps += answer["steps"]
        iterations.append(answer["seconds"])
        minutes = _training_seconds(iterations) / 60.0
        if minutes < min(due, args.minutes):
            continue
        due = minutes + args.every
        answer = peer.ask(f"walk {args.trials} {args.seconds}")
        if "fall_rate" not in answer:
            walk.note = answer.get("error", "its policy cannot be tried")
            break
        figures = (answer["velocity_error_sq"], answer["fall_rate"])
        walk.trials.append(Trial(minutes, steps, *figures, walks(*figures)))
        keep(walk)
        if walk.trials[-1].walks or minutes >= args.minutes:
            break
    return walk


def _training_seconds(iterations: Sequence[float]) -> float:
    """Return how long iterations took, s; the first, which compiles, counts as the second one."""
    return sum(iterations[1:]) + sum(iterations[1:2])


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Raises:
        MuteError: If an argument is bad.
    """
    argv = command_line() if argv is None else list(argv)
    args = parse(PeerWalksArgs, argv, "Find when peers' own policies walk.")
    names = [name for name in peer_names(args.peers) if name != "gymnasium"]
    if "gymnasium" in args.peers:
        raise MuteError("--peers must name peers that learn, got 'gymnasium'")
    check_trials(args.trials, args.seconds)
    check_option("num-envs", args.num_envs, Range(1, 2**20, whole=True))
    check_option("minutes", args.minutes, Range(0.0, 1e5, above=True))
    check_option("every", args.every, Range(0.0, 1e5, above=True))
    pythons = peer_pythons(names, args.peers_from, {})
    told = Console(stderr=True)
    content: dict[str, Any] = {
        "machine": machine_kind(),
        "limit_minutes": args.minutes,
        "tried_every_minutes": args.every,
        "peers": [],
    }
    for name in names:
        told.print(f"{name} since {time.strftime('%H:%M')}")
        before = content["peers"]

        def keep(walk: PeerWalk, before: list[dict[str, Any]] = before) -> None:
            content["peers"] = [*before, walk.as_row()]
            if args.out is not None:
                write_json(args.out, content)

        peer = Peer(name, pythons[name], args.num_envs, FLAT_TASK)
        try:
            keep(train_until_walking(peer, args, keep))
        finally:
            peer.close()
    if args.json:
        print(json.dumps(without_nan(content)))
    elif names:
        title = f"peers, tried every {args.every:g} min: one may have walked that much earlier"
        print_table(title, content["peers"], _COLUMNS)
    return 0


if __name__ == "__main__":
    run_cli(main)
