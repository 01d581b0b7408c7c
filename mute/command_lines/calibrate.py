"""Fit the model's gains: python -m mute.acoustics.calibration --policy FILE.

What is fitted is one gain a floor and nothing else, on the sound of the feet (impacts and
scuffing), such that a reference policy at 0.5 m/s has the mean noise level (MNL) that the paper
measured of the real robot on that floor. All else that the model then says (peaks, other betas,
other speeds, other policies) is a prediction.
"""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from numpy.typing import NDArray
from rich.progress import track
from scipy.optimize import brentq

from mute.acoustics.audible_env import make_listening_env
from mute.acoustics.floors import FLOORS, OWN_GAINS
from mute.acoustics.gains import GAINS_FILE
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
from mute.command_lines.sound_options import load_audible_policy
from mute.controllers import LearnedController
from mute.controllers.learned import Policy
from mute.evaluation.noise_levels import SETTLE_TIME
from mute.evaluation.paper_levels import PAPER_LEVELS
from mute.evaluation.tables import print_table, write_json
from mute.evaluation.trials import evaluation_cfg, run_trial
from mute.support.errors import MuteError
from mute.support.provenance import REPOSITORY, current_commit, file_sha256, machine_kind
from mute.support.ranges import Range

__all__ = ["CalibrationArgs", "fit_gain", "main", "provenance"]

_REFERENCES = {"mute": "mute beta 0", "dreamwaq": "dreamwaq"}
"""Rows of the paper that can be fitted, by the argument that names them."""

_SAME_AS = {"concrete": "tile"}
"""Floors that the paper did not measure at 0.5 m/s, and the one whose gain they take (chosen: both
are hard mineral slabs)."""


@dataclass
class CalibrationArgs(PolicyArgs):
    """Fit one gain a floor to the levels that the paper measured.

    The policy stands for the one that the paper measured.
    """

    reference: Literal["mute", "dreamwaq"] = "mute"
    """The paper's row to fit: MUTE with beta = 0, or DreamWaQ."""
    speed: float = 0.5
    """Commanded speed, m/s."""
    trials: int = 5
    """Robots that walk on each floor."""
    seconds: float = 10.0
    """Length of a trial, s."""
    seed: int = 1
    """Seed of initial states and of the noise."""
    out: Path = GAINS_FILE
    """File to write."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Raises:
        MuteError: If an argument is bad, the policy cannot be used, or a level cannot be reached.
    """
    args = parse(CalibrationArgs, command_line() if argv is None else argv, __doc__ or "")
    check_option("trials", args.trials, MANY_ROBOTS)
    check_option("seconds", args.seconds, Range(2.0, LONGEST_WALK))
    check_option("speed", args.speed, Range(0.0, 1.0, above=True))
    check_seed(args.seed)
    args = args.with_policy_found()
    policy = load_audible_policy(args.policy)
    make_directory(args.out.parent)
    if args.out.is_dir():
        raise MuteError(f"--out {args.out}: must name a file, and is a directory")
    origin = provenance(args, policy)  # now: a file may be replaced while this runs
    targets = PAPER_LEVELS[_REFERENCES[args.reference]]
    rows = {
        name: _fit_floor(args, policy, name, mnl)
        for name, (mnl, _) in track(targets.items(), "floors")
    }
    for name, other in _SAME_AS.items():
        rows[name] = {"gain": rows[other]["gain"], "source": f"chosen: as {other}"}
    assert set(rows) == FLOORS.keys() - OWN_GAINS.keys()
    write_json(args.out, origin | {"floors": rows})
    table = [{"floor": name, **row} for name, row in rows.items()]
    columns = ["floor", "gain", "target_mnl", "mnl", "pnl"]
    print_table("gains", [{key: row.get(key) for key in columns} for row in table], columns)
    print(f"written: {args.out}")
    return 0


def provenance(args: CalibrationArgs, policy: Policy) -> dict[str, Any]:
    """Return where gains come from, as plain data; paths are relative to the repository."""
    options = {
        "policy": os.path.relpath(args.policy, REPOSITORY),
        "reference": args.reference,
        "speed": f"{args.speed:g}",
        "trials": args.trials,
        "seconds": f"{args.seconds:g}",
        "seed": args.seed,
        "out": os.path.relpath(args.out, REPOSITORY),
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


def fit_gain(mnl: Callable[[float], float], target: float) -> float:
    """Return the gain at which a level reaches its target, to 0.01 dB.

    Args:
        mnl: Level as a function of the gain, rising, dB.
        target: dB.

    Raises:
        ValueError: If no gain from 1e-4 to 1e4 reaches it, as when other sources alone exceed it.
    """
    low, high = -80.0, 80.0
    if not mnl(10.0 ** (low / 20.0)) < target < mnl(10.0 ** (high / 20.0)):
        raise ValueError(f"no gain gives {target:g} dB")
    decibels = brentq(lambda db: mnl(10.0 ** (db / 20.0)) - target, low, high, xtol=0.005)
    return 10.0 ** (float(decibels) / 20.0)  # pyright: ignore[reportArgumentType]


def _fit_floor(args: CalibrationArgs, policy: Policy, floor: str, target: float) -> dict:
    feet, rest = _walk(args, policy, floor)

    def levels(gain: float) -> tuple[float, float]:
        trials = measure(gain * feet + rest, SAMPLE_RATE)
        mnl = float(np.mean([trial.mnl for trial in trials]))
        return mnl, float(np.mean([trial.pnl for trial in trials]))

    try:
        gain = fit_gain(lambda value: levels(value)[0], target)
    except ValueError as error:
        raise MuteError(f"{floor}: {error} with {args.policy}") from error
    mnl, pnl = levels(gain)
    return {
        "gain": gain,
        "target_mnl": target,
        "source": f"the paper's table of noise levels, {args.reference}",
        "mnl": mnl,
        "pnl": pnl,
    }


def _walk(args: CalibrationArgs, policy: Policy, floor: str) -> tuple[NDArray, NDArray]:
    """Return what the feet sound of, and all else, Pa. Shapes: (trials, samples)."""
    cfg = evaluation_cfg(policy.cfg.env, args.trials, args.seconds + SETTLE_TIME, args.seed)
    env = make_listening_env(cfg, floor)
    recorder = Recorder(env)
    scapes = [
        Soundscape(args.trials, [floor], None, SAMPLE_RATE, args.seed, sources)
        for sources in (("impacts", "scuffing"), ("drive", "fan"))
    ]
    heard: list[tuple[NDArray, ...]] = []

    def listen(_: object, dones: torch.Tensor) -> None:
        if bool(dones.any()):  # a fall: an episode is longer than the trial
            raise MuteError(f"{args.policy} falls on {floor}: it cannot be the reference")
        block = recorder.take()
        heard.append(tuple(scape.render(block) for scape in scapes))

    steps = round((args.seconds + SETTLE_TIME) / env.step_dt)
    command = torch.tensor((args.speed, 0.0, 0.0, 0.0))
    controller = LearnedController(policy, args.trials)
    run_trial(env, controller, command, steps, listen)
    first = round(SETTLE_TIME * SAMPLE_RATE)
    feet, rest = (np.concatenate(part, axis=1)[:, first:] for part in zip(*heard, strict=True))
    return feet, rest
