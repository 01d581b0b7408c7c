"""Measure the speed and the memory of hearing robots: python -m benchmarks.sound.

The policy that ships walks on wood. The whole is what `evaluate.py noise` does. Of its parts are
timed: to find landings and sliding in the physics, to make and measure the sound, and, for one
robot, to have levels without sound, and to make its sound as it walks, a control step at a time.
A walk of twice the length, in a process of its own as the first one, shows whether memory grows
with it.
"""

from __future__ import annotations

from mute.support.threads import configure_threads

configure_threads()  # before torch is imported

import dataclasses
import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from rich.progress import track

from mute.acoustics.audible_env import TIMESTEP, make_listening_env
from mute.acoustics.contacts import ContactBlock
from mute.acoustics.energy import EnergyMeter
from mute.acoustics.floors import FLOORS
from mute.acoustics.listener import SAMPLE_RATE, SILENT_STRETCH, STRETCH
from mute.acoustics.live_sound import warm_up
from mute.acoustics.metering.sound_level_meter import SoundLevelMeter
from mute.acoustics.recorder import Recorder
from mute.acoustics.soundscape import Soundscape
from mute.acoustics.sources.exposures import blow_exposures
from mute.command_lines.arguments import (
    check_trials,
    command_line,
    make_directory,
    parse,
)
from mute.command_lines.sound_options import load_audible_policy
from mute.controllers import LearnedController
from mute.controllers.learned import Policy
from mute.evaluation.noise_levels import SETTLE_TIME, NoiseSetting, measure_noise
from mute.evaluation.tables import print_table, write_json
from mute.evaluation.trials import run_trial
from mute.evaluation.usual_robots import robots_cfg
from mute.support.errors import run_cli
from mute.support.processes import call_apart, peak_memory_mb
from mute.support.provenance import machine_kind
from mute.support.resources import shipped_file
from mute.tasks import DEFAULT_TASK

__all__ = ["Part", "SoundBenchmarkArgs", "Times", "measure"]

_FLOOR = "wood"
_OTHER_FLOOR = "tile"
"""Whose table is timed: that of the other is there by then."""
_SPEED = 0.5
"""Commanded speed at beta = 0, m/s, as in the calibration."""
_SEED = 1


@dataclass
class SoundBenchmarkArgs:
    """Arguments of the benchmark."""

    policy: Path = shipped_file(DEFAULT_TASK)
    """The policy that walks."""
    trials: int = 64
    """Robots that walk side by side."""
    seconds: float = 10.0
    """Measured length of a trial, s; for the memory, it is walked for twice as long, too."""
    json: bool = False
    """Print JSON and nothing else."""
    out: Path | None = None
    """File to write the JSON to as well."""


@dataclass
class Part:
    """What one part of the work takes."""

    name: str
    """`whole`: physics, policy, sound and meter. `recorder`: finding landings and sliding in what
    was copied from the physics. `sound`: making and measuring the sound. Of one robot without
    sound: `lone recorder`, `lone energies`: the levels, and `lone walk`: both with all else."""
    robots: int
    """Robots side by side."""
    simulated: float
    """Length of the walk, s: of the trial and of `SETTLE_TIME` before it."""
    wall: float
    """What it took, s."""
    real_time: float
    """Length of the walk over what it took."""


@dataclass
class Times:
    """What a walk takes."""

    parts: list[Part]
    """Its parts, the whole first."""
    table: float
    """What the table of a floor takes, from which its levels without sound come, once in a process,
    s."""
    memory_mb: float
    """Largest memory of the process after the whole, MB."""


