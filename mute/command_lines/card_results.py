"""The page `docs/results.md`: how well the recipe walks, how quiet it is, and where it falls short.

A function a section; figures in sentences are computed from the files, like those in tables.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mute.command_lines.card_comparison import comparison_section
from mute.command_lines.card_reliability import reliability_section, unmet
from mute.command_lines.card_tables import (
    markdown,
    mean_and_spread,
    spread_of_trials,
    times,
    usual_rows,
)
from mute.command_lines.card_trainings import Recipe, ends, policy_figures, trainings_table
from mute.evaluation.matched_speed import level_at_speed
from mute.evaluation.paper_levels import PAPER_LEVELS

__all__ = ["ResultFiles", "results_page", "summary"]

_NOISE = {
    "surface": ("floor", "{}"),
    "beta": ("beta", "{:g}"),
    "mnl": ("MNL (dBA)", "{}"),
    "pnl": ("PNL (dBA)", "{}"),
    "paper": ("paper, real robot: MNL, PNL", "{}"),
    "speed_mean": ("actual speed (m/s)", "{:.2f}"),
    "velocity_error_sq": ("velocity error (m/s)²", "{:.3f}"),
    "landing_speed_rms": ("landing speed, RMS (m/s)", "{:.3f}"),
    "apex_cm": ("apex (cm)", "{:.1f}"),
    "stride_frequency": ("strides/s a foot", "{:.2f}"),
    "cost_of_transport": ("cost of transport", "{:.2f}"),
}
_SOURCES = {
    "surface": ("floor", "{}"),
    "beta": ("beta", "{:g}"),
    "laeq_impacts": ("floor, struck", "{:.1f}"),
    "laeq_body": ("shell, shaken by landings", "{:.1f}"),
    "laeq_drive": ("shell, shaken by drives", "{:.1f}"),
    "laeq_scuffing": ("scuffing", "{:.1f}"),
    "laeq_fan": ("fan", "{:.1f}"),
    "laeq_mean": ("all", "{:.1f}"),
}
_SUMMARY = {
    "beta": ("beta", "{:g}"),
    "falls": ("falls", "{}"),
    "error": ("velocity error (m/s)²", "{}"),
    "landing": ("landing speed at 0.5 m/s (m/s)", "{}"),
    "apex": ("feet lifted (cm)", "{}"),
    "level": ("level on wood (dBA)", "{}"),
}
_TASKS = {
    "name": ("task", "{}"),
    "trained": ("trained for", "{}"),
    "falls": ("falls", "{:.1%}"),
    "error": ("velocity error at beta 0, 1", "{}"),
    "landing": ("landing speed at beta 0, 1 (m/s)", "{}"),
    "apex": ("apex at beta 0, 1 (cm)", "{}"),
    "strides": ("strides/s a foot", "{}"),
}


@dataclass(frozen=True)
class ResultFiles:
    """What the files hold, as plain data."""

    ships: Recipe
    """The recipe of the policy that ships."""
    flat: Recipe | None
    """That of flat ground alone, where it is another."""
    paper_task: Mapping[str, Any]
    """Figures of the paper's own task, after a short training."""
    noise: Sequence[Mapping[str, Any]]
    sweep_speed: Sequence[Mapping[str, Any]]
    sweep_beta: Sequence[Mapping[str, Any]]
    walk: Mapping[str, Any]
    fitted: tuple[str, str]
    """The paper's row, and the floor, whose mean level the model of the sound is fitted to."""
    fitted_policy: Mapping[str, Any]
    """The policy that had that level in the fit: its task, beta and SHA-256."""
    calibration: str
    """SHA-256 of the file of that fit."""
    comparison: Mapping[str, Any] | None = None
    """What `evaluate.py paper` wrote, if it did."""
    comparison_folder: str = "paper"
    """Where that lies, as seen from the page."""

    @property
    def fitted_here(self) -> tuple[str, str] | None:
        """That row and floor, if the levels are of that policy."""
        same = self.fitted_policy["sha256"] == self.walk["policy_sha256"]
        return self.fitted if same else None


