"""How soon a training walks, in this version and in another: `mute.benchmark --until-walking`.

Whole trainings are run by each version's own `train.py`, seed by seed and one at a time, the
versions in an order that changes from seed to seed. What a walk is, `evaluate.py progress` decides:
error below 0.05 (m/s)^2, falls below 1 %, over the whole command range. A training's log cannot: in
it robots are randomised, shake with exploration and are not yet asked for all speeds. So a training
is halted at every few iterations, its newest checkpoint measured, and ended as soon as that walks.
The time counts from the start of `train.py` to the saving of that checkpoint, without the halts.
"""

from __future__ import annotations

import contextlib
import json
import math
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from mute.command_lines.benchmark_turns import Version
from mute.support.errors import MuteError
from mute.support.programs import end_program
from mute.support.provenance import current_commit

__all__ = ["time_to_walk"]

DEFINITION = (
    "minutes from the start of train.py to the first checkpoint, of every "
    "5th iteration from the 40th on, whose policy walks: error below 0.05 (m/s)^2 and falls below "
    "1 % (evaluate.py progress)"
)
"""What is measured."""

_INTERVAL = 5
"""Iterations between checkpoints."""

_FIRST = 40
"""First iteration whose policy is looked at: none has walked before the 65th."""

_POLL = 0.05
"""How often it is looked for a new checkpoint, s."""


def time_to_walk(
    versions: Sequence[Version],
    task: str,
    seeds: Sequence[int],
    content: dict[str, Any],
    keep: Callable[[], None] = lambda: None,
) -> None:
    """Run trainings until each walks, and add what comes of it to `content` as it comes.

    Args:
        versions: New alone, or new and old.
        task: Name of the task.
        seeds: Of the trainings.
        content: Gets `commits`, `definition`, `walking`, a row for each training, and what
            `_compared` says of them.
        keep: Called after each training, for `content` to be kept.

    Raises:
        MuteError: If a version has no checkout, or a training or a measurement fails.
    """
    for version in versions:
        if version.checkout is None or not (version.checkout / "train.py").is_file():
            raise MuteError(
                f"--until-walking needs a checkout of the {version.name} version, with its train.py"
            )
    rows: list[dict[str, Any]] = []
    content["commits"] = {
        version.name: current_commit(version.checkout) for version in versions if version.checkout
    }
    content |= {"definition": DEFINITION, "walking": rows, **_compared(rows)}
    for number, seed in enumerate(seeds):
        for version in list(versions)[:: 1 if number % 2 == 0 else -1]:
            print(f"seed {seed}, {version.name} version", file=sys.stderr)
            rows.append({"seed": seed, "version": version.name, **_walk(version, task, seed)})
            content |= _compared(rows)
            keep()


def _compared(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return how many times as soon the new version walks, over the seeds that both trained with.

    `median_old_over_new` is the median over seeds: 0 for a seed with which the new version never
    walks, "never" for one with which the old one never does, above all numbers. A seed with which
    neither walks compares nothing: it is left out and counted as `neither_walks`. Where the median
    would lie between a number and "never" it is that number, which favours the old version. None
    if no seed is left.
    """
    minutes = {(row["seed"], row["version"]): _or_never(row["minutes"]) for row in rows}
    pairs = [
        (old, minutes[seed, "new"])
        for (seed, name), old in minutes.items()
        if name == "old" and (seed, "new") in minutes
    ]
    ratios = [old / new for old, new in pairs if math.isfinite(old) or math.isfinite(new)]
    median = statistics.median(ratios) if ratios else None
    if median == math.inf:
        median = statistics.median_low(ratios)
    return {
        "median_old_over_new": "never" if median == math.inf else median,
        "neither_walks": len(pairs) - len(ratios),
    }


def _or_never(minutes: float | None) -> float:
    return math.inf if minutes is None else minutes


def _walk(version: Version, task: str, seed: int) -> dict[str, Any]:
    """Train until a checkpoint walks; minutes and iteration are None if none ever does."""
    with tempfile.TemporaryDirectory() as folder, _training(version, task, seed, folder) as process:
        start, halted = time.time(), 0.0
        for path in _checkpoints(Path(folder), process, version):
            minutes = (path.stat().st_mtime - start - halted) / 60.0
            if _iteration(path) < _FIRST:
                continue
            before = time.time()
            process.send_signal(signal.SIGSTOP)
            walks = _walks(version, path)
            process.send_signal(signal.SIGCONT)
            halted += time.time() - before
            if walks:
                return {"minutes": minutes, "iteration": _iteration(path)}
    return {"minutes": None, "iteration": None}


@contextlib.contextmanager
def _training(
    version: Version, task: str, seed: int, folder: str
) -> Iterator[subprocess.Popen[bytes]]:
    """Run `train.py`; it is ended in the end, halted or not."""
    command = [version.python, str(version.checkout / "train.py") if version.checkout else ""]
    command += ["--task", task, "--seed", str(seed), "--plain", "--log-dir", folder]
    command += ["--run-name", "walk", "--agent.save-interval", str(_INTERVAL)]
    with (Path(folder) / "said.txt").open("wb") as said:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=said,
            stderr=said,
            env=version.environ(),
            process_group=0,  # Ctrl-C asks this process alone
        )
    try:
        yield process
    finally:
        end_program(process)


def _checkpoints(
    folder: Path, process: subprocess.Popen[bytes], version: Version
) -> Iterator[Path]:
    """Yield the checkpoints as they are saved, until the training has ended."""
    seen: set[Path] = set()
    while True:
        ended = process.poll() is not None  # before it is looked, so that none is missed
        found = {path for path in folder.glob("*/walk/model_*.pt") if path.stem[6:].isdigit()}
        for path in sorted(found - seen, key=_iteration):
            seen.add(path)
            yield path
        if ended:
            break
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(_POLL)
    if process.returncode != 0:
        said = (folder / "said.txt").read_text(errors="replace").strip().splitlines()
        raise MuteError(
            f"train.py of the {version.name} version ended with status {process.returncode}: "
            f"{(said or ['no message'])[-1][-200:]}"
        )


def _iteration(path: Path) -> int:
    return int(path.stem.removeprefix("model_"))


def _walks(version: Version, checkpoint: Path) -> bool:
    """Return what that version's `evaluate.py progress` says of one checkpoint."""
    assert version.checkout is not None
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run"
        run.mkdir()
        shutil.copy(checkpoint, run)
        command = [version.python, str(version.checkout / "evaluate.py"), "progress"]
        command += ["--run", str(run), "--out", folder]
        environ = version.environ() | {"PYTHONUNBUFFERED": "1"}
        result = subprocess.run(
            command, capture_output=True, text=True, env=environ, stdin=subprocess.DEVNULL
        )
        if result.returncode != 0:
            said = (result.stderr.strip().splitlines() or ["no message"])[-1]
            raise MuteError(f"evaluate.py progress of the {version.name} version: {said[-200:]}")
        summary = json.loads((Path(folder) / "progress.json").read_text())
    return any(milestone["walks"] for milestone in summary["checkpoints"])
