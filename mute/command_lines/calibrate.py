"""Fit the one unknown of the sound model: python -m mute.acoustics.calibration --policy FILE.

That is the transmissibility, the share of a force at a foot that comes to the robot's shell. It is
fitted on one row of the paper: such that a reference policy at 0.5 m/s on a floor has the mean
noise level (MNL) that was measured of the real robot there. All else that the model then says
(other floors, peaks, other betas, speeds and policies) is a prediction.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.optimize import brentq

from mute.acoustics.audible_env import make_listening_env
from mute.acoustics.body import CALIBRATION_FILE
from mute.acoustics.listener import SAMPLE_RATE
from mute.acoustics.metering.sound_level_meter import measure
from mute.acoustics.recorder import Recorder
from mute.acoustics.soundscape import Soundscape
from mute.command_lines.arguments import (
    LONGEST_WALK,
    MANY_ROBOTS,
    check_option,
    check_seed,
    command_line,
    make_directory,
    parse,
)
from mute.command_lines.policy_options import PolicyArgs
from mute.command_lines.sound_options import (
    load_audible_policy,
    progress_bar,
    warn_if_not_known_well,
)
from mute.controllers.driver import Driver
from mute.evaluation.intervals import mean_with_interval
from mute.evaluation.noise_levels import SETTLE_TIME
from mute.evaluation.paper_levels import PAPER_LEVELS
from mute.evaluation.tables import write_json
from mute.evaluation.trials import run_trial
from mute.evaluation.usual_robots import robots_cfg
from mute.support.errors import MuteError
from mute.support.provenance import current_commit, file_sha256, machine_kind, place_of
from mute.support.ranges import Range
from mute.support.resources import shipped_file
from mute.tasks import FLAT_TASK

__all__ = ["REFERENCES", "CalibrationArgs", "fit_share", "fitted", "main", "provenance"]

REFERENCES = {"mute": "mute beta 0", "dreamwaq": "dreamwaq"}
"""Rows of the paper that can be fitted, by the argument that names them."""

_MOST_SOUND = 2000.0
"""Most sound that is held, s of all robots together: 0.8 GB."""

_STRETCH = 0.5
"""Time that is worked on at once, s."""


@dataclass
class CalibrationArgs(PolicyArgs):
    """Fit the transmissibility to one level that the paper measured.

    The policy stands for the one that the paper measured.
    """

    policy: Path = shipped_file(FLAT_TASK)
    """Policy that walks, a checkpoint, or 'latest' for the newest one under --log-dir; by default
    that of go1_mute_flat."""
    reference: Literal["mute", "dreamwaq"] = "mute"
    """The paper's row to fit: MUTE with beta = 0, or DreamWaQ."""
    floor: Literal["wood", "carpet", "tile"] = "wood"
    """Floor that it is fitted on."""
    speed: float = 0.5
    """Commanded speed, m/s."""
    trials: int = 64
    """Robots that walk, side by side."""
    seconds: float = 3.0
    """Length of a trial, s."""
    seed: int = 1
    """Seed of the robots' physics, of initial states and of the noise."""
    out: Path = CALIBRATION_FILE
    """File to write."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Raises:
        MuteError: If an argument is bad, the policy cannot be used, or a level cannot be reached.
    """
    args = parse(CalibrationArgs, command_line() if argv is None else argv, __doc__ or "")
    check_option("trials", args.trials, MANY_ROBOTS)
    check_option("seconds", args.seconds, Range(2.0, LONGEST_WALK))
    if args.trials * args.seconds > _MOST_SOUND:
        raise MuteError(
            f"--trials {args.trials} of --seconds {args.seconds:g} is more sound than the "
            f"{_MOST_SOUND:g} s that are held at a time"
        )
    check_option("speed", args.speed, Range(0.0, 1.0, above=True))
    check_seed(args.seed)
    args = args.with_policy_found()
    policy = load_audible_policy(args.policy)
    make_directory(args.out.parent)
    if args.out.is_dir():
        raise MuteError(f"--out {args.out}: must name a file, and is a directory")
    origin = provenance(args, policy)  # now: a file may be replaced while this runs
    found = fitted(args, policy)
    write_json(args.out, origin | {"reference": args.reference} | found)
    print(
        f"transmissibility {found['transmissibility']:.4f}: MNL {found['mnl']:.2f} dBA on "
        f"{args.floor}, the paper's {found['target_mnl']:.2f}; PNL {found['pnl']:.2f}"
    )
    print(f"written: {args.out}")
    return 0