def results_page(files: ResultFiles) -> str:
    """Return the whole page."""
    sections = (
        _head(),
        f"## Over {len(files.ships.gaits)} trainings\n\n{summary(files)}",
        trainings_table(files.ships),
        f"## Whether one can rely on it\n\n{_reliability(files.ships)}",
        f"## The policy that ships\n\n{policy_figures(files.ships)}",
        _noise(files),
        *_beside_others(files),
        *_flat(files),
        _paper_task(files),
        _shortcomings(files),
    )
    return "\n\n".join(sections) + "\n"


def summary(files: ResultFiles) -> str:
    """Return the table that also stands on the front page, and what it is of."""
    runs = list(files.ships.gaits.values())
    robots = sum(run["trials"] for run in runs)
    levels = {row["beta"]: row for row in usual_rows(files.noise) if row["surface"] == "wood"}
    rows = []
    for index, row in enumerate(runs[0]["range"]):
        beta = row["beta"]
        fell = sum(round(run["range"][index]["fall_rate"] * run["trials"]) for run in runs)
        at_speed = [run["at_speed"][index] for run in runs]
        assert all(other["beta"] == beta for other in at_speed)
        errors = [run["range"][index]["velocity_error_sq"] for run in runs]
        rows.append(
            {
                "beta": beta,
                "falls": f"{fell} of {robots}",
                "error": mean_and_spread(errors, "{:.3f}"),
                "landing": mean_and_spread([r["landing_speed_mean"] for r in at_speed], "{:.2f}"),
                "apex": mean_and_spread([100.0 * r["apex_mean"] for r in at_speed], "{:.1f}"),
                "level": spread_of_trials(levels[beta], "mnl") if beta in levels else None,
            }
        )
    seeds = ", ".join(map(str, files.ships.gaits))
    loud, quiet = (PAPER_LEVELS[f"mute beta {beta}"]["wood"][0] for beta in (0, 1))
    return (
        f"{markdown(rows, _SUMMARY)}\n\n"
        f"Mean ± standard deviation over {len(runs)} trainings, seeds {seeds}, of "
        f"{files.ships.card['iterations']} iterations, on flat floors. Landing speed and lift are "
        "at an *actual* 0.5 m/s. The level is the policy's that ships, asked for 0.5 m/s, over "
        f"{levels[0.0]['trials']} trials: modelled; of the real robot the paper measured "
        f"{loud:.1f} dBA at beta 0 and {quiet:.1f} at beta 1. One figure of the model is fitted, "
        f"to a level on {files.fitted[1]}, {_by_whom(files)}."
    )


def _head() -> str:
    return (
        "<!-- Made by `python -m mute.card --out docs`; do not edit. -->\n\n"
        "# Results\n\n"
        "All of this is simulated, and was measured on flat floors; other ground has a "
        "[page of its own](terrain.md). Gaits are of the model as it is, without sensor "
        "noise, levels and reliability of robots that differ; "
        "every level is **modelled** ([sound.md](sound.md)). Nothing was measured on a real robot. "
        "This page is made by `python -m mute.card --out docs` from files that the commands "
        "named below wrote. Velocity errors are mean squares of what is missing to the commanded "
        "velocity, (m/s)²."
    )


def _reliability(recipe: Recipe) -> str:
    return reliability_section(recipe.seeds, recipe.training, recipe.folder)


def _flat(files: ResultFiles) -> list[str]:
    """Return the section on the recipe of flat ground, none if it is the one that ships."""
    recipe = files.flat
    if recipe is None:
        return []
    return [
        f"## On flat ground alone\n\n`{recipe.task}`, the recipe without ground, takes minutes. "
        f"It is what recipes were compared by; its policy is `--task {recipe.task}` for every "
        f"command.\n\n{trainings_table(recipe)}",
        _reliability(recipe),
        policy_figures(recipe),
    ]


def _beside_others(files: ResultFiles) -> list[str]:
    if files.comparison is None:
        return []
    return [comparison_section(files.comparison, files.comparison_folder)]


