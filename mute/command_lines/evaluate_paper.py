"""`evaluate.py paper`: every experiment of the paper in one go, resumed where it was stopped."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from mute.acoustics.origin import sound_origin
from mute.command_lines.arguments import (
    Words,
    check_betas,
    check_distinct,
    check_option,
    check_seed,
    check_words,
    make_directory,
)
from mute.command_lines.card_comparison import comparison_report
from mute.command_lines.evaluate_walk import WalkArgs
from mute.command_lines.paper_calibration import constant_in_use, dreamwaqs_constants
from mute.command_lines.paper_measurements import (
    kept_walk,
    measured_rows,
    tell_of_others,
    walked_folder,
)
from mute.command_lines.paper_walkers import find_walkers, place_of_other
from mute.command_lines.sound_options import tell
from mute.evaluation.comparison.measurements import DIRTY, FULL, QUICK, Extent, Kept, jobs
from mute.evaluation.comparison.walkers import Walker
from mute.evaluation.plotting import check_matplotlib
from mute.evaluation.tables import print_table, read_json, write_csv, write_json
from mute.support.errors import MuteError
from mute.support.files import write_file
from mute.support.plain_data import without_nan
from mute.support.provenance import place_of
from mute.support.ranges import Range
from mute.support.resources import RESOURCES, shipped_file
from mute.tasks import DEFAULT_TASK, DREAMWAQ_TASK

__all__ = ["PARTS", "PaperArgs", "paper"]

PARTS = ("calibration", "levels", "sweep", "walk")
"""What the comparison is made of."""

_COURSES = RESOURCES / "courses"


def _that_ship(task: str) -> tuple[Path, ...]:
    path = shipped_file(task)
    return (path,) if path.is_file() else ()


@dataclass
class PaperArgs:
    """Every experiment of the paper, in simulation, with a report.

    The constant that DreamWaQ would give, levels of all methods on wood, carpet and tile at several
    speeds, the quiet factor, and the long walk. What has been measured is kept, and read back where
    the command is run again.
    """

    mute: tuple[Path, ...] = _that_ship(DEFAULT_TASK)
    """MUTE's policies; several are trainings of one recipe."""
    dreamwaq: tuple[Path, ...] = _that_ship(DREAMWAQ_TASK)
    """DreamWaQ's; by default the one that ships, if one does."""
    others: tuple[str, ...] = ()
    """Further policies to compare, NAME=FILE, several of one name being trainings of one recipe; a
    FILE alone has the name of its task."""
    mpc: bool = True
    """Whether the model-predictive controller is compared."""
    parts: Words = PARTS
    """What to measure: calibration (the constant that DreamWaQ on wood would give), levels, sweep
    (of the quiet factor), walk."""
    beta: float = 0.5
    """Quiet factor of the long walk."""
    trials: int | None = None
    """Robots for each setting; the paper's 20 unless given, 2 with --quick."""
    anew: bool = False
    """Measure all again, whatever is kept."""
    quick: bool = False
    """As little of everything as shows that it works."""
    seed: int = 1
    """Seed of the robots, of initial states and of the noise."""
    out: Path = Path("evaluation/paper")
    """Directory of the report, the figures and the data."""

    @property
    def extent(self) -> Extent:
        """How much is measured."""
        return (QUICK if self.quick else FULL).with_trials(self.trials)


def paper(args: PaperArgs) -> None:
    """Measure what is not there yet, and write the report.

    Raises:
        MuteError: If an argument is bad, or a policy cannot be used.
    """
    _check(args)
    check_matplotlib()
    origin = sound_origin()
    walkers = find_walkers(args.mute, args.dreamwaq, args.others, args.mpc)
    make_directory(args.out / "measured")
    torch.set_num_threads(1)  # the physics engine has the cores
    if origin["commit"].endswith(DIRTY):
        tell("the working tree differs from its commit: what is measured now is not taken again")
    kept = Kept(args.out / "measured", origin)
    # A part alone leaves the others in the report, where they are measured already.
    fits = dreamwaqs_constants(
        walkers, args.extent, args.seed, kept, "calibration" in args.parts, args.anew
    )
    wanted = jobs(walkers, args.extent, PARTS)
    rows = measured_rows(wanted, args.parts, args.extent, args.seed, kept, args.anew)
    asked, walks = _walk(args), "walk" in args.parts
    walked = walked_folder(asked, origin, args.anew) if walks else kept_walk(asked, origin)
    found: dict[str, Any] = {
        "command": _command(args, _told(args, [*fits, *rows], walked)),
        "quick": args.quick,
        "trials": args.extent.trials,
        "seconds": args.extent.seconds,
        "seed": args.seed,
        **origin,
        "calibration": {"in_use": constant_in_use(), "fits": fits},
        "walkers": [_about(walker) for walker in walkers],
        "levels": [row for row in rows if row["part"] == "levels"],
        "sweep": [row for row in rows if row["part"] == "sweep"],
        "walk": None if walked is None else read_json(walked / "walk.json"),
    }
    tell_of_others(found)
    _report(args, without_nan(found), walked)


