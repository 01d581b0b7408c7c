"""Processes that live side by side and take turns: one works while the others wait.

What shares a machine with others cannot be timed once. So every part is timed again and again, a
turn after the other. The loop comes first, and what the others of a turn do again is its rollout.
Their order is drawn anew for every second turn and then gone backwards: no part always follows
another, and a machine that gets slower within a turn favours none. Parts that are compared between
versions stand beside each other. `benchmark_worker` does the work.

Turns of the same processes resemble each other more than those of others: memory lies where it
lies, and a training goes on. So after a few turns, a block, all processes end and others begin.
"""

from __future__ import annotations

import contextlib
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mute.support.errors import MuteError
from mute.support.provenance import REPOSITORY
from mute.support.threads import without_own_settings

__all__ = [
    "THIS",
    "Block",
    "Times",
    "Version",
    "Worker",
    "other_version",
    "shuffled_orders",
    "take_blocks",
    "times_of",
]

_PROGRAM = Path(__file__).with_name("benchmark_worker.py")

_FIRST_PART = "loop"
"""What a worker does first in each turn."""

_PARTS = ("engine", "nominal_engine", "environment")
"""What a worker does then on demand."""

_WAITING = ("OMP_WAIT_POLICY", "GOMP_SPINCOUNT")
"""How threads wait, which each version sets as it finds right."""

Times = dict[str, list[list[float]]]
"""How long each part took, s: block by block, turn by turn."""


@dataclass
class Block:
    """What came of processes that began together, one for each version."""

    ready: dict[str, dict[str, Any]]
    """What each says of itself, by version."""
    times: dict[str, dict[str, list[float]]] = field(default_factory=dict)
    """How long each part took, s: by version and part, turn by turn."""

    @property
    def turns(self) -> int:
        """Turns that were timed."""
        return min((len(times[_FIRST_PART]) for times in self.times.values()), default=0)


@dataclass(frozen=True)
class Version:
    """A version of MUTE that can be run."""

    name: str
    """What it is called here: new or old."""
    python: str
    """Interpreter of its environment."""
    checkout: Path | None
    """Top of its tree; None if the environment has it installed."""

    def environ(self) -> dict[str, str]:
        """Return the environment variables of its processes."""
        given = without_own_settings(os.environ)
        variables = {key: value for key, value in given.items() if key not in _WAITING}
        own = self.checkout == REPOSITORY
        others = variables.pop("PYTHONPATH", "") if own else ""
        variables.pop("PYTHONPATH", None)
        paths = [path for path in (str(self.checkout or ""), others) if path]
        return variables | ({"PYTHONPATH": os.pathsep.join(paths)} if paths else {})


THIS = Version("new", sys.executable, REPOSITORY)
"""The version that this is."""


def other_version(against: str) -> Version:
    """Return the version that --against names.

    Args:
        against: PYTHON or PYTHON:CHECKOUT.

    Raises:
        MuteError: If there is no such interpreter or checkout.
    """
    python, colon, checkout = against.partition(":")
    if shutil.which(python) is None:
        raise MuteError(
            f"--against must be PYTHON or PYTHON:CHECKOUT, and {python!r} is no interpreter that "
            "can be run"
        )
    top = Path(checkout).absolute()
    if colon and not (checkout and (top / "mute" / "tasks.py").is_file()):
        raise MuteError(f"--against must name a checkout of MUTE after ':', got {checkout!r}")
    # Not resolved: the link's place tells an interpreter which environment it is of.
    found = shutil.which(python) or python
    return Version("old", str(Path(found).absolute()), top if colon else None)


