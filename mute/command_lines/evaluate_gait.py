"""`evaluate.py gait` and `progress`: walking over the command range, and how soon it is learnt."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from rich.progress import track

from mute.command_lines.arguments import (
    Numbers,
    check_betas,
    check_option,
    check_seed,
    check_trials,
)
from mute.command_lines.policy_options import DriverArgs
from mute.controllers import LearnedController, load_policy
from mute.controllers.driver import Driver
from mute.envs.commands import BETA, CommandSampler
from mute.envs.quadruped_env import QuadrupedEnv
from mute.evaluation.estimation_errors import EstimationMeter
from mute.evaluation.matched_speed import sweep_beta_at_speed
from mute.evaluation.progress import Milestone, checkpoints_of, training_minutes, walks
from mute.evaluation.tables import print_table, write_csv, write_json
from mute.evaluation.trials import command_sampler, evaluation_cfg, run_trial
from mute.evaluation.usual_robots import under_conditions
from mute.support.provenance import machine_kind
from mute.support.ranges import Range

__all__ = ["GaitArgs", "ProgressArgs", "gait", "progress"]

_SWEEP_ROBOTS = 300


@dataclass
class GaitArgs(DriverArgs):
    """Walk over the command range, and at one actual speed for several betas."""

    trials: int = 256
    """Robots that walk over the command range, for each beta."""
    seconds: float = 20.0
    """Length of a trial, s."""
    beta: Numbers = (0.0, 0.25, 0.5, 0.75, 1.0)
    """Quiet factors."""
    speed: float = 0.5
    """Actual forward speed at which the betas are compared, m/s."""
    randomized: bool = False
    """Keep the training's randomised physics, pushes and sensor noise."""
    seed: int = 1
    """Seed of initial states and commands."""
    out: Path = Path("evaluation")
    """Directory of the CSV and JSON files."""


@dataclass
class ProgressArgs:
    """Measure a run's checkpoints over the command range until one walks."""

    run: Path
    """Directory of the run."""
    trials: int = 256
    """Robots that walk, each with its own command and beta."""
    seconds: float = 20.0
    """Length of a trial, s."""
    randomized: bool = False
    """Robots that differ and see with noise, as `reliability` has them; nobody is pushed."""
    seed: int = 1
    """Seed of initial states and commands."""
    out: Path = Path("evaluation")
    """Directory of the CSV and JSON files."""


def progress(args: ProgressArgs) -> None:
    """Measure checkpoints until one walks."""
    check_trials(args.trials, args.seconds)
    check_seed(args.seed)
    torch.set_num_threads(1)  # the physics engine has the cores
    rows: list[dict[str, Any]] = []
    trained_seed: int | None = None
    for path in track(checkpoints_of(args.run), "checkpoints"):
        policy, minutes = load_policy(path), training_minutes(path)
        trained_seed = policy.cfg.env.seed
        if args.randomized:
            policy = under_conditions(policy)
        env = _environment(policy, args.trials, args.seconds, args.seed, args.randomized)
        draw = _draw_commands(env, args.seed)
        steps = round(args.seconds / env.step_dt)
        meter = run_trial(env, policy.controller(env.cfg), draw.command, steps)
        error, falls = meter.gait().velocity_error_sq, meter.gait().fall_rate
        trained = policy.cfg.env.num_envs * policy.cfg.agent.num_steps_per_env
        milestone = Milestone(
            iteration=policy.iteration,
            steps=(policy.iteration + 1) * trained,
            minutes=minutes,
            velocity_error_sq=error,
            fall_rate=falls,
            walks=walks(error, falls),
        )
        rows.append(dataclasses.asdict(milestone))
        if milestone.walks:
            break
    print_table(f"{args.trials} trials of {args.seconds:g} s", rows, list(rows[0]))
    write_csv(args.out / "progress.csv", rows)
    summary = {
        "machine": machine_kind(),
        "trained_seed": trained_seed,
        "trials": args.trials,
        "seconds": args.seconds,
        "randomized": args.randomized,
        "seed": args.seed,
        "checkpoints": rows,
    }
    write_json(args.out / "progress.json", summary)
    print(f"written: {args.out}/progress.json, progress.csv")


