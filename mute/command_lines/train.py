"""`train.py`: learn a task, show how it goes, save, resume."""

from __future__ import annotations

import dataclasses
import re
import shlex
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
import yaml

from envs.quadruped_env import QuadrupedEnvCfg
from envs.scene import SceneError
from mute.checkpoint import CheckpointError, latest_checkpoint, load_checkpoint
from mute.command_lines.arguments import command_line, parse, resolve_device, selected_task
from mute.config import AgentCfg, TaskCfg, from_plain, to_plain
from mute.errors import MuteError
from mute.files import replace_file
from mute.logger import LiveDisplay, PlainDisplay
from mute.provenance import current_commit, machine_kind
from mute.runner import MuteRunner
from mute.tasks import DEFAULT_TASK, make_task

__all__ = ["main"]

_GPU_ENVS = 4096
"""Environments of `go1_mute` on a GPU; its own 1024 suit a CPU."""
_PARAMETERS = "config.yaml"


@dataclass
class TrainArgs:
    """Arguments of `train.py`."""

    task: str = DEFAULT_TASK
    """Task to learn."""
    num_envs: int | None = None
    """Number of robots; by default what suits the machine."""
    iterations: int | None = None
    """Rollouts and updates in all, those before a --resume included."""
    seed: int | None = None
    """Seed of everything random."""
    device: str = "auto"
    """auto, cpu or cuda: where networks and physics live."""
    run_name: str = ""
    """Name of the run; by default the date and time."""
    log_dir: Path = Path("runs")
    """Directory of all runs."""
    resume: str | None = None
    """Checkpoint to go on from: a path, or 'latest' for the newest of this task."""
    plain: bool = False
    """Print one line an iteration instead of the live display."""
    env: QuadrupedEnvCfg = field(default_factory=QuadrupedEnvCfg)
    """The environment."""
    agent: AgentCfg = field(default_factory=AgentCfg)
    """Learning."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Raises:
        MuteError: If an argument is bad or a checkpoint cannot be used.
    """
    argv = command_line() if argv is None else list(argv)
    args, checkpoint = _arguments(argv)
    cfg = _configuration(args)
    device = resolve_device(args.device)
    torch.set_float32_matmul_precision(cfg.agent.matmul_precision)
    run_dir = checkpoint.parent if checkpoint else _new_run(args)
    display = PlainDisplay() if args.plain else LiveDisplay(args.task)
    if cfg.env.engine == "warp" or (cfg.env.engine == "auto" and device == "cuda"):
        print("Warp compiles its kernels at their first use, for a minute or more", file=sys.stderr)
    try:
        runner = MuteRunner(args.task, cfg, run_dir, device, display.update)
    except (ValueError, SceneError) as error:
        raise MuteError(str(error)) from error
    if checkpoint:
        runner.load(str(checkpoint))
        if runner.current_learning_iteration >= cfg.agent.iterations:
            raise MuteError(
                f"{checkpoint} has finished its {cfg.agent.iterations} iterations; "
                "ask for more with --iterations"
            )
    _make_directory(run_dir)
    _write_parameters(run_dir, args, cfg, argv)
    print(f"run: {run_dir}", file=sys.stderr)
    with display:
        finished = runner.train()
    path = runner.checkpoint_path()
    verb = "saved" if finished else "interrupted, saved"
    print(f"{verb}: {path}", file=sys.stderr)
    if not finished:
        print(f"go on with: python train.py --task {args.task} --resume {path}", file=sys.stderr)
        return 130
    return 0


