"""`evaluate.py walk`: the long walk over mixed floors, its levels and its map."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from mute.command_lines.arguments import (
    check_betas,
    check_option,
    check_seed,
    check_video,
    check_wav,
    make_directory,
)
from mute.command_lines.sound_options import (
    SoundArgs,
    find_microphone,
    find_room,
    progress_bar,
    tell,
    tell_kept,
    warn_if_not_known_well,
)
from mute.controllers.driver import Driver
from mute.evaluation.course.course import Course, load_course
from mute.evaluation.course.long_walk import Walk, follow_course, make_walk_env
from mute.evaluation.intervals import mean_with_interval, with_interval
from mute.evaluation.plotting import check_matplotlib
from mute.evaluation.tables import print_table, write_csv, write_json
from mute.rendering.kept_walks import KeptWalks
from mute.support.provenance import place_of
from mute.support.ranges import Range
from mute.support.resources import RESOURCES

__all__ = ["WalkArgs", "walk"]


_MOST_TRIALS = 256


@dataclass
class WalkArgs(SoundArgs):
    """Follow a course over several floors, and map the modelled levels along it."""

    course: Path = RESOURCES / "courses" / "office.yaml"
    """Course to walk: path, floors and speed (YAML)."""
    beta: float = 0.5
    """Quiet factor."""
    hold_speed: bool = False
    """Command more than the course's speed where the robot falls behind it, as quiet ones do, so
    that different betas walk equally fast; unless given, the command is the course's speed."""
    trials: int = 16
    """Robots that walk it, side by side; the first is drawn and kept."""
    nominal: bool = False
    """Let the exact model, which sees without noise, walk it as well."""
    seed: int = 1
    """Seed of the robots' physics, of initial states and of the noise."""
    out: Path = Path("evaluation")
    """Directory of the files that are written."""
    wav: Path | None = None
    """Keep the sound at the microphone in this .wav file."""
    video: Path | None = None
    """Film the walk, with that sound, to this .mp4 file."""


def walk(args: WalkArgs) -> None:
    """Walk a course, print its figures, and write them, the track and the map.

    Raises:
        MuteError: If an argument or the course is bad, or the policy cannot be used.
    """
    check_betas([args.beta])
    check_seed(args.seed)
    check_option("trials", args.trials, Range(1, _MOST_TRIALS, whole=True))
    check_wav(args.wav)
    check_video(args.video)
    args.check_sound(args.wav or args.video)
    check_matplotlib()
    args = args.with_driver_found()
    origin = args.origin()
    course, policy = load_course(args.course), args.audible_driver()
    make_directory(args.out)  # now: a walk is long, and must not be in vain
    torch.set_num_threads(1)
    keep = _kept_walk(args)
    walked = _walked(args, course, policy, keep, nominal=False)
    stopped = len(walked) < args.trials
    exact = [] if stopped or not args.nominal else _walked(args, course, policy, None, nominal=True)
    _report(args, course, walked, exact, {"iteration": policy.iteration} | origin, stopped)
    tell_kept([keep])
    if stopped:
        raise KeyboardInterrupt


def _walked(
    args: WalkArgs, course: Course, policy: Driver, keep: KeptWalks | None, nominal: bool
) -> list[Walk]:
    """Let robots walk side by side, or the exact one alone; return what came of those that ended.

    Args:
        args: What was asked for.
        course: Where they walk.
        policy: What walks.
        keep: What to keep of the first.
        nominal: Whether the exact model walks.
    """
    room = find_room(args.room)
    env = make_walk_env(policy, course, args.seed, 1 if nominal else args.trials, nominal)
    with progress_bar("walk, exact" if nominal else "walk", course.length) as advance:
        return follow_course(
            env,
            policy.controller(env.cfg),
            course,
            args.beta,
            args.seed,
            args.hold_speed,
            keep,
            advance,
            microphone=find_microphone(args.microphone),
            sources=args.sources,
            from_energies=room.has_walls,
            room=room,
        )