def gait(args: GaitArgs) -> None:
    """Measure a policy over the command range and at one speed."""
    _check(args)
    args = args.with_driver_found()
    origin = args.driver_origin()
    torch.set_num_threads(1)  # the physics engine has the cores
    policy = args.driver()
    over_range = [_over_range(args, policy, beta) for beta in track(args.beta, "command range")]
    at_speed = _at_speed(args, policy)
    columns = ["beta", "fall_rate", "velocity_error_sq", "yaw_rate_error_sq"]
    columns += ["landing_speed_mean", "apex_mean", "power"]
    estimated = ("velocity_rmse", "height_rmse", "phase_mae")
    columns += [name for name in estimated if name in over_range[0]]
    print_table(f"{args.trials} trials of {args.seconds:g} s over the range", over_range, columns)
    columns = ["beta", "landing_speed_mean", "landing_speed_rms", "apex_mean", "duty_factor"]
    columns += ["stride_frequency", "power"]
    print_table(f"at an actual speed of {args.speed:g} m/s", at_speed, columns)
    write_csv(args.out / "gait_range.csv", over_range)
    write_csv(args.out / "gait_at_speed.csv", at_speed)
    summary = {
        **origin,
        "trained_seed": policy.cfg.env.seed,
        "iteration": policy.iteration,
        "trials": args.trials,
        "seconds": args.seconds,
        "speed": args.speed,
        "randomized": args.randomized,
        "seed": args.seed,
        "machine": machine_kind(),
        "range": over_range,
        "at_speed": at_speed,
    }
    write_json(args.out / "gait.json", summary)
    print(f"written: {args.out}/gait.json, gait_range.csv, gait_at_speed.csv")


def _over_range(args: GaitArgs, policy: Driver, beta: float) -> dict[str, Any]:
    """Return the figures of one beta over the task's whole command range."""
    env = _environment(policy, args.trials, args.seconds, args.seed, args.randomized)
    draw = _draw_commands(env, args.seed)
    draw.command[:, BETA] = beta
    controller = policy.controller(env.cfg)
    steps = round(args.seconds / env.step_dt)
    if not isinstance(controller, LearnedController):
        return {"beta": beta} | run_trial(env, controller, draw.command, steps).gait().as_dict()
    estimation = EstimationMeter(env, controller)
    meter = run_trial(env, controller, draw.command, steps, estimation)
    return {"beta": beta} | meter.gait().as_dict() | estimation.errors().as_dict()


def _at_speed(args: GaitArgs, policy: Driver) -> list[dict[str, float]]:
    robots = max(_SWEEP_ROBOTS, 12 * len(args.beta))
    env = _environment(policy, robots, args.seconds, args.seed, args.randomized)
    # All walk straight ahead, from the stance: only speed and beta differ.
    controller = policy.controller(env.cfg)
    steps = round(args.seconds / env.step_dt)
    return sweep_beta_at_speed(env, controller, args.speed, args.beta, steps)


def _environment(
    policy: Driver, num_envs: int, seconds: float, seed: int, randomized: bool
) -> QuadrupedEnv:
    cfg = evaluation_cfg(policy.cfg.env, num_envs, seconds, seed, randomized)
    return QuadrupedEnv(cfg)


def _draw_commands(env: QuadrupedEnv, seed: int) -> CommandSampler:
    """Return commands drawn evenly from the task's whole range, beta included, a tenth zero."""
    draw = command_sampler(env.cfg.commands.drawn_evenly(), env.num_envs, seed)
    draw.resample(torch.ones(env.num_envs, dtype=torch.bool), with_beta=True)
    return draw


def _check(args: GaitArgs) -> None:
    check_trials(args.trials, args.seconds)
    check_seed(args.seed)
    check_betas(args.beta)
    check_option("speed", args.speed, Range(0.0, 1.0, above=True))