def _noise(files: ResultFiles) -> str:
    noise = usual_rows(files.noise)
    return (
        "## Noise\n\n"
        f"Modelled noise at the trunk, {noise[0]['command_speed']:g} m/s commanded, "
        f"{noise[0]['trials']} robots that differ and see with noise "
        "(`python evaluate.py noise --nominal --out docs/noise`):\n\n"
        f"{markdown([_noise_row(row) for row in noise], _NOISE)}\n\n"
        f"{_exact_robots(files.noise)}"
        "Equivalent level of each source there (dBA, modelled):\n\n"
        f"{markdown(noise, _SOURCES)}\n\n"
        "One figure of the model is fitted, to one mean level of the paper's, "
        f"{_by_whom(files)}. All else is predicted; how well, and from what, is in "
        "[sound.md](sound.md#predicted-and-measured). "
        "Listen: [beta 0 and beta 1 in turns of 3 s](noise/listen-wood.flac), on wood, asked for "
        "0.5 m/s.\n\n"
        "![Levels against actual speed](noise/sweep_speed.png)\n"
        "![Levels against beta](noise/sweep_beta.png)\n"
        "![The long walk](noise/course_map.png)\n\n"
        "They are drawn by `python evaluate.py sweep-speed`, `sweep-beta` and `walk --beta 0`, "
        "each with `--out docs/noise`."
    )


def _by_whom(files: ResultFiles) -> str:
    """Say whose walk the model of the sound is fitted with."""
    return f"with the policy of `{files.fitted_policy['task']}`"


def _exact_robots(noise: Sequence[Mapping[str, Any]]) -> str:
    """Return the table of the exact model, which sees without noise, where that was measured."""
    exact = [row for row in noise if row["robots"] == "nominal"]
    if not exact:
        return ""
    return (
        f"{exact[0]['trials']} twins of the exact model, which see without noise:\n\n"
        f"{markdown([_noise_row(row) for row in exact], _NOISE)}\n\n"
    )


def _paper_task(files: ResultFiles) -> str:
    recipe = files.flat or files.ships
    card, paper = recipe.card, files.paper_task
    loud, quiet = paper["at_speed"][0], paper["at_speed"][-1]
    slower = 1.0 - quiet["landing_speed_mean"] / loud["landing_speed_mean"]
    rows = [
        _task_row(
            f"`{recipe.task}`", f"all of its {card['steps'] / 1e6:.1f} M steps", card["figures"]
        ),
        _task_row("`go1_mute_paper`", "8.6 M of its 590 M steps", paper),
    ]
    return (
        "## The paper's own rewards\n\n"
        f"{markdown(rows, _TASKS)}\n\n"
        "The second is `python train.py --task go1_mute_paper --num-envs 1024 --iterations 350`, "
        "seed 0 (`docs/go1_mute_paper.json`). With the paper's exact reward the feet are lifted by "
        f"{1000.0 * loud['apex_mean']:.0f} mm at beta 0 and {1000.0 * quiet['apex_mean']:.0f} mm "
        f"at beta 1, which lands {abs(slower):.0%} {'slower' if slower >= 0.0 else 'faster'}. "
        f"Whether the steps that are missing change that is not known here. What `{recipe.task}` "
        "adds, and why, is in [method.md](method.md)."
    )


def _shortcomings(files: ResultFiles) -> str:
    noise = usual_rows(files.noise)
    quiet = next(row for row in noise if row["surface"] == "wood" and row["beta"] == 1.0)
    same_speed = _drops_at_speed(files.sweep_speed)
    same_command = _drops_at_command(files.sweep_speed)
    shares = {row["surface"]: _not_of_feet(row) for row in noise if row["beta"] == 1.0}
    least, most = min(shares, key=shares.__getitem__), max(shares, key=shares.__getitem__)
    recipes = [files.ships] if files.flat is None else [files.ships, files.flat]
    told = "".join(_missed(recipe) + _earlier_levels(recipe, files) for recipe in recipes)
    return (
        f"## Where it falls short\n\n{told}"
        "- At a high beta the robot walks slower than it is asked to: asked for 0.5 m/s on wood, "
        f"{quiet['speed_mean']:.2f}. So compare at equal actual speed.\n"
        "- The mean level on wood falls from beta 0 to beta 1 by "
        f"{_told_by_speed(same_speed)} (the paper: 3 to 5 dB), and by {_from_to(same_command)} dB "
        "at the same command. Part of it is the "
        "microphone, which moves with the trunk ([sound.md](sound.md)).\n"
        f"- At beta 1, {shares[least]:.0%} ({least}) to {shares[most]:.0%} ({most}) of the "
        "sound's power is not of feet that land but of drives, scuffing and the fan, of which "
        "little is published.\n"
        "- Levels, peaks and levels at other speeds are off by what "
        "[sound.md](sound.md#predicted-and-measured) says."
    )