def _report(
    args: WalkArgs,
    course: Course,
    walked: Sequence[Walk],
    exact: Sequence[Walk],
    origin: Mapping[str, str | int],
    stopped: bool,
) -> None:
    """Print what came of the walks, and write it.

    Args:
        args: What was asked for.
        course: Where they walked.
        walked: Of robots as they are.
        exact: Of the exact model, if it walked.
        origin: What the levels rest on.
        stopped: Whether that was before all had walked.
    """
    print(_story(walked[0], course))
    over = _over_all(walked) | {"stopped": stopped}
    if len(walked) > 1:
        mnl, pnl = (
            with_interval(over[f"{name}_mean"], over[f"{name}_ci95"]) for name in ("mnl", "pnl")
        )
        warn_if_not_known_well(over["mnl_ci95"])
        print(f"{over['arrived']} of {len(walked)} arrived: MNL {mnl}, PNL {pnl} dBA, modelled")
    over["nominal"] = [one.figures() for one in exact]
    over["others"] = [one.figures() for one in walked[1:]]
    files = _write(args, course, walked[0], origin, over)
    print(f"written to {args.out}: {', '.join(files)}")


def _over_all(walked: Sequence[Walk]) -> dict[str, Any]:
    """Return the levels over the robots that arrived."""
    arrived = [one for one in walked if one.end == "arrived"]
    over: dict[str, Any] = {"trials": len(walked), "arrived": len(arrived)}
    for name in ("mnl", "pnl"):
        levels = [getattr(one, name) for one in arrived]
        heard = [level for level in levels if math.isfinite(level)]
        mean, deviation, half_width = mean_with_interval(heard)
        over |= {f"{name}_mean": mean, f"{name}_std": deviation, f"{name}_ci95": half_width}
    return over


def _kept_walk(args: WalkArgs) -> KeptWalks:
    wav = {0: args.wav} if args.wav else {}
    return KeptWalks(wav, {0: args.video} if args.video else {}, tell)


def _write(
    args: WalkArgs,
    course: Course,
    result: Walk,
    origin: Mapping[str, str | int],
    over: Mapping[str, Any],
) -> list[str]:
    """Write the figures, and the track and the map of the first robot; return the files."""
    about = {
        "course": place_of(args.course),
        **origin,
        "beta": args.beta,
        "course_speed": course.speed,
        "hold_speed": args.hold_speed,
        "seed": args.seed,
        "sources": args.sources,
        "microphone": args.microphone,
        "room": args.room,
    }
    write_json(args.out / "walk.json", about | result.figures() | dict(over))
    files = ["walk.json"]
    rows = result.track.rows()
    if len(rows) < 2:
        return files
    table = [dataclasses.asdict(floor) for floor in result.floors]
    whole = {"floor": "all", "mnl": result.mnl, "pnl": result.pnl}
    whole["seconds"] = sum(floor.seconds for floor in result.floors)
    title = f"levels in dBA, modelled; LAeq {result.laeq:.1f} dBA"
    print_table(title, [*table, whole], ["floor", "mnl", "pnl", "seconds"])
    write_csv(args.out / "track.csv", rows)
    from mute.evaluation.course.course_map import draw_map  # matplotlib takes a second

    maps = draw_map(course, result.track, args.out)
    return [*files, "track.csv", *(path.name for path in maps)]


_ENDS = {
    "fell": "fell",
    "unstable": "was stopped, as its simulation became unstable,",
    "time limit": "ran out of time",
}


def _story(result: Walk, course: Course) -> str:
    """Return in one line how far the robot came."""
    way = f"{result.progress:.1f} m of {result.path_length:.1f} m"
    if result.end == "arrived":
        start = f"arrived after {result.path_length:.1f} m"
    else:
        x, y = result.position
        floor = course.floor_names[int(course.floor_at(result.position))]
        did = _ENDS[result.end]
        start = (
            f"{did} after {way}, at ({x:.2f}, {y:.2f}) m on {floor}; the figures are of that part"
        )
    return (
        f"{start}: {result.distance:.1f} m in {result.seconds:.1f} s, {result.speed_mean:.3f} m/s, "
        f"at most {result.deviation_max:.2f} m off the path"
    )
