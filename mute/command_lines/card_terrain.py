"""The part of `docs/terrain.md` that tells how the policy gets over ground, and what it bears."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mute.command_lines.card_tables import markdown, times
from mute.support.errors import MuteError

__all__ = ["terrain_figures", "terrain_speed"]

_PARTS = ("crossings", "hardships", "pushes", "walk")
_CROSSINGS = {
    "kind": ("ground", "{}"),
    "level": ("level", "{}"),
    "speed": ("m/s", "{:g}"),
    "success": ("gets across", "{:.0%}"),
    "falls": ("falls", "{:.0%}"),
    "made": ("distance made", "{:.0%}"),
    "height_mm": ("height map, mm off", "{:.0f}"),
    "flat_mm": ("level at the feet", "{:.0f}"),
    "mean_mm": ("mean map", "{:.0f}"),
    "contact_ms": ("contact, ms off", "{:.0f}"),
    "clock_ms": ("clock", "{:.0f}"),
}
_IN_UNITS = {
    "height_mm": "height_rmse",
    "flat_mm": "height_rmse_flat",
    "mean_mm": "height_rmse_mean",
    "contact_ms": "contact_time_mae",
    "clock_ms": "contact_time_mae_clock",
}
_HARDSHIPS = {
    "hardship": ("hardship", "{}"),
    "survived": ("do not fall", "{:.1%}"),
    "made": ("distance made", "{:.0%}"),
}


def terrain_figures(measured: Mapping[str, Any]) -> str:
    """Return the part.

    Args:
        measured: What `evaluate.py terrain` wrote.

    Raises:
        MuteError: If it holds no crossings and hardships.
    """
    for name in ("crossings", "hardships"):
        if not measured.get(name):
            raise MuteError(f"what evaluate.py terrain wrote has no {name}")
    crossings: Sequence[Mapping[str, Any]] = measured["crossings"]
    parts = ",".join(name for name in _PARTS if measured.get(name))
    told = [
        f"`python evaluate.py terrain --episodes {crossings[0]['episodes']} --parts {parts} "
        f"--out docs/terrain`: "
        f"beta {measured['beta']:g}, {_speeds(crossings)} m/s, {crossings[0]['episodes']} robots "
        f"that differ in everything, {measured['seconds']:g} s, on {measured['machine']}:",
        markdown([dict(row) | _scaled(row) for row in crossings], _CROSSINGS),
        markdown(measured["hardships"], _HARDSHIPS),
    ]
    if measured.get("pushes"):
        [row] = measured["pushes"]
        told.append(
            f"The largest push before the fall is {row['largest']:.2f} ± {row['deviation']:.2f} "
            f"m/s over {row['robots']} robots, along any direction of space, each 0.05 m/s "
            "stronger than the one a second before (DreamWaQ's paper has 1.12 ± 0.16 m/s, of "
            "pushes whose strength it does not tell)."
        )
    if measured.get("walk"):
        [row] = measured["walk"]
        told.append(
            f"Of {row['robots']} robots, {row['survived']:.0%} walk at random commands for "
            f"{row['minutes']:g} minutes without a fall (DreamWaQ's: 95.2 ± 1.6 %), "
            f"{row['velocity_rmse']:.2f} m/s and {row['yaw_rate_rmse']:.2f} rad/s off (root mean "
            "square)."
        )
    return "\n\n".join(told)


_SPEED = {
    "ground": ("ground", "{}"),
    "steps_per_second": ("control steps of a robot, a second", "{:,.0f}"),
    "beside_flat": ("beside flat ground", "{}"),
    "map_share": ("of it, the height map", "{:.1%}"),
}


def terrain_speed(measured: Mapping[str, Any]) -> str:
    """Return the part on speed.

    Args:
        measured: What `benchmarks.terrain` wrote.
    """
    rows = [dict(row) | {"beside_flat": _beside(row)} for row in measured["rates"]]
    return "\n\n".join(
        (
            f"`python -m benchmarks.terrain{measured['options']} --out docs/terrain/speed.json`: "
            f"{measured['num_envs']} robots on {measured['machine']}, medians of "
            f"{measured['turns']} turns, with their 95 % interval. Steps of the environment alone, "
            "without the policy; robots on levels 0 to 4.",
            markdown(rows, _SPEED),
        )
    )


def _beside(row: Mapping[str, Any]) -> str:
    low, high = row["speed_low"], row["speed_high"]
    interval = "" if low is None or low == high else f" [{low:.0%}, {high:.0%}]"
    return f"{row['speed']:.0%}{interval}"


def _speeds(rows: Sequence[Mapping[str, Any]]) -> str:
    return ", ".join(f"{speed:g}" for speed in dict.fromkeys(row["speed"] for row in rows))


def _scaled(row: Mapping[str, Any]) -> dict[str, float | None]:
    return {name: times(row.get(of), 1e3) for name, of in _IN_UNITS.items()}