def provenance(args: CalibrationArgs, policy: Driver) -> dict[str, Any]:
    """Return where a calibration comes from, as plain data; files are named by `place_of`."""
    options = {
        "policy": place_of(args.policy),
        "reference": args.reference,
        "floor": args.floor,
        "speed": f"{args.speed:g}",
        "trials": args.trials,
        "seconds": f"{args.seconds:g}",
        "seed": args.seed,
        "out": place_of(args.out),
    }
    words = [word for name, value in options.items() for word in (f"--{name}", str(value))]
    return {
        "command": shlex.join(["python", "-m", "mute.acoustics.calibration", *words]),
        "policy": {
            "task": policy.task,
            "iteration": policy.iteration,
            "beta": 0.0,
            "sha256": file_sha256(args.policy),
        },
        "commit": current_commit(),
        "machine": machine_kind(),
    }


def fit_share(mnl: Callable[[float], float], target: float) -> float:
    """Return the share at which a level reaches its target, to 0.01 dB.

    Args:
        mnl: Level as a function of the share, rising, dB.
        target: dB.

    Raises:
        ValueError: If no share from 1e-4 to 1 reaches it, as when other sources alone exceed it.
    """
    low, high = -80.0, 0.0
    faintest, loudest = (mnl(10.0 ** (db / 20.0)) for db in (low, high))
    if not faintest < target < loudest:
        raise ValueError(
            f"no share of a foot's force gives {target:g} dB: it is {faintest:.1f} without the "
            f"robot's own sound, and {loudest:.1f} with all of the force"
        )
    decibels = brentq(lambda db: mnl(10.0 ** (db / 20.0)) - target, low, high, xtol=0.005)
    return 10.0 ** (float(decibels) / 20.0)  # pyright: ignore[reportArgumentType]


def fitted(args: CalibrationArgs, policy: Driver) -> dict[str, Any]:
    """Return what is fitted, and the levels that come of it, as plain data.

    Args:
        args: Which row of the paper is fitted, and by which trials; they are checked already.
        policy: The policy of these arguments.

    Raises:
        MuteError: If all robots fall, or no share of a foot's force gives the level.
    """
    target, _ = PAPER_LEVELS[REFERENCES[args.reference]][args.floor]
    robot, rest = _walk(args, policy)

    def levels(share: float) -> tuple[list[float], list[float]]:
        trials = measure(share * robot + rest, SAMPLE_RATE)
        return [trial.mnl for trial in trials], [trial.pnl for trial in trials]

    try:
        share = fit_share(lambda value: float(np.mean(levels(value)[0])), target)
    except ValueError as error:
        raise MuteError(f"{args.floor}: {error} with {args.policy}") from error
    mnl, pnl = levels(share)
    mean, _, half_width = mean_with_interval(mnl)
    warn_if_not_known_well(half_width)
    return {
        "transmissibility": share,
        "floor": args.floor,
        "target_mnl": target,
        "source": f"the paper's table of noise levels, {REFERENCES[args.reference]}",
        "mnl": mean,
        "mnl_ci95": half_width,
        "pnl": float(np.mean(pnl)),
        "robots": len(robot),
    }


def _walk(args: CalibrationArgs, policy: Driver) -> tuple[NDArray, NDArray]:
    """Return what the robots sound of with all of the force in the shell, and all else, Pa.

    Of robots that fall nothing is taken. Shapes: (robots, samples).

    Raises:
        MuteError: If all fall.
    """
    cfg = robots_cfg(policy, args.trials, args.seconds + SETTLE_TIME, args.seed)
    env = make_listening_env(cfg, args.floor)
    recorder = Recorder(env)
    scapes = [
        Soundscape(args.trials, [args.floor], None, SAMPLE_RATE, args.seed, sources, 1.0)
        for sources in (("body", "drive"), ("impacts", "scuffing", "fan"))
    ]
    steps = round((args.seconds + SETTLE_TIME) / env.step_dt)
    samples = round(steps * env.step_dt * SAMPLE_RATE)
    heard = np.empty((2, args.trials, samples), dtype=np.float32)
    stood = np.ones(args.trials, dtype=bool)
    stretch, done, filled = max(1, round(_STRETCH / env.step_dt)), 0, 0

    def listen(advance: Callable[[float], None], dones: torch.Tensor) -> None:
        nonlocal done, filled
        done += 1
        stood[dones.numpy()] = False
        if bool(dones.any()):
            recorder.restart(dones.numpy(), env.unstable.numpy())
        if done % stretch == 0 or done == steps:
            block = recorder.take()
            sounds = [scape.render(block) for scape in scapes]
            stop = filled + sounds[0].shape[1]
            heard[:, :, filled:stop] = sounds
            filled = stop
            advance(done)

    command = torch.tensor((args.speed, 0.0, 0.0, 0.0))
    torch.set_num_threads(1)  # the physics engine has the cores
    with progress_bar("walk", steps) as advance:
        controller = policy.controller(env.cfg)
        run_trial(env, controller, command, steps, lambda _, dones: listen(advance, dones))
    if not stood.any():
        raise MuteError(f"{args.policy} falls on {args.floor}: it cannot be the reference")
    robot, rest = heard[:, stood, round(SETTLE_TIME * SAMPLE_RATE) : filled]
    return robot, rest
