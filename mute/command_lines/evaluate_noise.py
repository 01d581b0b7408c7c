"""`evaluate.py noise`, `sweep-speed` and `sweep-beta`: modelled noise levels of a policy."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import torch
import tyro

from mute.acoustics.floors import FLOORS
from mute.command_lines.arguments import (
    Numbers,
    Words,
    check_betas,
    check_distinct,
    check_option,
    check_seed,
    check_trials,
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
from mute.evaluation.noise_levels import SETTLE_TIME, NoiseRow, NoiseSetting, measure_noise
from mute.evaluation.plotting import check_matplotlib
from mute.evaluation.tables import print_table, write_csv, write_json
from mute.rendering.kept_walks import KeptWalks
from mute.support.errors import MuteError
from mute.support.ranges import Range

__all__ = ["NoiseArgs", "SweepBetaArgs", "SweepSpeedArgs", "noise", "sweep_beta", "sweep_speed"]

_SPEEDS = tuple(round(0.1 * tenth, 1) for tenth in range(4, 11))
_BETAS = tuple(round(0.1 * tenth, 1) for tenth in range(11))
_MAX_ROBOTS = 1024
_MAX_FILMS = 32
"""Most films that are made side by side: each has a renderer and an encoder of its own, which take
some 0.25 GB where the processor renders."""

_FilmFile = Annotated[
    Path | None,
    tyro.conf.arg(
        help="Film first trials, with that sound, to FILE.mp4, or to files named likewise."
    ),
]

_Draw = Callable[[Sequence[NoiseRow], Path], list[Path]]


@dataclass
class _CommonArgs(SoundArgs):
    trials: int = 32
    """Robots for each setting, side by side."""
    nominal: bool = False
    """Measure as many twins of the exact model, which see without noise, as well."""
    seconds: float = 10.0
    """Measured length of a trial, s."""
    seed: int = 1
    """Seed of initial states and of the noise."""
    out: Path = Path("evaluation")
    """Directory of the files that are written."""


@dataclass
class NoiseArgs(_CommonArgs):
    """Noise levels on several floors at one commanded speed: the paper's protocol, modelled."""

    surface: Words = ("wood", "carpet", "tile")
    """Floors: wood, parquet, laminate, carpet, tile, concrete."""
    beta: Numbers = (0.0, 1.0)
    """Quiet factors."""
    speed: float = 0.5
    """Commanded forward speed, m/s."""
    wav: Path | None = None
    """Keep the sound of first trials: in FILE.wav where there is one floor and one beta, else in
    FILE-<surface>-beta<beta>.wav."""
    video: _FilmFile = None


@dataclass
class SweepSpeedArgs(_CommonArgs):
    """Noise levels against the actual speed, as figures and data."""

    surface: str = "wood"
    """Floor: wood, parquet, laminate, carpet, tile or concrete."""
    beta: Numbers = (0.0, 1.0)
    """Quiet factors."""
    speed: Numbers = _SPEEDS
    """Commanded forward speeds, m/s."""
    wav: Path | None = None
    """Keep the sound of first trials: in FILE.wav where there is one speed and one beta, else in
    FILE-speed<speed>-beta<beta>.wav."""
    video: _FilmFile = None


@dataclass
class SweepBetaArgs(_CommonArgs):
    """Noise levels and the squared tracking error against beta, as figures and data."""

    surface: str = "wood"
    """Floor: wood, parquet, laminate, carpet, tile or concrete."""
    beta: Numbers = _BETAS
    """Quiet factors."""
    speed: float = 0.8
    """Commanded forward speed, m/s."""
    wav: Path | None = None
    """Keep the sound of first trials: in FILE.wav where there is one beta, else in
    FILE-speed<speed>-beta<beta>.wav."""
    video: _FilmFile = None


def noise(args: NoiseArgs) -> None:
    """Measure on each floor in turn.

    Raises:
        MuteError: If an argument is bad, or the policy cannot be used.
    """
    labels = [[f"{name}-beta{beta:g}" for beta in args.beta] for name in args.surface]
    _run("noise", args, args.surface, (args.speed,), labels)


