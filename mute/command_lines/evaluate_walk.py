"""`evaluate.py walk`: the long walk over mixed floors, its levels and its map."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import torch

from mute.acoustics.gains import load_gains
from mute.acoustics.origin import sound_origin
from mute.command_lines.arguments import (
    check_betas,
    check_seed,
    check_video,
    check_wav,
    make_directory,
)
from mute.command_lines.sound_options import (
    SoundArgs,
    find_microphone,
    load_audible_policy,
    progress_bar,
    tell,
    tell_kept,
)
from mute.controllers import LearnedController
from mute.evaluation.course.course import Course, load_course
from mute.evaluation.course.long_walk import Walk, follow_course, make_walk_env
from mute.evaluation.plotting import check_matplotlib
from mute.evaluation.tables import print_table, write_csv, write_json
from mute.rendering.kept_walks import KeptWalks
from mute.support.provenance import REPOSITORY
from mute.support.resources import RESOURCES

__all__ = ["WalkArgs", "walk"]


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
    seed: int = 1
    """Seed of the initial state and of the noise."""
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
    args.check_sound()
    check_wav(args.wav)
    check_video(args.video)
    args = args.with_policy_found()
    check_matplotlib()
    microphone = find_microphone(args.microphone)
    course, policy = load_course(args.course), load_audible_policy(args.policy)
    gains = load_gains()
    make_directory(args.out)  # now: a walk is long, and must not be in vain
    torch.set_num_threads(1)
    origin = sound_origin(args.policy)
    env = make_walk_env(policy.cfg.env, course, args.seed)
    keep = _kept_walk(args)
    with progress_bar("walk", course.length) as advance:
        result = follow_course(
            env,
            LearnedController(policy, env.num_envs),
            course,
            args.beta,
            gains,
            args.seed,
            args.hold_speed,
            keep,
            advance,
            microphone=microphone,
            sources=args.sources,
        )
    print(_story(result, course))
    files = _write(args, course, result, {"iteration": policy.iteration} | origin)
    print(f"written to {args.out}: {', '.join(files)}")
    tell_kept([keep])


def _kept_walk(args: WalkArgs) -> KeptWalks:
    wav = {0: args.wav} if args.wav else {}
    return KeptWalks(wav, {0: args.video} if args.video else {}, tell)


def _write(
    args: WalkArgs, course: Course, result: Walk, origin: Mapping[str, str | int]
) -> list[str]:
    about = {
        "course": os.path.relpath(args.course, REPOSITORY),
        **origin,
        "beta": args.beta,
        "course_speed": course.speed,
        "hold_speed": args.hold_speed,
        "seed": args.seed,
        "sources": args.sources,
        "microphone": args.microphone,
    }
    write_json(args.out / "walk.json", about | result.figures())
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
