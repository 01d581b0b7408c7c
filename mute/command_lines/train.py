"""`train.py`: learn a task, show how it goes, save, resume."""

from __future__ import annotations

import dataclasses
import shlex
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
import yaml

from mute.checkpoint import (
    CheckpointError,
    latest_checkpoint,
    load_checkpoint,
    newest_checkpoint,
)
from mute.command_lines.arguments import (
    command_line,
    current_spelling,
    parse,
    resolve_device,
    selected_task,
)
from mute.config import AgentCfg, TaskCfg, from_plain, to_plain
from mute.envs.menagerie import SceneError
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.evaluation.noise_probe import NoiseProbe
from mute.learning.displays import LiveDisplay, PlainDisplay
from mute.learning.distributed import Ranks, joined_ranks
from mute.learning.runner import MuteRunner, Progress
from mute.support.errors import EXIT_INTERRUPTED, MuteError
from mute.support.files import replace_file
from mute.support.provenance import current_commit, machine_kind
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
    """Number of robots, of each rank where torchrun starts several; by default what suits the
    machine."""
    iterations: int | None = None
    """Rollouts and updates in all, those before a --resume included."""
    seed: int | None = None
    """Seed of everything random."""
    device: str = "auto"
    """auto, cpu or cuda: where networks and physics live; with torchrun, each rank has a GPU of its
    own."""
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
        MuteError: If an argument is bad, a checkpoint cannot be used, or a rank is gone.
    """
    argv = command_line() if argv is None else list(argv)
    with joined_ranks() as ranks:
        return _learn(argv, ranks)


def _learn(argv: Sequence[str], ranks: Ranks) -> int:
    start = ranks.broadcast(time.strftime("%Y-%m-%d_%H-%M-%S"))
    with ranks.together():
        args, checkpoint = _arguments(argv)
        cfg = _configuration(args)
        kind = resolve_device(args.device)
        torch.set_float32_matmul_precision(cfg.agent.matmul_precision)
        run_dir = checkpoint.parent if checkpoint else _new_run(args, start)
        display = PlainDisplay() if args.plain or not ranks.first else LiveDisplay(args.task)
        if cfg.env.engine == "warp" or (cfg.env.engine == "auto" and kind == "cuda"):
            _say(ranks, "Warp compiles its kernels at their first use, for a minute or more")
        runner = _make_runner(args, cfg, run_dir, ranks, kind, display.update)
        if checkpoint:
            _resume(runner, checkpoint)
    same = (to_plain(cfg), kind, str(run_dir), runner.current_learning_iteration)
    ranks.check_equal("configuration or checkpoint", same)
    with ranks.together():
        if ranks.first:
            _make_directory(run_dir)
            _write_parameters(run_dir, args, cfg, [*ranks.launcher.split(), "train.py", *argv])
    if checkpoint and runner.robots_anew:
        _say(
            ranks,
            f"{checkpoint} is of another number of ranks: networks, optimisers, normalisers and "
            "curricula go on, robots begin anew",
        )
    _say(ranks, f"run: {run_dir}")
    goes_on = f"{ranks.launcher} train.py --task {args.task} --resume"
    with display, ranks.watched(lambda: _last_saved(run_dir, goes_on)):
        finished = runner.train()
    path = runner.checkpoint_path()
    _say(ranks, f"{'saved' if finished else 'interrupted, saved'}: {path}")
    if not finished:
        _say(ranks, f"go on with: {goes_on} {path}")
        return EXIT_INTERRUPTED
    return 0


def _say(ranks: Ranks, line: str) -> None:
    if ranks.first:
        print(line, file=sys.stderr)


def _last_saved(run_dir: Path, goes_on: str) -> str:
    newest = newest_checkpoint(run_dir)
    if newest is None:
        return "no checkpoint has been saved yet"
    return f"the last checkpoint is whole, go on with: {goes_on} {newest}"


def _make_runner(
    args: TrainArgs,
    cfg: TaskCfg,
    run_dir: Path,
    ranks: Ranks,
    kind: str,
    on_iteration: Progress,
) -> MuteRunner:
    shown = on_iteration if ranks.first else None
    try:
        return MuteRunner(args.task, cfg, run_dir, ranks.device(kind), shown, ranks, NoiseProbe())
    except (ValueError, SceneError) as error:
        raise MuteError(str(error)) from error


def _resume(runner: MuteRunner, checkpoint: Path) -> None:
    runner.load(str(checkpoint))
    iterations = runner.task_cfg.agent.iterations
    if runner.current_learning_iteration >= iterations:
        raise MuteError(
            f"{checkpoint} has finished its {iterations} iterations; ask for more with --iterations"
        )


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
    newest = newest_checkpoint(path.parent)
    if newest is not None and int(newest.stem.removeprefix("model_")) > iteration:
        raise MuteError(
            f"{path} is not the newest checkpoint of its run: resume {newest}, or delete or move "
            "away the later ones"
        )


def _parse(argv: Sequence[str], task: str, cfg: TaskCfg) -> TrainArgs:
    default = TrainArgs(task=task, env=cfg.env, agent=cfg.agent)
    return parse(TrainArgs, current_spelling(argv), "Learn a task.", default)


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


def _new_run(args: TrainArgs, start: str) -> Path:
    """Return the directory of a new run, which is made once everything else has gone well."""
    name = args.run_name or start
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


def _write_parameters(run_dir: Path, args: TrainArgs, cfg: TaskCfg, command: Sequence[str]) -> None:
    """Write what the run is re-made from, before it starts or goes on.

    The command that started it stays; those that went on are listed under `resumed`.
    """
    path = run_dir / _PARAMETERS
    origin: dict[str, Any] = {
        "command": shlex.join(command),
        "commit": current_commit(),
        "machine": machine_kind(),
    }
    if args.resume is not None and path.exists():
        before = yaml.safe_load(path.read_text())
        resumed = [*before.get("resumed", []), origin]
        origin = {name: before.get(name) for name in origin} | {"resumed": resumed}
    content = {"task": args.task, **origin, **to_plain(cfg)}
    replace_file(path, yaml.safe_dump(content, sort_keys=False).encode())
