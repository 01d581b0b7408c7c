"""Make the files of a policy that ships: python -m mute.release --checkpoint PATH.

Takes the small part of a training's checkpoint, exports it, measures it, and writes a card that
tells which command, seed, commit and machine made it and what it reaches.
"""

from __future__ import annotations

import shlex
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mute.checkpoint import CheckpointError, load_checkpoint, save_checkpoint
from mute.command_lines import evaluate
from mute.command_lines.arguments import command_line, parse
from mute.controllers import load_policy
from mute.controllers.onnx_export import export_policy
from mute.evaluation.tables import read_json, write_json
from mute.learning.run_directory import read_parameters
from mute.learning.runner import policy_part
from mute.learning.saved_state import check_totals
from mute.support.files import write_file
from mute.support.provenance import place_of
from mute.support.resources import RESOURCES
from mute.tasks import make_task

__all__ = ["ReleaseArgs", "main"]


@dataclass
class ReleaseArgs:
    """Arguments of the release."""

    checkpoint: Path
    """Checkpoint of a finished training, in its run's directory."""
    out: Path = RESOURCES / "go1"
    """Directory of the files <task>.pt, <task>.onnx and <task>.json."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Raises:
        MuteError: If the checkpoint cannot be used.
    """
    argv = command_line() if argv is None else list(argv)
    args = parse(ReleaseArgs, argv, "Make the files of a policy that ships.")
    checkpoint = load_checkpoint(args.checkpoint)
    if "logger" not in checkpoint:
        raise CheckpointError(f"{args.checkpoint} holds a policy only, not a training")
    _check_training(args.checkpoint, checkpoint)
    name = load_policy(args.checkpoint).task
    make_task(name)  # the name of the files
    training = _training(args.checkpoint, checkpoint)
    # Whoever interrupts the measurement finds the files of the last release, which belong together.
    with tempfile.TemporaryDirectory() as folder:
        policy_path, onnx_path = Path(folder) / f"{name}.pt", Path(folder) / f"{name}.onnx"
        save_checkpoint(policy_path, policy_part(checkpoint))
        export_policy(load_policy(policy_path), onnx_path)
        figures = _figures(policy_path)
        for path in (policy_path, onnx_path):
            write_file(args.out / path.name, path.read_bytes())
    figures["policy"] = place_of(args.out / f"{name}.pt")
    write_json(args.out / f"{name}.json", training | {"figures": figures})
    print(f"written: {args.out / f'{name}.pt'}, {name}.onnx, {name}.json", file=sys.stderr)
    return 0


def _training(path: Path, checkpoint: dict[str, Any]) -> dict[str, Any]:
    """Return what made the policy, from its checkpoint and its run's parameters."""
    run = read_parameters(path.parent)
    if run is None:
        raise CheckpointError(f"{path} lies outside its run: no config.yaml beside it")
    for entry in (run, *run.get("resumed", [])):
        if not isinstance(entry.get("command"), str):
            raise CheckpointError(f"{path}: its run's config.yaml does not tell every command")
    return {
        "task": checkpoint["task"],
        "command": _without_places(run["command"]),
        "resumed": [_without_places(entry["command"]) for entry in run.get("resumed", [])],
        "seed": checkpoint["config"]["env"]["seed"],
        "commit": run.get("commit"),
        "machine": run.get("machine"),
        "iterations": checkpoint["iter"] + 1,
        "steps": checkpoint["logger"]["total_steps"],
        "wall_time_minutes": round(checkpoint["logger"]["total_time"] / 60.0, 1),
    }


def _check_training(path: Path, checkpoint: dict[str, Any]) -> None:
    try:
        check_totals(checkpoint)
    except ValueError as error:
        raise CheckpointError(f"{path} holds no training: {error}") from error


def _without_places(command: str) -> str:
    """Return a command without the options that name files of the machine it ran on."""
    words, kept = iter(shlex.split(command)), []
    for word in words:
        if word in ("--log-dir", "--run-name"):
            next(words, None)
        elif word == "--resume":
            kept += [word, Path(next(words, "")).name]
        else:
            kept.append(word)
    return shlex.join(kept)


def _figures(policy: Path) -> dict[str, Any]:
    """Return what `evaluate.py gait` measures, with its defaults."""
    with tempfile.TemporaryDirectory() as folder:
        evaluate.main(["gait", "--policy", str(policy), "--out", folder])
        return read_json(Path(folder) / "gait.json")