def measure(policy_file: str, trials: int, seconds: float, whole_alone: bool) -> Times:
    """Return what a walk takes, for a process that did nothing else before.

    Args:
        policy_file: The policy that walks.
        trials: Robots side by side.
        seconds: Measured length of a trial, s.
        whole_alone: Leave out the parts of the whole.
    """
    policy = load_audible_policy(Path(policy_file))
    simulated = seconds + SETTLE_TIME

    def part(name: str, robots: int, wall: float) -> Part:
        return Part(name, robots, simulated, wall, simulated / wall)

    start = time.perf_counter()
    measure_noise(policy, _FLOOR, [NoiseSetting(0.0, _SPEED)], trials, seconds, _SEED)
    parts = [part("whole", trials, time.perf_counter() - start)]
    memory = peak_memory_mb()
    if whole_alone:
        return Times(parts, math.nan, memory)
    table = _table_time()
    soundscape = Soundscape(trials, [_FLOOR], sample_rate=SAMPLE_RATE, seed=_SEED)
    meter = SoundLevelMeter(SAMPLE_RATE, trials)
    finding, hearing, _ = _walk(
        policy, trials, simulated, STRETCH, lambda block: meter.update(soundscape.render(block))
    )
    parts += [part("recorder", trials, finding), part("sound", trials, hearing)]
    energies = EnergyMeter(1, [_FLOOR])
    finding, hearing, walking = _walk(policy, 1, simulated, SILENT_STRETCH, energies.update)
    parts += [part("lone recorder", 1, finding), part("lone energies", 1, hearing)]
    parts.append(part("lone walk", 1, walking))
    warm_up(_FLOOR, SAMPLE_RATE, TIMESTEP)
    live = Soundscape(1, [_FLOOR], sample_rate=SAMPLE_RATE, seed=_SEED)
    finding, hearing, _ = _walk(policy, 1, simulated, policy.cfg.env.step_dt, live.render)
    parts.append(part("lone live sound", 1, finding + hearing))
    return Times(parts, table, memory)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Raises:
        MuteError: If an argument is bad, or the policy cannot be used.
    """
    argv = command_line() if argv is None else list(argv)
    args = parse(SoundBenchmarkArgs, argv, "Measure the speed and memory of hearing robots.")
    check_trials(args.trials, args.seconds)
    policy = load_audible_policy(args.policy)
    if args.out is not None:
        make_directory(args.out.parent)
    work = ((args.seconds, False), (2.0 * args.seconds, True))
    once, twice = (
        call_apart(measure, str(args.policy), args.trials, *walk)
        for walk in (work if args.json else track(work, "walks"))
    )
    content = {
        "task": policy.task,
        "floor": _FLOOR,
        "trials": args.trials,
        "seconds": args.seconds,
        "machine": machine_kind(),
        "parts": [dataclasses.asdict(part) for part in once.parts],
        "table": once.table,
        "memory_mb": once.memory_mb,
        "memory_growth_mb": twice.memory_mb - once.memory_mb,
    }
    if args.out is not None:
        write_json(args.out, content)
    if args.json:
        print(json.dumps(content))
    else:
        print_table(content["machine"], content["parts"], list(Part.__annotations__))
        print(f"table of a floor, once in a process: {content['table']:.2f} s")
        print(
            f"memory of the whole: {content['memory_mb']:.0f} MB; for twice the seconds "
            f"{content['memory_growth_mb']:+.0f} MB"
        )
    return 0


def _table_time() -> float:
    """Return what the table of a floor takes, s, in a process that has heard others before."""
    one = np.ones(1)
    first = np.zeros(1, dtype=np.int64)
    begin = time.perf_counter()
    blow_exposures(FLOORS[_OTHER_FLOOR], one, one, first, first)
    return time.perf_counter() - begin


def _walk(
    policy: Policy,
    robots: int,
    simulated: float,
    stretch: float,
    hear: Callable[[ContactBlock], object],
) -> tuple[float, float, float]:
    """Walk, and return the times of the recorder, of `hear`, and of everything, s."""
    env = make_listening_env(robots_cfg(policy, robots, simulated, _SEED), _FLOOR)
    recorder = Recorder(env)
    steps, at_once = round(simulated / env.step_dt), round(stretch / env.step_dt)
    made, finding, hearing = 0, 0.0, 0.0

    def listen(_: object, dones: torch.Tensor) -> None:
        nonlocal made, finding, hearing
        made += 1
        if bool(dones.any()):
            recorder.restart(dones.numpy(), env.unstable.numpy())
        if made % at_once and made < steps:
            return
        start = time.perf_counter()
        block = recorder.take()
        found = time.perf_counter()
        hear(block)
        finding += found - start
        hearing += time.perf_counter() - found

    command = torch.tensor((_SPEED, 0.0, 0.0, 0.0))
    controller = LearnedController(policy, robots)
    start = time.perf_counter()
    run_trial(env, controller, command, steps, listen)
    return finding, hearing, time.perf_counter() - start


if __name__ == "__main__":
    run_cli(main)