class Worker:
    """A training of some version and size, in a process of its own; a context manager."""

    def __init__(self, version: Version, task: str, num_envs: int, seed: int = 0) -> None:
        """Say what it will be; the process starts on entering.

        Args:
            version: Of which version.
            task: Name of the task; `module:task` imports a module first.
            num_envs: Number of robots.
            seed: Of the training.
        """
        self.version = version
        self.ready: dict[str, Any] = {}
        """What it says of itself once it is: versions, control steps of a part, memory."""
        # -P keeps the modules beside the program from passing for others of the same name.
        self._command = [version.python, "-P", str(_PROGRAM), task, str(num_envs), str(seed)]

    def __enter__(self) -> Worker:
        """Start it and wait until its first iterations are done.

        Raises:
            MuteError: If that fails.
        """
        self._errors = tempfile.TemporaryFile()
        try:
            self._process = subprocess.Popen(
                self._command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._errors,
                text=True,
                env=self.version.environ(),
                process_group=0,  # Ctrl-C in a terminal asks this process alone
            )
        except OSError as error:
            self._errors.close()
            raise MuteError(f"{self._command[0]} does not start: {error.strerror}") from error
        try:
            self.ready = self._answer("ready")
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *exc: object) -> None:
        """End the process."""
        self._process.kill()
        self._process.communicate()
        self._errors.close()

    def time(self, part: str) -> dict[str, float]:
        """Let it do a part and return how long that took, s: under one name or several.

        Raises:
            MuteError: If it fails or is gone.
        """
        assert self._process.stdin is not None
        try:
            print(json.dumps({"part": part}), file=self._process.stdin, flush=True)
        except BrokenPipeError:
            raise self._gone() from None
        return self._answer("seconds")

    def _answer(self, key: str) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise self._gone()
        try:
            content = json.loads(line)
            if "error" in content:
                raise MuteError(f"the {self.version.name} version: {content['error']}")
            return content[key]
        except (KeyError, TypeError, ValueError):
            raise MuteError(
                f"the process of the {self.version.name} version printed {line.strip()[:200]!r} "
                "where an answer was due"
            ) from None

    def _gone(self) -> MuteError:
        status = self._process.wait()
        how = f"was ended by signal {-status}" if status < 0 else f"ended with status {status}"
        self._errors.seek(0)
        said = self._errors.read().decode(errors="replace").strip().splitlines()
        reason = f": {said[-1][-200:]}" if said else ""
        return MuteError(f"the process of the {self.version.name} version {how}{reason}")


def shuffled_orders(names: Sequence[str], seed: int) -> Iterator[list[tuple[str, str]]]:
    """Yield for each turn the order of (part, version's name), without end; the loop is first.

    Args:
        names: Of the versions.
        seed: Of the draws.
    """
    draw = random.Random(seed)
    while True:
        first, parts = draw.sample(names, len(names)), draw.sample(_PARTS, len(_PARTS))
        rest = [(part, name) for part in parts for name in draw.sample(names, len(names))]
        yield [(_FIRST_PART, name) for name in first] + rest
        yield [(_FIRST_PART, name) for name in first[::-1]] + rest[::-1]


def take_blocks(
    begin: Callable[[int], Sequence[Worker]], turns: int, seed: int
) -> Generator[list[Block], None, None]:
    """Time every part of every worker, block by block and turn by turn, without end.

    Args:
        begin: Returns the workers of a block, one for each version, which have not started yet; is
            told the block's number, from 0 on.
        turns: Timed turns of a block, after one that only warms up.
        seed: Of the order.

    Yields:
        All blocks that have a whole turn, after each turn: the same list again and again.

    Raises:
        MuteError: If a worker fails or is gone.
    """
    blocks: list[Block] = []
    orders: Iterator[list[tuple[str, str]]] | None = None
    while True:
        with contextlib.ExitStack() as stack:
            workers = {each.version.name: each for each in begin(len(blocks))}
            for worker in workers.values():
                stack.enter_context(worker)
            orders = orders or shuffled_orders(list(workers), seed)
            _turn(workers, next(shuffled_orders(list(workers), seed)))
            block = Block({name: worker.ready for name, worker in workers.items()})
            for _ in range(turns):
                for name, of_turn in _turn(workers, next(orders)).items():
                    for part, seconds in of_turn.items():
                        block.times.setdefault(name, {}).setdefault(part, []).append(seconds)
                if block.turns == 1:
                    blocks.append(block)
                yield blocks


def times_of(blocks: Sequence[Block]) -> dict[str, Times]:
    """Return by version how long its parts took in some blocks, one or more."""
    return {
        name: {part: [block.times[name][part] for block in blocks] for part in parts}
        for name, parts in blocks[0].times.items()
    }


def _turn(
    workers: Mapping[str, Worker], order: Sequence[tuple[str, str]]
) -> dict[str, dict[str, float]]:
    measured: dict[str, dict[str, float]] = {name: {} for name in workers}
    for part, name in order:
        measured[name] |= workers[name].time(part)
    return measured
