"""The part of `docs/terrain.md` that tells how the policy gets over ground, and what it bears."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mute.command_lines.card_tables import markdown, mean_and_spread, times
from mute.evaluation.reliability.figures import shown
from mute.support.errors import MuteError

__all__ = ["terrain_figures", "terrain_speed"]

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
    "phase_mae": ("phase, off", "{:.2f}"),
    "phase_mae_clock": ("clock", "{:.2f}"),
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


_TARGETS = {
    "part": ("part", "{}"),
    "name": ("figure", "{}"),
    "values": ("by seed", "{}"),
    "mean": ("mean ± deviation", "{}"),
    "target": ("target", "{}"),
    "met": ("met by", "{}"),
}


def terrain_figures(measured: Mapping[str, Any], seeds: Sequence[Mapping[str, Any]] = ()) -> str:
    """Return the part.

    Args:
        measured: What `evaluate.py terrain` wrote of the policy that ships.
        seeds: The same of trainings with several seeds, that one among them.

    Raises:
        MuteError: If it holds no crossings and hardships.
    """
    for name in ("crossings", "hardships"):
        if not measured.get(name):
            raise MuteError(f"what evaluate.py terrain wrote has no {name}")
    crossings: Sequence[Mapping[str, Any]] = measured["crossings"]
    told = [
        f"`python evaluate.py terrain{measured['options']} --out docs/terrain`: beta "
        f"{measured['beta']:g}, {_speeds(crossings)} m/s, {crossings[0]['episodes']} robots "
        f"that differ in everything and that nobody pushes, {measured['seconds']:g} s, on "
        f"{measured['machine']}:",
        markdown([dict(row) | _scaled(row) for row in crossings], _CROSSINGS),
        _who_is_better(crossings),
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
    if measured.get("tracking"):
        rows = measured["tracking"]
        told.append(
            f"At random commands for {rows[0]['minutes']:g} minutes, {rows[0]['robots']} robots "
            f"with each of {len(rows)} seeds are "
            f"{mean_and_spread([row['velocity_rmse'] for row in rows], '{:.3f}')} m/s and "
            f"{mean_and_spread([row['yaw_rate_rmse'] for row in rows], '{:.3f}')} rad/s off (root "
            "mean square over axes, mean ± deviation over seeds)."
        )
    if measured.get("walk"):
        [row] = measured["walk"]
        told.append(
            f"Of {row['robots']} robots, {row['survived']:.0%} walk at random commands for "
            f"{row['minutes']:g} minutes without a fall (DreamWaQ's: 95.2 ± 1.6 %), "
            f"{row['velocity_rmse']:.2f} m/s and {row['yaw_rate_rmse']:.2f} rad/s off (root mean "
            "square)."
        )
    if seeds:
        told.append(_over_seeds(seeds))
    return "\n\n".join(told)


def _who_is_better(crossings: Sequence[Mapping[str, Any]]) -> str:
    """Say in how many rows the estimator is better than those that do not look."""
    rows = [row for row in crossings if "height_rmse" in row and "phase_mae" in row]

    def better(name: str, *others: str) -> int:
        return sum(all(row[name] < row[other] for other in others) for row in rows)

    return (
        f"Of these {len(rows)} rows, the estimator's height map is better than one that is level "
        f"at the feet in {better('height_rmse', 'height_rmse_flat')}, than the mean map in "
        f"{better('height_rmse', 'height_rmse_mean')}, and than both in "
        f"{better('height_rmse', 'height_rmse_flat', 'height_rmse_mean')}; its time until contact "
        "is better than the clock's in "
        f"{better('contact_time_mae', 'contact_time_mae_clock')}, its phase in "
        f"{better('phase_mae', 'phase_mae_clock')}."
    )


def _over_seeds(seeds: Sequence[Mapping[str, Any]]) -> str:
    """Return the table of targets over seeds."""
    by_name = [{(row["part"], row["name"]): row for row in each["figures"]} for each in seeds]
    rows = []
    for key, first in by_name[0].items():
        figures = [figures[key] for figures in by_name if key in figures]
        percent = 100.0 if first["unit"] == "share" else 1.0
        form = "{:.1f}" if first["unit"] == "share" else "{:.2f}"
        rows.append(
            {
                **first,
                "values": ", ".join(shown(row["value"], row["unit"]) for row in figures),
                "mean": mean_and_spread([percent * row["value"] for row in figures], form),
                "met": f"{sum(row['met'] for row in figures)} of {len(figures)}",
            }
        )
    names = ", ".join(str(each["trained_seed"]) for each in seeds)
    return f"By the seeds {names}, what is to be reached:\n\n{markdown(rows, _TARGETS)}"


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
            f"without the policy, with physics steps of {1e3 * measured['timestep']:g} ms; robots "
            "on levels 0 to 4.",
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