def sweep_speed(args: SweepSpeedArgs) -> None:
    """Measure all speeds and betas in one batch and draw them.

    Raises:
        MuteError: If an argument is bad, or the policy cannot be used.
    """
    check_matplotlib()
    from mute.evaluation.noise_figures import draw_speed_sweep  # matplotlib takes a second

    labels = [[f"speed{speed:g}-beta{beta:g}" for beta in args.beta for speed in args.speed]]
    _run("sweep_speed", args, (args.surface,), args.speed, labels, draw_speed_sweep)


def sweep_beta(args: SweepBetaArgs) -> None:
    """Measure all betas in one batch and draw them.

    Raises:
        MuteError: If an argument is bad, or the policy cannot be used.
    """
    check_matplotlib()
    from mute.evaluation.noise_figures import draw_beta_sweep

    labels = [[f"speed{args.speed:g}-beta{beta:g}" for beta in args.beta]]
    _run("sweep_beta", args, (args.surface,), (args.speed,), labels, draw_beta_sweep)


def _run(
    name: str,
    args: NoiseArgs | SweepSpeedArgs | SweepBetaArgs,
    surfaces: Sequence[str],
    speeds: Sequence[float],
    labels: Sequence[Sequence[str]],
    draw: _Draw | None = None,
) -> None:
    """Check the arguments, measure every setting on every floor, and report.

    Args:
        name: Of the files.
        args: What was asked for.
        surfaces: Names of the floors.
        speeds: Commanded speeds, m/s.
        labels: For each floor, what tells the sounds of its settings apart; betas come first.
        draw: Makes the figures.
    """
    _check(args, surfaces, args.beta, speeds)
    check_wav(args.wav)
    check_video(args.video)
    args.check_sound(args.wav or args.video)
    _check_films(args.video, len(args.beta) * len(speeds))
    settings = [NoiseSetting(beta, speed) for beta in args.beta for speed in speeds]
    kept = [
        KeptWalks(wav, video, tell)
        for wav, video in zip(_files(args.wav, labels), _files(args.video, labels), strict=True)
    ]
    args = args.with_driver_found()
    origin = args.origin()
    rows: list[NoiseRow] = []
    try:
        _measure(name, args, surfaces, settings, kept, rows)
    except KeyboardInterrupt:
        if rows:  # of the floors that are done
            _report(name, args, rows, origin | {"stopped": True}, None)
        raise
    _report(name, args, rows, origin | {"stopped": False}, draw)
    tell_kept(kept)


def _measure(
    name: str,
    args: _CommonArgs,
    surfaces: Sequence[str],
    settings: Sequence[NoiseSetting],
    kept: Sequence[KeptWalks],
    rows: list[NoiseRow],
) -> None:
    """Measure every setting on every floor.

    Args:
        name: What is measured.
        args: Its arguments.
        surfaces: Names of the floors.
        settings: What is asked for on each.
        kept: For each floor what to keep of settings, by their index.
        rows: Is given the rows of each floor.
    """
    policy = args.audible_driver()
    microphone, room = find_microphone(args.microphone), find_room(args.room)
    make_directory(args.out)
    torch.set_num_threads(1)  # the physics engine has the cores
    steps = round((args.seconds + SETTLE_TIME) / policy.cfg.env.step_dt)
    who = (False, True) if args.nominal else (False,)
    done = itertools.count(1)
    with progress_bar(name, len(who) * len(surfaces) * steps) as advance:
        for (surface, keep), nominal in itertools.product(zip(surfaces, kept, strict=True), who):
            rows += measure_noise(
                policy,
                surface,
                settings,
                args.trials,
                args.seconds,
                args.seed,
                KeptWalks() if nominal else keep,
                on_step=lambda: advance(next(done)),
                microphone=microphone,
                sources=args.sources,
                from_energies=room.has_walls,
                nominal=nominal,
                room=room,
            )