def _told(args: PaperArgs, rows: Sequence[Mapping[str, Any]], walked: Path | None) -> Words:
    """Return the parts that the report tells of."""
    known = {*args.parts, *(row["part"] for row in rows)} | ({"walk"} if walked else set())
    possible = tuple(part for part in PARTS if part != "calibration" or args.dreamwaq)
    told = tuple(part for part in possible if part in known)
    return PARTS if told == possible else told


def _walk(args: PaperArgs) -> WalkArgs:
    """Return the long walk: of the first of MUTE's policies."""
    return WalkArgs(
        policy=args.mute[0],
        course=_COURSES / ("short.yaml" if args.quick else "office.yaml"),
        beta=args.beta,
        trials=args.extent.walk_trials,
        seed=args.seed,
        out=args.out / "walks",
    )


def _check(args: PaperArgs) -> None:
    check_words("parts", args.parts, PARTS)
    check_betas([args.beta])
    check_seed(args.seed)
    if args.trials is not None:
        check_option("trials", args.trials, Range(1, 64, whole=True))
    for name in ("mute", "dreamwaq", "others"):
        paths = getattr(args, name)
        if paths:
            check_distinct(name, paths)
    if args.parts == ("calibration",) and not args.dreamwaq:
        raise MuteError("--parts calibration needs a policy of DreamWaQ's, --dreamwaq names none")
    if not args.mute:
        raise MuteError("--mute must name at least one policy, got none")


def _about(walker: Walker) -> dict[str, Any]:
    """Return what the report says of one thing that walks."""
    return {
        "method": walker.method,
        "policy": walker.name,
        "sha256": walker.sha256,
        "iteration": walker.driver.iteration,
        "training_seed": walker.training_seed,
    }


def _command(args: PaperArgs, parts: Words) -> str:
    """Return the command that measures these parts again, on whatever machine."""
    words = ["python", "evaluate.py", "paper"]
    default = PaperArgs()
    if args.mute != default.mute:
        words += ["--mute", *map(place_of, args.mute)]
    if args.dreamwaq != default.dreamwaq:
        words += ["--dreamwaq", *map(place_of, args.dreamwaq)]
    if args.others:
        words += ["--others", *map(place_of_other, args.others)]
    if parts != default.parts:
        words += ["--parts", *parts]
    for name in ("beta", "trials", "seed"):
        if getattr(args, name) != getattr(default, name):
            words += [f"--{name}", str(getattr(args, name))]
    words += ["--no-mpc"] * (not args.mpc) + ["--quick"] * args.quick
    return shlex.join(words)


def _report(args: PaperArgs, found: dict[str, Any], walked: Path | None) -> None:
    """Write the data first, then the figures and the report, and print the levels.

    Args:
        args: What was asked for.
        found: What was measured.
        walked: Folder of the long walk, if it was walked.
    """
    from mute.evaluation.comparison import figures  # matplotlib takes a second

    out, rows, sweep = args.out, found["levels"], found["sweep"]
    drawn: list[Path] = []
    if rows:
        write_csv(out / "levels.csv", rows)
        drawn += figures.draw_levels(rows, out)
    if any(row["mnl_mean"] is not None for row in sweep):
        write_csv(out / "sweep.csv", sweep)
        drawn += figures.draw_betas(sweep, out)
    found["figures"] = [path.stem for path in drawn if path.suffix == ".png"]
    if walked is not None and (walked / "course_map.png").is_file():
        found["figures"].append(f"{walked.relative_to(out).as_posix()}/course_map")
    write_json(out / "comparison.json", found)
    write_file(out / "comparison.md", comparison_report(found).encode())
    shown = ("label", "surface", "command_speed", "speed_mean", "mnl_mean", "mnl_std", "pnl_mean")
    if rows:
        print_table("levels in dBA, modelled", rows, shown)
    if not args.dreamwaq:
        tell("DreamWaQ is left out: no policy of it ships, and --dreamwaq names none")
    print(f"written to {out}: comparison.md, comparison.json")
