"""Processes that live side by side and take turns: one works while the others wait.

What shares a machine with others cannot be timed once. So every part is timed again and again, a
turn after the other, in an order that is drawn anew for every second turn and then gone backwards:
no part always follows another, and a machine that gets slower within a turn favours none. Parts
that are compared between versions stand beside each other. `benchmark_worker` does the work.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mute.support.errors import MuteError
from mute.support.provenance import REPOSITORY

__all__ = [
    "THIS",
    "Times",
    "Version",
    "Worker",
    "other_version",
    "shuffled_orders",
    "take_turns",
]

_PROGRAM = Path(__file__).with_name("benchmark_worker.py")

_PARTS = ("loop", "engine", "nominal_engine", "environment")
"""What a worker does on demand."""

_WAITING = ("OMP_WAIT_POLICY", "GOMP_SPINCOUNT")
"""What `support.threads` has set in this process; each version sets what it finds right."""

Times = dict[str, list[float]]
"""How long each part took, s, turn by turn."""


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
        variables = {key: value for key, value in os.environ.items() if key not in _WAITING}
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

    def __init__(self, version: Version, task: str, num_envs: int) -> None:
        """Say what it will be; the process starts on entering.

        Args:
            version: Of which version.
            task: Name of the task; `module:task` imports a module first.
            num_envs: Number of robots.
        """
        self.version = version
        self.ready: dict[str, Any] = {}
        """What it says of itself once it is: versions, control steps of a part, memory."""
        # -P keeps the modules beside the program from passing for others of the same name.
        self._command = [version.python, "-P", str(_PROGRAM), task, str(num_envs)]

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
    """Yield for each turn the order of (part, version's name), without end.

    Args:
        names: Of the versions.
        seed: Of the draws.
    """
    draw = random.Random(seed)
    while True:
        parts = draw.sample(_PARTS, len(_PARTS))
        order = [(part, name) for part in parts for name in draw.sample(names, len(names))]
        yield order
        yield order[::-1]


def take_turns(workers: Sequence[Worker], seed: int) -> Iterator[dict[str, Times]]:
    """Time every part of every worker turn by turn, without end, after one that only warms up.

    Args:
        workers: Each of another version.
        seed: Of the order.

    Yields:
        The times so far by version's name and part, after each whole turn.

    Raises:
        MuteError: If a worker fails or is gone.
    """
    by_name = {worker.version.name: worker for worker in workers}
    times: dict[str, Times] = {name: {} for name in by_name}
    orders = shuffled_orders(list(by_name), seed)
    _turn(by_name, next(orders))
    for order in orders:
        for name, of_turn in _turn(by_name, order).items():
            for part, seconds in of_turn.items():
                times[name].setdefault(part, []).append(seconds)
        yield times


def _turn(
    workers: Mapping[str, Worker], order: Sequence[tuple[str, str]]
) -> dict[str, dict[str, float]]:
    measured: dict[str, dict[str, float]] = {name: {} for name in workers}
    for part, name in order:
        measured[name] |= workers[name].time(part)
    return measured