def _files(path: Path | None, labels: Sequence[Sequence[str]]) -> list[dict[int, Path]]:
    """Return the files for each floor's settings, by their index.

    Args:
        path: What was asked for.
        labels: For each floor, what tells the files of its settings apart.
    """
    if path is None:
        return [{} for _ in labels]
    if sum(map(len, labels)) == 1:
        return [{0: path}]
    return [
        {
            index: path.with_name(f"{path.stem}-{label}{path.suffix}")
            for index, label in enumerate(own)
        }
        for own in labels
    ]


def _report(
    name: str,
    args: _CommonArgs,
    rows: Sequence[NoiseRow],
    origin: Mapping[str, Any],
    draw: _Draw | None = None,
) -> None:
    """Print and write the rows, then draw them, so that no figure can cost the data."""
    table = [dataclasses.asdict(row) for row in rows]
    title = f"{args.trials} trials of {args.seconds:g} s; levels in dBA, modelled"
    shown = [_shown(row) for row in rows]
    print_table(title, shown, list(shown[0]))
    write_csv(args.out / f"{name}.csv", table)
    write_json(args.out / f"{name}.json", table)
    about = {
        **origin,
        "seconds": args.seconds,
        "seed": args.seed,
        "sources": args.sources,
        "microphone": args.microphone,
        "room": args.room,
    }
    write_json(args.out / f"{name}_about.json", about)
    usual = [row for row in rows if row.robots == "different"]
    warn_if_not_known_well(*(row.mnl_ci95 for row in usual))
    figures = draw(usual, args.out) if draw else []
    data = [f"{name}.json", f"{name}.csv", f"{name}_about.json"]
    names = [*data, *(path.name for path in figures)]
    print(f"written to {args.out}: {', '.join(names)}")


def _shown(row: NoiseRow) -> dict[str, str]:
    """Return a row as a terminal of 100 columns can show it; the files have every figure."""
    return {
        "floor": row.surface + ("" if row.robots == "different" else ", exact"),
        "beta": f"{row.beta:g}",
        "MNL": _with_spread(row.mnl_mean, row.mnl_std),
        "PNL": _with_spread(row.pnl_mean, row.pnl_std),
        "m/s,asked": f"{row.speed_mean:.2f},{row.command_speed:.2f}",
        "err²": f"{row.velocity_error_sq:.3f}",
        "land": f"{row.landing_speed_rms:.2f}",
        "duty": f"{row.duty_factor:.2f}",
        "Hz": f"{row.stride_frequency:.2f}",
        "W": f"{row.power:.0f}",
        "CoT": f"{row.cost_of_transport:.2f}",
        "fell": f"{row.fall_rate:.0%}",
    }


def _with_spread(mean: float, deviation: float) -> str:
    """Return a level and its standard deviation over robots, which a single one does not have."""
    return f"{mean:.1f}" if math.isnan(deviation) else f"{mean:.1f}±{deviation:.1f}"


def _check(
    args: _CommonArgs, surfaces: Sequence[str], betas: Sequence[float], speeds: Sequence[float]
) -> None:
    """Check what all three have.

    Raises:
        MuteError: If a value is out of its range, or a list empty or with repetitions.
    """
    check_trials(args.trials, args.seconds)
    check_seed(args.seed)
    check_betas(betas)
    for option, values in (("surface", surfaces), ("beta", betas), ("speed", speeds)):
        check_distinct(option, values)
    for surface in surfaces:
        if surface not in FLOORS:
            raise MuteError(f"--surface must be of {', '.join(FLOORS)}, got {surface!r}")
    for speed in speeds:
        check_option("speed", speed, Range(0.0, 2.0, above=True))
    settings = len(betas) * len(speeds)
    if settings * args.trials > _MAX_ROBOTS:
        raise MuteError(
            f"--trials {args.trials} with {settings} settings is {settings * args.trials} robots; "
            f"at most {_MAX_ROBOTS} fit side by side"
        )


def _check_films(video: Path | None, settings: int) -> None:
    """Check how many films are asked for.

    Raises:
        MuteError: If there are too many.
    """
    if video is not None and settings > _MAX_FILMS:
        raise MuteError(
            f"--video with {settings} settings is {settings} films; at most {_MAX_FILMS} are made "
            "side by side"
        )
