"""Everything that is to be known of MUTE on a GPU, in ten minutes; `benchmarks/gpu.sh` starts it.

Each part is a program of its own with a time limit of its own: one that fails or takes too long
leaves its message in the file, and the next one begins. The file is written anew after every part,
so that what was measured is kept whatever happens. A signal that asks it to end ends the part under
way, with all that it started, and is told in the file. `--dry-run-on-cpu` runs the same parts as
small as can be on the CPU, to see that they work; its figures mean nothing.

It imports nothing but the standard library, so that it has a word to say where nothing works.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .gpu_memory import nvidia_smi

__all__ = ["Part", "Stop", "main", "run_part"]

_REPOSITORY = Path(__file__).resolve().parents[1]

_POLL = 0.5
"""How often a part is looked after at least, s."""

_ASKS_TO_END = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

_VERSIONS = ("torch", "mujoco", "mujoco-warp", "warp-lang", "rsl-rl-lib")

Result = Callable[[str], dict[str, Any]]
"""Reads a part's result from what it printed."""


@dataclass(frozen=True)
class Part:
    """A program, and how long it may take."""

    name: str
    """Its name in the file."""
    command: tuple[str, ...]
    """The program."""
    limit: float
    """Time after which it is ended, s."""
    result: Result
    """Reads its result from what it printed."""


