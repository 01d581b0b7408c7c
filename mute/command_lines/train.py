"""`train.py`: learn a task, show how it goes, save, resume."""

from __future__ import annotations

import dataclasses
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch

from mute.checkpoint import (
    CheckpointError,
    latest_checkpoint,
    load_checkpoint,
    newest_checkpoint,
)
from mute.command_lines.arguments import (
    command_line,
    current_spelling,
    is_given,
    parse,
    resolve_device,
    selected_task,
    task_name,
)
from mute.command_lines.reward_options import (
    TERM_OPTIONS,
    with_terms_offered,
    without_unused_terms,
)
from mute.config import AgentCfg, TaskCfg, from_plain, to_plain
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.evaluation.noise_probe import NoiseProbe
from mute.learning.displays import LiveDisplay, PlainDisplay
from mute.learning.distributed import Ranks, joined_ranks
from mute.learning.divergence import DivergedError
from mute.learning.run_directory import (
    claim_run,
    give_up_run,
    last_saved,
    plan_run,
    program_name,
    read_parameters,
    resume_hint,
    started_command,
    write_parameters,
)
from mute.learning.runner import MuteRunner, OnIteration
from mute.learning.saved_state import check_iteration
from mute.support.errors import EXIT_USER_ERROR, MuteError
from mute.support.files import DiskError
from mute.support.threads import core_share
from mute.tasks import DEFAULT_TASK, FLAT_TASK, make_task

__all__ = ["main"]

_GPU_ENVS = 4096
"""Environments of the recipe on flat ground on a GPU; its own 1024 suit a CPU."""


@dataclass
class TrainArgs:
    """Arguments of `train.py`."""

    task: str = DEFAULT_TASK
    """Task to learn; `module:task` imports a module of yours first, which registers it."""
    num_envs: int | None = None
    """Number of robots, of each rank where torchrun starts several; by default the task's, and more
    of go1_mute_flat on a GPU."""
    iterations: int | None = None
    """Rollouts and updates in all, those before a --resume included."""
    seed: int | None = None
    """Seed of everything random."""
    device: str = "auto"
    """auto, cpu or cuda: where networks live, and physics unless the task has it on the CPU; with
    torchrun, each rank has a GPU of its own."""
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
    program = program_name(argv)
    argv = command_line() if argv is None else list(argv)
    with joined_ranks() as ranks:
        return _learn(argv, ranks, started_command(ranks, program))


def _learn(argv: Sequence[str], ranks: Ranks, command: Sequence[str]) -> int:
    start = ranks.broadcast(time.strftime("%Y-%m-%d_%H-%M-%S"))
    with ranks.together():
        args, checkpoint = _arguments(argv)
        cfg = _configuration(args)
        kind = resolve_device(args.device)
        torch.set_float32_matmul_precision(cfg.agent.matmul_precision)
        before = read_parameters(checkpoint.parent) if checkpoint else None
        runs = args.log_dir / args.task
        run_dir = checkpoint.parent if checkpoint else plan_run(runs, args.run_name, start)
        display = PlainDisplay() if args.plain or not ranks.first else LiveDisplay(args.task)
        if cfg.env.engine == "warp" or (cfg.env.engine == "auto" and kind == "cuda"):
            _say(ranks, "Warp compiles its kernels at their first use, for a minute or more")
        elif cfg.env.num_threads > core_share():
            _say(ranks, _too_many_threads(cfg.env.num_threads))
        runner = _make_runner(args, cfg, run_dir, ranks, kind, display.update)
        if checkpoint:
            _resume(runner, checkpoint)
            if is_given("--agent.ppo.learning-rate", argv):
                runner.learn_at(cfg.agent.ppo.learning_rate)
    same = (to_plain(cfg), kind, str(run_dir), runner.current_learning_iteration)
    ranks.check_equal("configuration or checkpoint", same)
    with ranks.together():
        if ranks.first:
            written = [*command[:-1], Path(command[-1]).name, *argv]
            if checkpoint:  # in its old directory, and only once nothing can refuse it any more
                runner.on_begin = lambda: write_parameters(
                    checkpoint.parent, args.task, cfg, written, before
                )
            else:
                run_dir = _begin_run(args, cfg, run_dir, written)
    run_dir = ranks.broadcast(run_dir)
    runner.keep_in(run_dir)
    if checkpoint and runner.robots_anew:
        _say(
            ranks,
            f"{checkpoint} is of another number of ranks: networks, optimisers, normalisers and "
            "curricula go on, robots begin anew",
        )
    _say(ranks, f"run: {run_dir}")
    task = selected_task(argv, DEFAULT_TASK)  # with its module
    finished = _train(runner, ranks, display, lambda: last_saved(run_dir, command, task))
    path = runner.checkpoint_path()
    _say(ranks, f"{'saved' if finished else 'interrupted, saved'}: {path}")
    if not finished:
        _say(ranks, f"go on with: {resume_hint(command, task, path)}")
        return runner.stop.exit_status
    return 0


def _begin_run(args: TrainArgs, cfg: TaskCfg, run_dir: Path, command: Sequence[str]) -> Path:
    """Make the directory of a new run and return it."""
    run_dir = claim_run(run_dir, named=bool(args.run_name))
    try:
        write_parameters(run_dir, args.task, cfg, command)
    except BaseException:
        give_up_run(run_dir)
        raise
    return run_dir


def _train(
    runner: MuteRunner,
    ranks: Ranks,
    display: LiveDisplay | PlainDisplay,
    advice: Callable[[], str],
) -> bool:
    """Learn; return False if interrupted.

    Raises:
        MuteError: If the disk refuses, a rank is gone, or what is learnt is no longer finite; it
            says from where to go on.
    """
    try:
        with display, ranks.watched(advice):
            return runner.train()
    except (CheckpointError, DiskError, DivergedError) as error:
        if isinstance(error, DivergedError) and not ranks.first:  # all stop, and one speaks
            raise SystemExit(EXIT_USER_ERROR) from None
        raise MuteError(f"{error}; {advice()}") from error


def _say(ranks: Ranks, line: str) -> None:
    if ranks.first:
        print(line, file=sys.stderr)


def _too_many_threads(threads: int) -> str:
    """Return a warning: the user's word counts, but may have been meant for another machine."""
    return (
        f"warning: --env.num-threads {threads}: this process has {core_share()} of the machine's "
        "processors, and more threads than that take turns; 0 takes as many as suit"
    )


def _make_runner(
    args: TrainArgs,
    cfg: TaskCfg,
    run_dir: Path,
    ranks: Ranks,
    kind: str,
    on_iteration: OnIteration,
) -> MuteRunner:
    shown = on_iteration if ranks.first else None
    try:
        return MuteRunner(args.task, cfg, run_dir, ranks.device(kind), shown, ranks, NoiseProbe())
    except ValueError as error:
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
    task = task_name(selected_task(argv, DEFAULT_TASK))
    cfg = make_task(task)
    args = _parse(argv, task, cfg)
    if args.resume is None:
        if task == FLAT_TASK and resolve_device(args.device) == "cuda":
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
    try:
        iteration = check_iteration(saved)
    except ValueError as error:
        raise CheckpointError(f"{path} cannot be resumed: {error}") from error
    args = _parse(argv, task, cfg)
    _check_resume(args, path, cfg.env.seed, iteration)
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
    default = TrainArgs(task=task, env=with_terms_offered(cfg.env), agent=cfg.agent)
    with TERM_OPTIONS:
        args = parse(TrainArgs, current_spelling(argv), "Learn a task.", default)
    return dataclasses.replace(args, task=task, env=without_unused_terms(args.env, cfg.env))


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