def _missed(recipe: Recipe) -> str:
    """Say which targets which trainings do not meet."""
    missed = unmet(recipe.seeds)
    if not missed:
        return ""
    return f"- Not every training of `{recipe.task}` meets every target of reliability: {missed}.\n"


def _earlier_levels(recipe: Recipe, files: ResultFiles) -> str:
    """Say of which trainings the levels are of an earlier model of the sound."""
    earlier = [
        str(seed)
        for seed, run in recipe.seeds.items()
        if run.reliability.get("calibration_sha256") != files.calibration
    ]
    if not earlier:
        return ""
    return (
        f"- The two levels in the table of reliability of `{recipe.task}`, of a stand and of "
        "beta 1 beside beta 0, are "
        f"of an earlier model of the sound (seeds {', '.join(earlier)}), in which drives were "
        "quieter; all other levels on this page are of the present one, by which gears are heard "
        "in a stand, too, where noise of the sensors makes torques change their signs.\n"
    )


def _task_row(name: str, trained: str, figures: Mapping[str, Any]) -> dict[str, Any]:
    at_speed = figures["at_speed"]
    return {
        "name": name,
        "trained": trained,
        "falls": max(row["fall_rate"] for row in figures["range"]),
        "error": ends(figures["range"], "velocity_error_sq", "{:.3f}"),
        "landing": ends(at_speed, "landing_speed_mean", "{:.3f}"),
        "apex": ends(at_speed, "apex_mean", "{:.1f}", 100.0),
        "strides": ends(at_speed, "stride_frequency", "{:.1f}"),
    }


def _noise_row(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return a row of `evaluate.py noise` with its spreads, and the paper's levels, in words."""
    measured = PAPER_LEVELS.get(f"mute beta {row['beta']:g}", {}).get(row["surface"])
    return {
        **row,
        "mnl": spread_of_trials(row, "mnl"),
        "pnl": spread_of_trials(row, "pnl"),
        "paper": None if measured is None else f"{measured[0]:.1f}, {measured[1]:.1f}",
        "apex_cm": times(row["apex_mean"], 100.0),
    }


def _drops_at_speed(sweep: Sequence[Mapping[str, Any]]) -> dict[float, float]:
    """Return by how much the mean level falls from beta 0 to 1, dB, by actual speed, m/s.

    Between measured speeds; where one beta does not get as slow or as fast there is nothing to
    compare.
    """
    loud, quiet = (
        [(row["speed_mean"], row["mnl_mean"]) for row in usual_rows(sweep) if row["beta"] == beta]
        for beta in (0.0, 1.0)
    )
    drops = {
        speed: level_at_speed(loud, speed) - level_at_speed(quiet, speed)
        for speed in (0.4, 0.5, 0.6, 0.7, 0.8)
    }
    return {speed: drop for speed, drop in drops.items() if math.isfinite(drop)}


def _told_by_speed(drops: Mapping[float, float]) -> str:
    if not drops:
        return "an unknown amount at the same actual speed, which the two do not share"
    speeds = f"{min(drops):g} to {max(drops):g} m/s"
    return f"{_from_to(list(drops.values()))} dB at the same actual speed, {speeds}"


def _drops_at_command(sweep: Sequence[Mapping[str, Any]]) -> list[float]:
    """Return by how much the mean level falls from beta 0 to 1 at every command, dB."""
    loud, quiet = (
        {row["command_speed"]: row["mnl_mean"] for row in usual_rows(sweep) if row["beta"] == beta}
        for beta in (0.0, 1.0)
    )
    return [level - quiet[command] for command, level in loud.items()]


def _not_of_feet(row: Mapping[str, Any]) -> float:
    """Return the share of the sound's power that is not of landings."""
    feet = sum(10.0 ** (row[name] / 10.0) for name in ("laeq_impacts", "laeq_body"))
    return max(0.0, 1.0 - feet / 10.0 ** (row["laeq_mean"] / 10.0))


def _from_to(values: Sequence[float]) -> str:
    low, high = f"{min(values):.0f}", f"{max(values):.0f}"
    return low if low == high else f"{low} to {high}"
