"""The part of `docs/benchmark.md` that tells what the physics costs, and what that buys."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mute.command_lines.card_tables import cut_short, markdown

__all__ = ["physics_section"]

_COLUMNS = {
    "variant": ("one thing changed", "{}"),
    "speed": ("speed of the engine", "{}"),
    "landing_speed": ("landing speed", "{}"),
    "force_rms": ("contact force, RMS", "{}"),
    "peak_force": ("contact force, peaks", "{}"),
    "work": ("work", "{}"),
}
_FIGURES = ("landing_speed", "force_rms", "peak_force", "work")


def physics_section(measured: Mapping[str, Any]) -> str:
    """Return the section of what `python -m benchmarks.physics` wrote."""
    rows = [_cells(rate, measured["fidelity"]) for rate in measured["rates"]]
    return (
        "## What the physics costs\n\n"
        f"`python -m benchmarks.physics{measured['options']} --out docs/physics.json`: "
        f"{measured['num_envs']:,} "
        "randomised robots of `go1_mute_flat`'s policy, with exploration; the bare engine does "
        "their rollout again with one thing changed at a time, all in turns in one process "
        f"({measured['turns']} turns, {measured['machine']}, MuJoCo {measured['mujoco']}). Speed "
        "is that of control steps over the scene as it is, with its 95 % interval. The other "
        "columns tell how far a walk at 0.5 m/s without noise is from one with physics steps of "
        "0.5 ms, at beta 0 and at beta 1; a dash stands where a change leaves that walk as it "
        f"is.{cut_short(measured.get('stopped'))}\n\n"
        f"{markdown(rows, _COLUMNS)}\n\n"
        f"{_touching(measured['touching'])}"
    )


def _cells(rate: Mapping[str, Any], fidelity: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    cells: dict[str, Any] = {"variant": rate["variant"], "speed": _speed(rate)}
    walks = [row for row in fidelity if row["variant"] == rate["variant"]]
    for name in _FIGURES:
        cells[name] = ", ".join(f"{walk[name]:+.1%}" for walk in walks) or None
    return cells


def _speed(rate: Mapping[str, Any]) -> str:
    if rate["speed_low"] is None or rate["speed_low"] == rate["speed_high"]:
        return f"{rate['speed']:.2f}"
    return f"{rate['speed']:.2f} [{rate['speed_low']:.2f}, {rate['speed_high']:.2f}]"


def _touching(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return which shapes touch the ground, in a sentence for each of two kinds of robots."""
    told = {
        who: ", ".join(f"{row['shape']} {row[who]:.1%}" for row in rows)
        for who in ("policy", "beginning")
    }
    return (
        "Shapes of a kind touch the ground in this share of the robots and control steps: under "
        f"that policy {told['policy']}; under random actions, as a training begins, "
        f"{told['beginning']}."
    )
