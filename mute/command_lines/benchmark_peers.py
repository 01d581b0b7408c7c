"""Time other ways to step and to train a robot on the CPU: `mute.benchmark --peers`.

Each peer, and MUTE itself, is a process of its own that does nothing until it is asked. They are
asked in turns, a round of one after a round of the other, so that a machine whose speed drifts
favours none of them. Two things are timed: the environment alone, with robots that stand and are
shaken by noise, and an iteration of the peer's own training, all of it, without what is done only
once, as compiling. They need not share the work: mjlab, MuJoCo Playground and UniLab step robots,
tasks and rewards of their own, which each row tells, and Gymnasium steps MUTE's scene without a
task. They pin other versions of MuJoCo, so each has a virtual environment of its own, which
`python -m benchmarks.make_peers --into DIR` makes.
"""

from __future__ import annotations

import contextlib
import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mute.command_lines.arguments import check_distinct
from mute.evaluation.intervals import median_interval
from mute.support.errors import MuteError
from mute.support.provenance import REPOSITORY

__all__ = [
    "ALL_PEERS",
    "ITSELF",
    "PEERS",
    "PEER_COLUMNS",
    "Peer",
    "PeerRate",
    "peer_names",
    "peer_pythons",
    "time_peers",
]

PEERS = ("gymnasium", "mjlab", "mujoco_playground", "unilab")
"""Names of the peers: those that `benchmarks/peer_program.py` knows, and MUTE."""

PEER_COLUMNS = ("name", "version", "robot", "num_envs", "environment", "loop", "note")
"""What a console shows of each."""

ITSELF = "mute"
"""MUTE among the peers."""

ALL_PEERS = "all"
"""The word that stands for every peer."""

_OWN_ENVIRONMENT = (ITSELF, "gymnasium")
"""What runs in MUTE's own environment, whatever folder is named."""

_PARTS = ("environment", "loop")
"""What is timed of each."""

_PROGRAM = REPOSITORY / "benchmarks" / "peer_program.py"
"""The program that steps a peer: a checkout has it, an installed package does not."""

_WAITING = ("OMP_WAIT_POLICY", "GOMP_SPINCOUNT")
"""What `support.threads` sets to suit our own loop; a peer runs with what it would find itself. The
number of threads stays: that of the processors suits everybody."""

_GRACE = 10.0
"""How long a peer may take to end when nothing more is asked, s."""


@dataclass
class PeerRate:
    """How fast a peer is, in control steps a second; what is not known is None."""

    name: str
    """Its name: MUTE's, or one of `PEERS`."""
    version: str | None = None
    """Version of its package."""
    engine: str | None = None
    """Engine and its version."""
    robot: str | None = None
    """Name of the robot."""
    task: str | None = None
    """Name of the task."""
    num_envs: int | None = None
    """Robots that it steps at once."""
    physics_step: float | None = None
    """Duration of a physics step, s."""
    decimation: int | None = None
    """Physics steps of a control step."""
    environment: float | None = None
    """The environment alone, median over rounds."""
    loop: float | None = None
    """An iteration of its own training, all of it, likewise."""
    intervals: dict[str, list[float | None]] = field(default_factory=dict)
    """By part, bounds of the median's 95 % interval; None of fewer than six rounds."""
    over_mute: dict[str, float] = field(default_factory=dict)
    """By part, its rate as a share of MUTE's, median over rounds of the quotients."""
    rounds: dict[str, int] = field(default_factory=dict)
    """By part, rounds that were timed."""
    note: str = ""
    """What else it does, or why it did not run."""


def peer_names(given: Sequence[str]) -> tuple[str, ...]:
    """Return the peers that --peers names; none if it is not given.

    Raises:
        MuteError: If there is no such peer, or one is named twice.
    """
    if not given:
        return ()
    check_distinct("peers", given)
    if not _PROGRAM.exists():
        raise MuteError("--peers needs a checkout of MUTE: its programs are not installed")
    if tuple(given) == (ALL_PEERS,):
        return PEERS
    for name in given:
        if name not in PEERS:
            raise MuteError(
                f"--peers must be {ALL_PEERS} or some of {', '.join(PEERS)}, got {name!r}"
            )
    return tuple(given)


def peer_pythons(
    names: Sequence[str], folder: Path | None, given: Mapping[str, Path | None]
) -> dict[str, Path]:
    """Return the interpreter of each peer.

    Args:
        names: Names of the peers.
        folder: What `make_peers` made, a virtual environment for each; None for no such folder.
        given: Interpreters that are named one by one, which count before those.
    """
    pythons = {name: Path(sys.executable) for name in (ITSELF, *names)}
    if folder is not None:
        others = [name for name in names if name not in _OWN_ENVIRONMENT]
        pythons |= {name: folder / name / "bin" / "python" for name in others}
    return pythons | {name: path for name, path in given.items() if path is not None}