def _arguments(argv: Sequence[str]) -> tuple[TrainArgs, Path | None]:
    """Parse the command line over the defaults of its task or of the checkpoint it resumes."""
    task = selected_task(argv, DEFAULT_TASK)
    cfg = make_task(task)
    args = _parse(argv, task, cfg)
    if args.resume is None:
        if task == DEFAULT_TASK and resolve_device(args.device) == "cuda":
            cfg = dataclasses.replace(cfg, env=dataclasses.replace(cfg.env, num_envs=_GPU_ENVS))
            args = _parse(argv, task, cfg)
        return args, None
    path = latest_checkpoint(args.log_dir, task) if args.resume == "latest" else Path(args.resume)
    saved = load_checkpoint(path)
    if saved.get("task") != task:
        raise CheckpointError(f"{path} is of task {saved.get('task')!r}, not {task!r}")
    if "env" not in saved:
        raise CheckpointError(f"{path} holds a policy only; it can be played, not resumed")
    try:
        cfg = from_plain(saved.get("config"))
    except ValueError as error:
        raise CheckpointError(f"{path}: {error}") from error
    args = _parse(argv, task, cfg)
    _check_resume(args, path, cfg.env.seed, saved["iter"])
    return args, path


def _check_resume(args: TrainArgs, path: Path, seed: int, iteration: int) -> None:
    """Refuse options that cannot have an effect, and a checkpoint that later ones follow."""
    asked = args.env.seed if args.seed is None else args.seed
    if asked != seed:
        raise MuteError(
            f"--seed {asked}: a resumed run goes on with its own seed {seed}; leave --seed away"
        )
    if args.run_name:
        raise MuteError(
            f"--run-name {args.run_name}: a resumed run keeps its name; leave --run-name away"
        )
    matches = (re.fullmatch(r"model_(\d+)\.pt", file.name) for file in path.parent.iterdir())
    newest = max((int(match[1]) for match in matches if match), default=iteration)
    if newest > iteration:
        raise MuteError(
            f"{path} is not the newest checkpoint of its run: resume "
            f"{path.with_name(f'model_{newest}.pt')}, or delete or move away the later ones"
        )


def _parse(argv: Sequence[str], task: str, cfg: TaskCfg) -> TrainArgs:
    default = TrainArgs(task=task, env=cfg.env, agent=cfg.agent)
    return parse(TrainArgs, argv, "Learn a task.", default)


def _configuration(args: TrainArgs) -> TaskCfg:
    """Return the task's configuration with the short options applied."""
    env_changes: dict[str, Any] = {}
    if args.num_envs is not None:
        env_changes["num_envs"] = args.num_envs
    if args.seed is not None:
        env_changes["seed"] = args.seed
    agent_changes = {} if args.iterations is None else {"iterations": args.iterations}
    try:
        return TaskCfg(
            env=dataclasses.replace(args.env, **env_changes),
            agent=dataclasses.replace(args.agent, **agent_changes),
        )
    except ValueError as error:
        raise MuteError(str(error)) from error


def _new_run(args: TrainArgs) -> Path:
    """Return the directory of a new run, which is made once everything else has gone well."""
    name = args.run_name or time.strftime("%Y-%m-%d_%H-%M-%S")
    if Path(name).name != name or name == "..":
        raise MuteError(f"--run-name must be a plain name without '/', got {name!r}")
    run_dir = args.log_dir / args.task / name
    if (run_dir / _PARAMETERS).exists() or list(run_dir.glob("model_*.pt")):
        raise MuteError(
            f"{run_dir} holds a run already: choose another --run-name, or go on with "
            f"--resume {run_dir}/model_N.pt"
        )
    return run_dir


def _make_directory(run_dir: Path) -> None:
    try:
        run_dir.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise MuteError(f"--log-dir: cannot make {run_dir}: {error.strerror}") from error


def _write_parameters(run_dir: Path, args: TrainArgs, cfg: TaskCfg, argv: Sequence[str]) -> None:
    """Write what the run is re-made from, before it starts or goes on.

    The command that started it stays; those that went on are listed under `resumed`.
    """
    path = run_dir / _PARAMETERS
    origin: dict[str, Any] = {
        "command": shlex.join(["python", "train.py", *argv]),
        "commit": current_commit(),
        "machine": machine_kind(),
    }
    if args.resume is not None and path.exists():
        before = yaml.safe_load(path.read_text())
        resumed = [*before.get("resumed", []), origin]
        origin = {name: before.get(name) for name in origin} | {"resumed": resumed}
    content = {"task": args.task, **origin, **to_plain(cfg)}
    replace_file(path, yaml.safe_dump(content, sort_keys=False).encode())