@dataclass
class Stop:
    """Whether a signal has asked this process to end, and which."""

    asked: signal.Signals | None = None
    """The first such signal."""

    @contextlib.contextmanager
    def listening(self) -> Iterator[None]:
        """Take note of signals that would end this process; those that are ignored stay so.

        Nothing is raised, for what is raised between a part's start and the line that notes it
        would leave the part behind.
        """
        before = {number: signal.getsignal(number) for number in _ASKS_TO_END}
        heard = [number for number, action in before.items() if action != signal.SIG_IGN]
        for number in heard:
            signal.signal(number, self._note)
        try:
            yield
        finally:
            for number in heard:
                signal.signal(number, before[number])

    def _note(self, number: int, _frame: object) -> None:
        self.asked = self.asked or signal.Signals(number)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status: 1 if a part has no result."""
    args = _arguments(argv)
    stop = Stop()
    try:
        with stop.listening():
            outcomes = _measure(args, stop)
    except OSError as error:
        print(f"error: {error.filename or args.out}: {error.strerror}", file=sys.stderr)
        return 2
    if stop.asked is not None:
        print(f"error: stopped by {stop.asked.name}; written: {args.out}", file=sys.stderr)
        return 128 + stop.asked
    print(f"written: {args.out}")
    return int(any(outcome["status"] != "done" for outcome in outcomes.values()))


def _measure(args: argparse.Namespace, stop: Stop) -> Mapping[str, Mapping[str, Any]]:
    """Run the parts, write the file after each, and return what came of them by name.

    Raises:
        OSError: If the file cannot be written.
    """
    end = time.monotonic() + args.seconds
    with tempfile.TemporaryDirectory() as folder:
        content: dict[str, Any] = {
            "rehearsal_on_cpu": args.dry_run_on_cpu,
            "stopped": None,
            "machine": _machine(),
            "parts": {},
        }
        _write(args.out, content)
        for part in _parts(args, Path(folder)):
            if stop.asked is not None:
                break
            left = end - time.monotonic()
            print(f"{part.name}: at most {max(0.0, min(part.limit, left)):.0f} s", flush=True)
            outcome = run_part(part, left, stop)
            content["parts"][part.name] = outcome
            _write(args.out, content)
            print(f"{part.name}: {outcome['status']} {outcome['message']}".strip(), flush=True)
        if stop.asked is not None:
            _write(args.out, content | {"stopped": stop.asked.name})
    return content["parts"]


def _arguments(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser("benchmarks.gpu", description="Measure MUTE on a GPU.")
    parser.add_argument("--out", type=Path, default=Path("gpu.json"), help="file for the figures")
    parser.add_argument("--peers-from", type=Path, help="folder with mjlab's environment")
    parser.add_argument("--seconds", type=float, default=600.0, help="time for everything")
    parser.add_argument(
        "--dry-run-on-cpu", action="store_true", help="run every part on the CPU, tiny"
    )
    args = parser.parse_args(argv)
    args.out = args.out.absolute()
    return args


def _parts(args: argparse.Namespace, folder: Path) -> list[Part]:
    """Return the parts in their order: what matters most comes first."""
    tiny = args.dry_run_on_cpu
    device = "cpu" if tiny else "cuda"
    python = sys.executable
    peers = ["--peers-from", str(args.peers_from.absolute())] if args.peers_from else []
    engines = ["--num-envs", "8", "--steps", "10"] if tiny else []

    def training(name: str, task: str, robots: int, iterations: int, limit: float) -> Part:
        runs = folder / name
        command = [
            *(python, "-m", "benchmarks.gpu_training", "--task", task, "--device", device),
            *("--num-envs", str(robots), "--iterations", str(iterations), "--plain"),
            *("--log-dir", str(runs), "--run-name", "gpu"),
        ]
        return Part(
            name,
            tuple(command),
            limit,
            lambda said: _curves(runs, robots, iterations) | _memory(said),
        )

    def rates(num_envs: int) -> Part:
        rounds = "1" if tiny else "6"
        command = [
            *(python, "-m", "benchmarks.gpu_rates", "--device", device, *peers),
            *("--num-envs", str(num_envs), "--rounds", rounds),
        ]
        return Part(f"rates_{num_envs}", tuple(command), 120.0, _last_line)

    return [
        Part(
            "engines",
            (python, "-m", "benchmarks.gpu_engines", "--device", device, *engines),
            150.0,
            _last_line,
        ),
        training("training", "go1_mute_flat", *((16, 2) if tiny else (4096, 60)), limit=160.0),
        # Networks on the GPU, robots on the CPU.
        training("over_ground", "go1_mute", *((16, 2) if tiny else (1024, 10)), limit=50.0),
        *(rates(number) for number in ((8, 16) if tiny else (4096, 16384))),
    ]


def run_part(part: Part, left: float, stop: Stop | None = None) -> dict[str, Any]:
    """Run a part and return what came of it.

    Args:
        part: The part.
        left: Time until everything must be over, s.
        stop: What may ask to end the part; None for nothing.
    """
    stop = stop or Stop()
    start = time.monotonic()
    limit = min(part.limit, left)
    if limit <= 0.0:
        return _outcome("not begun", "no time was left", 0.0, part.limit)
    with tempfile.TemporaryFile("w+") as said, tempfile.TemporaryFile("w+") as errors:
        variables = os.environ | {"PYTHONPATH": os.pathsep.join(_paths())}
        try:
            process = subprocess.Popen(
                part.command, stdout=said, stderr=errors, env=variables, cwd=_REPOSITORY,
                start_new_session=True,
            )  # fmt: skip
        except OSError as error:
            return _outcome("failed", f"{part.command[0]}: {error.strerror}", 0.0, part.limit)
        timed_out = _wait(process, start + limit, stop)
        seconds = time.monotonic() - start
        said.seek(0)
        errors.seek(0)
        text, complaint = said.read(), errors.read()
    outcome = _outcome("done", "", seconds, part.limit)
    with contextlib.suppress(Exception):  # a part that fails may have a result nevertheless
        outcome["result"] = part.result(text)
    if stop.asked is not None:
        outcome |= {"status": "stopped", "message": f"by {stop.asked.name}"}
    elif timed_out:
        outcome |= {"status": "timed out", "message": f"ended after {seconds:.0f} s"}
    elif process.returncode != 0 or "result" not in outcome:
        lines = [line for line in complaint.splitlines() if line.strip()] or ["no message"]
        told = f"status {process.returncode}: {lines[-1].strip()[-300:]}"
        outcome |= {"status": "failed", "message": told}
    return outcome


def _outcome(status: str, message: str, seconds: float, limit: float) -> dict[str, Any]:
    return {"status": status, "message": message, "seconds": seconds, "limit_seconds": limit}


def _paths() -> list[str]:
    others = os.environ.get("PYTHONPATH", "")
    return [str(_REPOSITORY), *filter(None, others.split(os.pathsep))]


def _wait(process: subprocess.Popen[Any], end: float, stop: Stop) -> bool:
    """Wait for a program, and end all that it started when its time is over.

    Returns:
        Whether its time was over.
    """
    timed_out = False
    try:
        while process.poll() is None and stop.asked is None and not timed_out:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(max(0.0, min(_POLL, end - time.monotonic())))
            timed_out = process.poll() is None and time.monotonic() >= end
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)  # what it left behind, too
        process.wait()
    return timed_out


def _machine() -> dict[str, Any]:
    """Return GPU, driver, versions and commit, as far as they can be found out."""
    from importlib import metadata

    versions: dict[str, str | None] = {}
    for name in _VERSIONS:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = None
    gpu = nvidia_smi("name,driver_version,memory.total")
    named = dict(zip(("name", "driver", "memory_mb"), gpu, strict=False)) if gpu else None
    git = ["git", "-C", str(_REPOSITORY), "describe", "--always", "--dirty", "--abbrev=40"]
    try:
        found = subprocess.run(git, capture_output=True, text=True)
        commit = found.stdout.strip() or None
    except OSError:
        commit = None
    return {
        "gpu": named,
        "cores": os.cpu_count(),
        "python": sys.version.split()[0],
        "versions": versions,
        "commit": commit,
    }


def _last_line(said: str) -> dict[str, Any]:
    """Return the JSON object of the last line; a part that was ended may have left half a line.

    Raises:
        ValueError: If there is no such line.
    """
    whole = said[: said.rfind("\n") + 1].splitlines()
    content = json.loads(whole[-1] if whole else "")
    if not isinstance(content, dict):
        raise ValueError("no object")
    return content


def _curves(runs: Path, num_envs: int, iterations: int) -> dict[str, Any]:
    """Return what a training's curves say of its speed and its last reward."""
    (path,) = runs.rglob("curves.jsonl")
    rows: list[Mapping[str, Any]] = [json.loads(line) for line in path.read_text().splitlines()]
    rates = sorted(row["Perf/total_fps"] for row in rows[len(rows) // 2 :])
    return {
        "num_envs": num_envs,
        "iterations_asked": iterations,
        "iterations": len(rows),
        # The first half compiles, and finds its memory.
        "steps_per_second": rates[len(rates) // 2],
        "mean_reward": rows[-1].get("Train/mean_reward"),
    }


def _memory(said: str) -> dict[str, Any]:
    """Return what a training says at its end; nothing of one that was cut short."""
    try:
        return _last_line(said)
    except ValueError:
        return {}


def _plain(value: Any) -> Any:  # noqa: ANN401
    """Return plain data with None for numbers that are not finite: JSON has none."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, list) else value


def _write(path: Path, content: dict[str, Any]) -> None:
    """Write the file, whole or not at all."""
    part = path.with_name(f"{path.name}.part")
    part.write_text(json.dumps(_plain(content), indent=2, allow_nan=False) + "\n")
    part.replace(path)


if __name__ == "__main__":
    sys.exit(main())
