"""Write what was measured as pages in Markdown: python -m mute.card --out docs.

The pages hold no figure of their own: each comes from a file that another command wrote, and the
page names the command. What stands where is `card_results`' and `card_benchmark`'s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mute.acoustics.body import CALIBRATION_FILE
from mute.acoustics.soundscape import SOURCES
from mute.command_lines.arguments import command_line, make_directory, parse
from mute.command_lines.calibrate import REFERENCES
from mute.command_lines.card_benchmark import BenchmarkFiles, benchmark_page
from mute.command_lines.card_mpc import mpc_figures
from mute.command_lines.card_results import ResultFiles, results_page
from mute.command_lines.card_sound import predicted_and_measured
from mute.command_lines.card_tables import with_part
from mute.command_lines.card_terrain import terrain_figures, terrain_speed
from mute.command_lines.card_trainings import CARD, Recipe, read_recipe
from mute.evaluation.paper_levels import PAPER_LEVELS
from mute.evaluation.tables import read_json
from mute.support.errors import MuteError
from mute.support.files import write_file
from mute.support.provenance import REPOSITORY, file_sha256
from mute.support.resources import shipped_file
from mute.tasks import DEFAULT_TASK, FLAT_TASK

__all__ = ["CardArgs", "main", "read_benchmarks", "read_results"]

_DOCS = REPOSITORY / "docs"


@dataclass
class CardArgs:
    """Arguments of the card."""

    card: Path = shipped_file(DEFAULT_TASK, ".json")
    """Card of the policy, that `mute.release` wrote."""
    flat_card: Path = shipped_file(FLAT_TASK, ".json")
    """Card of the policy of flat ground alone, likewise."""
    noise: Path = _DOCS / "noise" / "noise.json"
    """File that `evaluate.py noise` wrote; those of the sweeps and of the walk lie beside it."""
    reliability: Path = _DOCS / "reliability"
    """Directory with one for each task, of what `evaluate.py reliability` wrote of several seeds,
    as seed0.json, seed1.json and so on, with what `evaluate.py progress` wrote of each as
    seed0_progress.json, and `evaluate.py gait` as seed0_gait.json."""
    terrain: Path = _DOCS / "terrain" / "terrain.json"
    """File that `evaluate.py terrain` wrote; speed.json of `benchmarks.terrain` lies beside it, and
    what the first wrote of several trainings, as seed0.json, seed1.json and so on."""
    mpc: Path = _DOCS / "mpc"
    """Directory of what `evaluate.py reliability` and `noise` wrote with --controller mpc, and
    speed.json of `benchmarks.mpc`."""
    comparison: Path = _DOCS / "paper" / "comparison.json"
    """File that `evaluate.py paper` wrote; without, the results tell of no other controller."""
    benchmark: Path = _DOCS / "benchmark.json"
    """File that `mute.benchmark --out` wrote; peers.json, peer_walks.json, physics.json and
    walking.json lie beside it."""
    out: Path | None = None
    """Directory of the pages results.md, sound.md, terrain.md, mpc.md and benchmark.md; printed if
    not given."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Raises:
        MuteError: If a file is missing, or a page cannot be written.
    """
    argv = command_line() if argv is None else list(argv)
    args = parse(CardArgs, argv, "Write what was measured as pages in Markdown.")
    results = read_results(args)
    pages = {
        "results.md": results_page(results),
        "sound.md": with_part(
            _page("sound.md"),
            "levels",
            predicted_and_measured(
                results.noise, results.sweep_beta, results.walk, results.fitted_here
            ),
        ),
        "terrain.md": _terrain_page(args.terrain),
        "mpc.md": _mpc_page(args.mpc),
        "benchmark.md": benchmark_page(read_benchmarks(args)),
    }
    if args.out is None:
        print("\n".join(pages.values()), end="")
        return 0
    make_directory(args.out)
    for name, page in pages.items():
        write_file(args.out / name, page.encode())
    print(f"written to {args.out}: {', '.join(pages)}")
    return 0


def _terrain_page(path: Path) -> str:
    """Return the page on ground, of which two parts are made.

    Raises:
        MuteError: If a file is missing.
    """
    seeds = [_read(each, "figures", "trained_seed") for each in path.parent.glob("seed*.json")]
    seeds.sort(key=lambda each: each["trained_seed"])
    page = with_part(_page("terrain.md"), "figures", terrain_figures(_read(path, "options"), seeds))
    speed = _read(path.parent / "speed.json", *_SPEED)
    return with_part(page, "speed", terrain_speed(speed))


def _mpc_page(directory: Path) -> str:
    """Return the page on the model-predictive controller, of which one part is made.

    Raises:
        MuteError: If a file is missing.
    """
    reliability = _read(directory / "reliability.json", "figures", "robots", "machine")
    noise = _read_rows(directory / "noise.json", *_LEVELS)
    speed = _read(directory / "speed.json", "walks", "machine")
    return with_part(_page("mpc.md"), "figures", mpc_figures(reliability, noise, speed))


def read_results(args: CardArgs) -> ResultFiles:
    """Read the files that the results are in.

    Raises:
        MuteError: If one is missing, or not what the command wrote.
    """
    beside = args.noise.parent
    flat = (args.reliability / FLAT_TASK).is_dir()
    compared = args.comparison.is_file() or args.comparison != CardArgs.comparison
    return ResultFiles(
        ships=_recipe(DEFAULT_TASK, args.card, args.reliability),
        flat=_recipe(FLAT_TASK, args.flat_card, args.reliability) if flat else None,
        paper_task=_read(_DOCS / "go1_mute_paper.json"),
        noise=_read_rows(args.noise, *_LEVELS, *(f"laeq_{name}" for name in SOURCES)),
        sweep_speed=_read_rows(beside / "sweep_speed.json", *_LEVELS),
        sweep_beta=_read_rows(beside / "sweep_beta.json", *_LEVELS),
        walk=_read(beside / "walk.json", *_WALK),
        fitted=_fitted_row(),
        fitted_policy=_read(CALIBRATION_FILE, "policy")["policy"],
        calibration=file_sha256(CALIBRATION_FILE),
        comparison=_read(args.comparison, *_COMPARED) if compared else None,
        comparison_folder=args.comparison.parent.name,
    )


def _recipe(task: str, card: Path, folder: Path) -> Recipe:
    return read_recipe(task, _read(card, *CARD), folder / task)


_COMPARED = ("command", "walkers", "levels", "sweep", "walk", "calibration", "figures")
"""What the page of results tells of other controllers."""
_SPEED = ("rates", "options", "num_envs", "turns", "timestep", "machine")
"""What the page on ground tells of speed."""
_LEVELS = ("robots", "surface", "beta", "mnl_mean", "mnl_ci95", "pnl_mean", "pnl_ci95")
_WALK = ("policy_sha256", "beta", "arrived", "mnl_mean", "mnl_ci95", "pnl_mean", "pnl_ci95")
"""What the pages tell of levels."""


def _page(name: str) -> str:
    """Return a page that one part of is made here.

    Raises:
        MuteError: If it is not there.
    """
    path = _DOCS / name
    if not path.is_file():
        raise MuteError(f"no file at {path}")
    return path.read_text()


def _fitted_row() -> tuple[str, str]:
    """Return the row of the paper that the calibration is of, and the floor.

    Raises:
        MuteError: If the calibration does not say.
    """
    calibration = _read(CALIBRATION_FILE, "reference", "floor")
    reference = calibration["reference"]
    if reference not in REFERENCES:
        raise MuteError(f"{CALIBRATION_FILE}: reference must be of {', '.join(REFERENCES)}")
    floors = PAPER_LEVELS[REFERENCES[reference]]
    if calibration["floor"] not in floors:
        raise MuteError(f"{CALIBRATION_FILE}: floor must be of {', '.join(floors)}")
    return REFERENCES[reference], calibration["floor"]


def read_benchmarks(args: CardArgs) -> BenchmarkFiles:
    """Read the files that the benchmarks are in.

    Raises:
        MuteError: If one is missing.
    """
    docs = args.benchmark.parent
    return BenchmarkFiles(
        training=_read(args.benchmark),
        peers=_read(docs / "peers.json"),
        sound=_read(args.noise.parent / "benchmark.json"),
        physics=_read(docs / "physics.json"),
        walking=_read(docs / "walking.json"),
        peer_walks=_read(docs / "peer_walks.json"),
    )


def _read_rows(path: Path, *keys: str) -> Any:  # noqa: ANN401
    """Return the rows of a table, each with these keys.

    Raises:
        MuteError: If the file is missing, or no such table.
    """
    rows = _read(path)
    if not isinstance(rows, list) or not rows or not all(isinstance(row, dict) for row in rows):
        raise MuteError(f"{path} is no table that `evaluate.py` wrote")
    for key in keys:
        if any(key not in row for row in rows):
            raise MuteError(f"{path} lacks '{key}'; measure it anew")
    return rows


def _read(path: Path, *keys: str) -> Any:  # noqa: ANN401
    if not path.is_file():
        raise MuteError(f"no file at {path}")
    content = read_json(path)
    missing = [key for key in keys if not isinstance(content, dict) or key not in content]
    if missing:
        raise MuteError(f"{path} lacks '{missing[0]}'")
    return content