class Peer:
    """A process that steps and trains one peer when asked, and nothing otherwise."""

    def __init__(
        self, name: str, python: Path, num_envs: int, task: str, device: str = "cpu"
    ) -> None:
        """Start it and wait until it is ready, which may take minutes.

        Args:
            name: Its name.
            python: Interpreter that has it.
            num_envs: Robots; Gymnasium takes a number of its own.
            task: Name of the task of MUTE and Gymnasium.
            device: Where it runs; only MUTE and mjlab know others than the CPU.
        """
        self.rate = PeerRate(name)
        """What is known of it."""
        self.fault: str | None = None
        """Why it does not run, or no longer."""
        self._process: subprocess.Popen[str] | None = None
        self._errors = tempfile.TemporaryFile(mode="w+", errors="replace")  # noqa: SIM115
        # -P keeps the modules beside the program from passing for others of the same name.
        command = [str(python), "-P", str(_PROGRAM), name, str(num_envs), task]
        command += [device] if device != "cpu" else []
        environment = {key: value for key, value in os.environ.items() if key not in _WAITING}
        pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        try:
            self._process = subprocess.Popen(
                command, text=True, env=environment, stderr=self._errors, **pipes
            )
        except OSError as error:
            self.fault = f"{python} does not start: {error.strerror}"
            return
        try:
            self._take_facts(self._answer())
        except BaseException:  # as Ctrl-C while it starts, which may take minutes
            self.close(grace=0.0)
            raise

    def ask(self, request: str) -> dict[str, Any]:
        """Return the answer to a request, `{"error": WHY}` if it cannot be met."""
        if self.fault is None and self._process is not None and self._process.stdin is not None:
            with contextlib.suppress(OSError):  # it has ended: the answer will tell
                self._process.stdin.write(f"{request}\n")
                self._process.stdin.flush()
            return self._answer()
        return {"error": self.fault}

    def close(self, grace: float = _GRACE) -> None:
        """End it.

        Args:
            grace: How long it may take to end by itself, s.
        """
        if self._process is not None:
            for pipe in (self._process.stdin, self._process.stdout):
                if pipe is not None:
                    with contextlib.suppress(OSError):
                        pipe.close()
            try:
                self._process.wait(grace)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._errors.close()

    def _take_facts(self, facts: dict[str, Any]) -> None:
        missing = facts.get("missing", facts.get("error"))
        if missing is not None:
            self.fault = missing
            return
        try:
            self.rate = PeerRate(name=self.rate.name, **facts)
        except TypeError:
            self.fault = "it said something that is not known"

    def _answer(self) -> dict[str, Any]:
        assert self._process is not None
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        try:
            answer = json.loads(line)
        except ValueError:
            answer = None
        if isinstance(answer, dict):
            return answer
        if line:
            self.fault = f"it printed {line.strip()[:80]!r} instead of an answer"
        else:
            status = self._process.wait()
            self._errors.seek(0)
            reason = (self._errors.read().strip().splitlines() or ["no message"])[-1]
            self.fault = f"failed with status {status}: {reason[-200:]}"
        return {"error": self.fault}


def time_peers(
    names: Sequence[str],
    pythons: Mapping[str, Path],
    num_envs: int,
    rounds: int,
    task: str,
    begin: Callable[[str], None] = lambda _told: None,
    device: str = "cpu",
    after_round: Callable[[Sequence[PeerRate]], None] = lambda _rates: None,
) -> list[PeerRate]:
    """Time MUTE and peers in turns; one that cannot run says so in its note.

    Args:
        names: Names of the peers.
        pythons: Interpreters of these and of MUTE.
        num_envs: Robots of each.
        rounds: Rounds that count of each part, after one that does not.
        task: Name of the task of MUTE and Gymnasium.
        begin: Told what begins.
        device: Where they run, as for a `Peer`.
        after_round: Given what is known after each round, when all of them wait.
    """
    peers: list[Peer] = []
    try:
        for name in (ITSELF, *names):
            begin(f"{name} starts")
            peers.append(Peer(name, pythons[name], num_envs, task, device))
        for part in _PARTS:
            for rates in _rounds(peers, part, rounds, begin):
                for peer in peers:
                    _sum_up(peer, part, rates[peer.rate.name], rates[ITSELF])
                after_round([peer.rate for peer in peers])
    finally:
        for peer in peers:
            peer.close()
    return [peer.rate for peer in peers]


def _rounds(
    peers: Sequence[Peer], part: str, rounds: int, begin: Callable[[str], None]
) -> Iterator[Mapping[str, Sequence[float]]]:
    """Yield by peer how many control steps a second the rounds of a part made, after each."""
    rates: dict[str, list[float]] = {peer.rate.name: [] for peer in peers}
    left = list(peers)
    for round_number in range(rounds + 1):
        begin(f"{part}, round {round_number} of {rounds}")
        # Back and forth, so that a machine that gets slower within a round favours none.
        for peer in left[:: -1 if round_number % 2 else 1]:
            answer = peer.ask(part)
            if "absent" in answer:
                left.remove(peer)
            elif "error" in answer:
                _note(peer, part, answer["error"])
                left.remove(peer)
            elif round_number > 0:  # the first one compiles, and finds its memory
                rates[peer.rate.name].append(answer["steps"] / answer["seconds"])
        yield rates


def _note(peer: Peer, part: str, error: str) -> None:
    """Say once why a peer has no figure."""
    told = error if peer.fault else f"{part}: {error}"
    if told not in peer.rate.note:
        peer.rate.note = "; ".join(filter(None, (peer.rate.note, told)))


def _sum_up(peer: Peer, part: str, rates: Sequence[float], own: Sequence[float]) -> None:
    if not rates:
        return
    interval = median_interval(rates)
    setattr(peer.rate, part, interval.median)
    peer.rate.intervals[part] = [interval.low, interval.high]
    peer.rate.rounds[part] = len(rates)
    # The rounds of one that ends early are the first ones.
    shares = [one / other for one, other in zip(rates, own, strict=False)]
    if shares:
        peer.rate.over_mute[part] = statistics.median(shares)
