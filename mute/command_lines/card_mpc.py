"""The part of `docs/mpc.md` that tells how the model-predictive controller walks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mute.command_lines.card_tables import markdown
from mute.evaluation.paper_levels import PAPER_LEVELS
from mute.evaluation.reliability.figures import shown

__all__ = ["mpc_figures"]

_RELIABILITY = {
    "part": ("part", "{}"),
    "name": ("figure", "{}"),
    "value": ("value", "{}"),
    "target": ("target", "{}"),
}
_NOISE = {
    "surface": ("floor", "{}"),
    "mnl": ("MNL, dBA", "{}"),
    "paper_mnl": ("the paper's", "{:.1f}"),
    "pnl": ("PNL, dBA", "{}"),
    "paper_pnl": ("the paper's", "{:.1f}"),
    "speed_mean": ("m/s", "{:.2f}"),
    "landing_speed_mean": ("landings, m/s", "{:.2f}"),
    "fall_rate": ("falls", "{:.0%}"),
}
_SPEED = {
    "robots": ("robots", "{}"),
    "control step, median (ms)": ("control step, median, ms", "{:.1f}"),
    "control step, 95 % (ms)": ("95 %, ms", "{:.1f}"),
    "times real time, with physics": ("times real time, with physics", "{:.2f}"),
}


def mpc_figures(
    reliability: Mapping[str, Any],
    noise: Sequence[Mapping[str, Any]],
    speed: Mapping[str, Any],
) -> str:
    """Return the part.

    Args:
        reliability: What `evaluate.py reliability` wrote.
        noise: The rows that `evaluate.py noise` wrote.
        speed: What `benchmarks.mpc` wrote.
    """
    figures = [
        dict(each) | {"value": shown(each["value"], each["unit"])}
        for each in reliability["figures"]
        if "beta 0.5" not in each["name"] and "beta 1" not in each["name"]
    ]
    parts = ",".join(dict.fromkeys(each["part"] for each in reliability["figures"]))
    return "\n\n".join(
        (
            "## How it walks",
            f"`python evaluate.py reliability --controller mpc --robots {reliability['robots']} "
            f"--parts {parts} --out docs/mpc`, on {reliability['machine']}: robots that differ and "
            "see with noise. beta acts on nothing, so that its figures at other betas are left "
            "out.",
            markdown(figures, _RELIABILITY),
            "## How loud it is",
            f"`python evaluate.py noise --controller mpc --beta {noise[0]['beta']:g} "
            f"--trials {noise[0]['trials']} "
            "--out docs/mpc`: asked for 0.5 m/s, modelled levels with their 95 % intervals "
            "([sound](sound.md)), beside what the paper measured of the controller that a real Go1 "
            "ships with.",
            markdown([_levels(row) for row in noise], _NOISE),
            "## What it takes",
            f"`python -m benchmarks.mpc --out docs/mpc/speed.json`, on {speed['machine']}: "
            "robots side by side at 0.5 m/s.",
            markdown(speed["walks"], _SPEED),
        )
    )


def _levels(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return a row with its levels in words, and the paper's, None where it has none."""
    levels = {
        name: f"{row[f'{name}_mean']:.1f} ± {row[f'{name}_ci95']:.1f}" for name in ("mnl", "pnl")
    }
    mnl, pnl = PAPER_LEVELS["mpc"].get(row["surface"], (None, None))
    return dict(row) | levels | {"paper_mnl": mnl, "paper_pnl": pnl}
