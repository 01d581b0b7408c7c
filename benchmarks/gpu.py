"""Everything that is to be known of MUTE on a GPU, in ten minutes; `benchmarks/gpu.sh` starts it.

Each part is a program of its own with a time limit of its own: one that fails or takes too long
leaves its message in the file, and the next one begins. The file is written anew after every part,
so that what was measured is kept whatever happens. `--dry-run-on-cpu` runs the same parts as small
as can be on the CPU, to see that they work; its figures mean nothing.

It imports nothing but the standard library, so that it has a word to say where nothing works.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

__all__ = ["Part", "main", "run_part"]

_REPOSITORY = Path(__file__).resolve().parents[1]

_POLL = 0.5
"""How often the GPU's memory is read, s."""

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


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status: 1 if a part has no result."""
    args = _arguments(argv)
    end = time.monotonic() + args.seconds
    with tempfile.TemporaryDirectory() as folder:
        content: dict[str, Any] = {
            "rehearsal_on_cpu": args.dry_run_on_cpu,
            "machine": _machine(),
            "parts": {},
        }
        _write(args.out, content)
        for part in _parts(args, Path(folder)):
            left = end - time.monotonic()
            print(f"{part.name}: at most {min(part.limit, left):.0f} s", flush=True)
            outcome = run_part(part, left)
            content["parts"][part.name] = outcome
            _write(args.out, content)
            print(f"{part.name}: {outcome['status']} {outcome['message']}".strip(), flush=True)
    print(f"written: {args.out}")
    return int(any(outcome["status"] != "done" for outcome in content["parts"].values()))


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
    robots, iterations = (16, 2) if tiny else (4096, 60)
    runs = folder / "runs"
    engines = ["--num-envs", "8", "--steps", "10"] if tiny else []
    training = [
        *(python, str(_REPOSITORY / "train.py"), "--task", "go1_mute", "--device", device),
        *("--num-envs", str(robots), "--iterations", str(iterations), "--plain"),
        *("--log-dir", str(runs), "--run-name", "gpu"),
    ]

    def rates(num_envs: int) -> Part:
        rounds = "1" if tiny else "6"
        command = [
            *(python, "-m", "benchmarks.gpu_rates", "--device", device, *peers),
            *("--num-envs", str(num_envs), "--rounds", rounds),
        ]
        return Part(f"rates_{num_envs}", tuple(command), 140.0, _last_line)

    return [
        Part(
            "engines",
            (python, "-m", "benchmarks.gpu_engines", "--device", device, *engines),
            150.0,
            _last_line,
        ),
        Part("training", tuple(training), 170.0, lambda _said: _curves(runs, robots, iterations)),
        *(rates(number) for number in ((8, 16) if tiny else (4096, 16384))),
    ]


def run_part(part: Part, left: float) -> dict[str, Any]:
    """Run a part and return what came of it.

    Args:
        part: The part.
        left: Time until everything must be over, s.
    """
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
        timed_out, gpu_memory = _wait(process, start + limit)
        seconds = time.monotonic() - start
        said.seek(0)
        errors.seek(0)
        text, complaint = said.read(), errors.read()
    outcome = _outcome("done", "", seconds, part.limit) | {"peak_gpu_memory_mb": gpu_memory}
    with contextlib.suppress(Exception):  # a part that fails may have a result nevertheless
        outcome["result"] = part.result(text)
    if timed_out:
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


def _wait(process: subprocess.Popen[Any], end: float) -> tuple[bool, float | None]:
    """Wait for a program, and end all that it started when its time is over.

    Returns:
        Whether it was ended, and the most memory of the GPU that was in use, MB; None without one.
    """
    most: float | None = None
    timed_out = False
    try:
        while process.poll() is None:
            if time.monotonic() >= end:
                timed_out = True
                break
            used = _gpu_memory()
            most = used if most is None else max(most, used or 0.0)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(max(0.0, min(_POLL, end - time.monotonic())))
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)  # what it left behind, too
        process.wait()
    return timed_out, most


def _gpu_memory() -> float | None:
    """Return how much memory of the first GPU is in use, MB."""
    told = _nvidia_smi("memory.used")
    try:
        return float(told[0]) if told else None
    except ValueError:
        return None


def _nvidia_smi(fields: str) -> list[str]:
    """Return what the driver tells of the first GPU; nothing without one."""
    program = shutil.which("nvidia-smi")
    if program is None:
        return []
    command = [program, f"--query-gpu={fields}", "--format=csv,noheader,nounits"]
    try:
        result = subprocess.run(command, capture_output=True, text=True, timeout=20.0)
    except (OSError, subprocess.TimeoutExpired):
        return []
    lines = result.stdout.splitlines()
    return (
        [word.strip() for word in lines[0].split(",")] if result.returncode == 0 and lines else []
    )


def _machine() -> dict[str, Any]:
    """Return GPU, driver, versions and commit, as far as they can be found out."""
    from importlib import metadata

    versions: dict[str, str | None] = {}
    for name in _VERSIONS:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = None
    gpu = _nvidia_smi("name,driver_version,memory.total")
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
    """Return the JSON object of the last line."""
    content = json.loads(said.splitlines()[-1])
    if not isinstance(content, dict):
        raise TypeError("no object")
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


def _write(path: Path, content: Mapping[str, Any]) -> None:
    """Write the file, whole or not at all."""
    part = path.with_name(f"{path.name}.part")
    part.write_text(json.dumps(content, indent=2) + "\n")
    part.replace(path)


if __name__ == "__main__":
    sys.exit(main())
