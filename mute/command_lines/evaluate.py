"""`evaluate.py`: measure a policy; tables on the console, CSV and JSON beside."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from mute.command_lines.arguments import command_line, parse
from mute.command_lines.evaluate_gait import GaitArgs, ProgressArgs, gait, progress
from mute.command_lines.evaluate_noise import (
    NoiseArgs,
    SweepBetaArgs,
    SweepSpeedArgs,
    noise,
    sweep_beta,
    sweep_speed,
)
from mute.command_lines.evaluate_paper import PaperArgs, paper
from mute.command_lines.evaluate_reliability import ReliabilityArgs, reliability
from mute.command_lines.evaluate_terrain import TerrainArgs, terrain
from mute.command_lines.evaluate_walk import WalkArgs, walk
from mute.support.errors import MuteError

__all__ = ["main"]

_COMMANDS: dict[str, tuple[type, Callable[[Any], int | None], str]] = {
    "gait": (GaitArgs, gait, "walk over the command range, and at one actual speed"),
    "progress": (ProgressArgs, progress, "measure a run's checkpoints until one walks"),
    "noise": (NoiseArgs, noise, "modelled noise levels on several floors"),
    "sweep-speed": (SweepSpeedArgs, sweep_speed, "modelled noise levels against the actual speed"),
    "sweep-beta": (SweepBetaArgs, sweep_beta, "modelled noise levels against the quiet factor"),
    "walk": (WalkArgs, walk, "a long walk over mixed floors, with a map of the levels"),
    "terrain": (TerrainArgs, terrain, "every kind of ground and level, and what is known of it"),
    "paper": (PaperArgs, paper, "the paper's comparison with DreamWaQ and the MPC, and a report"),
    "reliability": (ReliabilityArgs, reliability, "starts, follows, stands, heeds beta, or not"),
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Raises:
        MuteError: If an argument is bad or the policy cannot be used.
    """
    argv = command_line() if argv is None else list(argv)
    if argv[:1] in (["-h"], ["--help"]):
        print(_usage())
        return 0
    if not argv or argv[0] not in _COMMANDS:
        given = argv[0] if argv else "nothing"
        raise MuteError(f"the first argument must be one of {', '.join(_COMMANDS)}, got {given}")
    args_type, run, _ = _COMMANDS[argv[0]]
    return run(parse(args_type, argv[1:], args_type.__doc__ or "")) or 0


def _usage() -> str:
    lines = [f"usage: evaluate.py {{{','.join(_COMMANDS)}}} [options]", ""]
    lines += [f"{name:13}{text}" for name, (_, _, text) in _COMMANDS.items()]
    lines += ["", "`evaluate.py gait --help` lists the options of gait, and so on."]
    return "\n".join(lines)
