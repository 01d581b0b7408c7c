"""The comparison of methods as a report in Markdown; it holds no figure of its own."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from mute.acoustics.soundscape import SOURCES
from mute.command_lines.card_tables import markdown
from mute.evaluation.comparison.conclusions import (
    EQUAL_SPEED,
    MOST_FALLS,
    equal_speed_level,
    labels,
    level,
    papers_level,
    source_level,
    walked,
)
from mute.evaluation.comparison.measurements import FLOORS_COMPARED, MADE_WITH
from mute.evaluation.comparison.verdicts import verdicts
from mute.evaluation.paper_levels import PAPER_WALK

__all__ = ["comparison_report", "comparison_section", "measured_before"]

Row = Mapping[str, Any]


def comparison_report(found: Mapping[str, Any]) -> str:
    """Return the report of what `evaluate.py paper` measured; the same input, the same text.

    Args:
        found: What the command wrote to `comparison.json`.
    """
    rows, sweep, walk = found["levels"], found["sweep"], found["walk"]
    parts = [_head(found), _walkers_table(found["walkers"])]
    fitted = _fitted_cell(found)
    parts += ["## The constant", _constant_text(found["calibration"], fitted)]
    told = verdicts(rows, sweep, walk, fitted)
    if told:
        parts += ["## What the paper found, here", _verdicts_table(told)]
    if rows:
        parts += ["## Levels at 0.5 m/s", _levels_text(found), _levels_table(rows, fitted)]
        parts += ["## Where the noise comes from", _sources_table(rows)]
    if sweep:
        parts += ["## The quiet factor", _sweep_table(sweep)]
    if walk is not None:
        parts += ["## The long walk", _walk_text(walk)]
    figures = [f"![{name}]({name}.png)" for name in found["figures"]]
    return "\n\n".join([*parts, *figures]) + "\n"


def comparison_section(found: Mapping[str, Any], folder: str) -> str:
    """Return what the results page tells of the report: its verdicts and its levels.

    Args:
        found: What the command wrote to `comparison.json`.
        folder: Where that file and the report lie, as seen from the page.
    """
    fitted, rows = _fitted_cell(found), found["levels"]
    told = verdicts(rows, found["sweep"], found["walk"], fitted)
    methods = ", ".join(
        f"{method} ({count} training{'s' * (count > 1)})"
        for method, count in Counter(row["method"] for row in found["walkers"]).items()
    )
    figures = "\n".join(f"![{name}]({folder}/{name}.png)" for name in found["figures"])
    return (
        f"## Beside other controllers\n\n{methods}, on the same robot: what the paper found, and "
        f"whether it comes out here. `{found['command']}` measured it, and wrote the "
        f"[whole report]({folder}/comparison.md).\n\n{_verdicts_table(told)}\n\n"
        f"{_levels_text(found)}\n\n{_levels_table(rows, fitted)}\n\n{figures}"
    )


def _head(found: Mapping[str, Any]) -> str:
    quick = (
        " **Measured with `--quick`: it shows that all works, its figures mean nothing.**"
        if found["quick"]
        else ""
    )
    return (
        f"<!-- Made by `{found['command']}`; do not edit. -->\n\n"
        "# The comparison, in simulation\n\n"
        "Every level is modelled and dBA at the trunk; nothing was measured on a real robot."
        f"{quick} {found['trials']} robots a setting, {found['seconds']:g} s each, seed "
        f"{found['seed']}; they differ and see with noise. Commit {found['commit']}, calibration "
        f"{found['calibration_sha256'][:12]}, on {found['machine']}.{_before(found)}"
    )


def _before(found: Mapping[str, Any]) -> str:
    others = measured_before(found)
    return f" Measured before: {'; '.join(others)}." if others else ""


def measured_before(found: Mapping[str, Any]) -> list[str]:
    """Return what was measured with another commit or machine than the rest, a line for each."""
    now = _made_with(found)
    rows = (*found["calibration"]["fits"], *found["levels"], *found["sweep"])
    counts = Counter(at for at in map(_made_with, rows) if at != now)
    told = [
        f"{count} setting{'s' * (count > 1)} at commit {commit} on {machine}"
        for (commit, machine), count in counts.items()
    ]
    walk = found["walk"]
    if walk is not None and _made_with(walk) != now:
        told.append(f"the long walk at commit {walk['commit']} on {walk['machine']}")
    return told


def _made_with(row: Row) -> tuple[str, ...]:
    return tuple(row[name] for name in MADE_WITH)


def _walkers_table(walkers: Sequence[Row]) -> str:
    columns = {
        "method": ("method", "{}"),
        "policy": ("policy", "{}"),
        "iteration": ("last iteration", "{}"),
        "training_seed": ("seed", "{}"),
        "digest": ("SHA-256", "{}"),
    }
    return markdown([dict(row) | {"digest": row["sha256"][:12]} for row in walkers], columns)


def _fitted_cell(found: Mapping[str, Any]) -> tuple[str, str] | None:
    """Return the label and the floor whose level is fitted.

    None if the calibration tells none, or is of a policy that is not compared here.
    """
    used = found["calibration"]["in_use"]
    known = used["label"] is not None and used["floor"] is not None
    compared = {None, *(row["sha256"] for row in found["walkers"])}
    return (used["label"], used["floor"]) if known and used["policy_sha256"] in compared else None


def _constant_text(calibration: Mapping[str, Any], fitted: tuple[str, str] | None) -> str:
    used, fits = calibration["in_use"], calibration["fits"]
    share = used["transmissibility"]
    text = (
        f"Of a force at a foot, the share {share:.4f} comes to the robot's shell: "
        f"{_fitted_to(used, fitted)}"
    )
    if not fits:
        return text
    shown = [fit | {"beside": _decibels(fit, share), "ci": fit["mnl_ci95"]} for fit in fits]
    columns = {
        "policy": ("policy", "{}"),
        "training_seed": ("seed", "{}"),
        "transmissibility": ("share", "{:.4f}"),
        "beside": ("beside that in use (dB)", "{:+.1f}"),
        "ci": ("MNL known within (dB)", "± {:.1f}"),
        "reason": ("why there is none", "{}"),
    }
    return (
        f"{text}\n\nThis share would give {fits[0]['label']} the paper's MNL on wood; nothing here "
        f"uses it.\n\n{markdown(shown, columns)}"
    )


def _fitted_to(used: Mapping[str, Any], fitted: tuple[str, str] | None) -> str:
    """Return in words what the constant is fitted to, and what that leaves to be predicted."""
    if used["label"] is None or used["floor"] is None:
        return "what it is fitted to, its file does not say."
    digest = used["policy_sha256"]
    policy = "" if digest is None else f" with the policy of SHA-256 {digest[:12]}"
    left = (
        "No such policy is compared here: every level is predicted."
        if fitted is None
        else "That level is marked in the table, and counts nowhere as predicted; all else is."
    )
    return (
        f"fitted such that {used['label']} has the paper's MNL on {used['floor']} at "
        f"{EQUAL_SPEED:g} m/s{policy}. {left}"
    )


def _decibels(fit: Row, share: float) -> float | None:
    if fit["transmissibility"] is None or share <= 0.0:
        return None
    return 20.0 * math.log10(fit["transmissibility"] / share)


def _verdicts_table(told: Sequence[Any]) -> str:
    columns = {"claim": ("claim", "{}"), "figure": ("here", "{}"), "holds": ("holds", "{}")}
    rows = [
        {"claim": one.claim, "figure": one.figure, "holds": "yes" if one.holds else "**no**"}
        for one in told
    ]
    return markdown(rows, columns)


def _levels_text(found: Mapping[str, Any]) -> str:
    several = any(len(one.trainings) > 1 for one in _table_levels(found["levels"]))
    over = (
        " Of several trainings it is the mean, and their smallest and largest are in brackets."
        if several
        else ""
    )
    return (
        "MNL and PNL, asked for 0.5 m/s, with the standard deviation over robots; the paper's; and "
        f"the difference.{over} Then the MNL at an *actual* {EQUAL_SPEED:g} m/s, between what came "
        "out of other commands; the actual speed at this one; the robots that a level is of, which "
        "leaves out those that kept falling; and how many fell, in bold where these are more than "
        f"{100.0 * MOST_FALLS:.0f} %: such levels tell little."
    )


def _table_levels(rows: Sequence[Row]) -> list[Any]:
    every = (
        level(rows, name, surface, EQUAL_SPEED, "mnl")
        for name in labels(rows)
        for surface in FLOORS_COMPARED
    )
    return [one for one in every if one is not None]


def _levels_table(rows: Sequence[Row], fitted: tuple[str, str] | None) -> str:
    columns = {
        "label": ("method", "{}"),
        "surface": ("floor", "{}"),
        "mnl": ("MNL", "{}"),
        "mnl_paper": ("paper", "{:.1f}"),
        "mnl_off": ("differs", "{:+.1f}"),
        "pnl": ("PNL", "{}"),
        "pnl_paper": ("paper", "{:.1f}"),
        "pnl_off": ("differs", "{:+.1f}"),
        "equal": ("MNL at equal speed", "{:.1f}"),
        "speed": ("speed (m/s)", "{:.2f}"),
        "heard": ("heard", "{}"),
        "fell": ("fell", "{}"),
    }
    table = []
    for name in labels(rows):
        for surface in FLOORS_COMPARED:
            equal = equal_speed_level(rows, name, surface)
            line: dict[str, Any] = {"label": name, "surface": surface}
            line["equal"] = None if math.isnan(equal) else equal
            for figure in ("mnl", "pnl"):
                line |= _level_cells(rows, name, surface, figure)
            if (name, surface) == fitted and line["mnl"] is not None:
                line["mnl"] += " (fitted)"
            table.append(line | _walked_cells(rows, name, surface))
    return markdown(table, columns)


def _walked_cells(rows: Sequence[Row], name: str, surface: str) -> dict[str, Any]:
    found = walked(rows, name, surface, EQUAL_SPEED)
    if found is None:
        return dict.fromkeys(("speed", "heard", "fell"))
    fell = f"{100.0 * found.fall_rate:.1f} %"
    return {
        "speed": None if math.isnan(found.speed) else found.speed,
        "heard": f"{found.heard} of {found.trials}",
        "fell": f"**{fell}**" if found.fall_rate > MOST_FALLS else fell,
    }


def _level_cells(rows: Sequence[Row], name: str, surface: str, figure: str) -> dict[str, Any]:
    found = level(rows, name, surface, EQUAL_SPEED, figure)
    paper = papers_level(name, surface, figure)
    cells: dict[str, Any] = {figure: None, f"{figure}_paper": paper, f"{figure}_off": None}
    if found is None:
        return cells
    text = f"{found.mean:.1f}"
    if not math.isnan(found.std):
        text += f" ± {found.std:.1f}"
    if len(found.trainings) > 1:
        text += f" ({min(found.trainings):.1f}, {max(found.trainings):.1f})"
    cells[figure] = text
    if paper is not None:
        cells[f"{figure}_off"] = found.mean - paper
    return cells


def _sources_table(rows: Sequence[Row]) -> str:
    columns = {"label": ("method", "{}"), "surface": ("floor", "{}")} | {
        f"laeq_{source}": (source, "{:.1f}") for source in SOURCES
    }
    table = [
        {"label": name, "surface": surface}
        | {f"laeq_{source}": source_level(rows, name, surface, source) for source in SOURCES}
        for name in labels(rows)
        for surface in FLOORS_COMPARED
        if walked(rows, name, surface, EQUAL_SPEED) is not None
    ]
    text = "LAeq of each source alone, asked for 0.5 m/s; of several trainings it is the mean."
    return f"{text}\n\n{markdown(table, columns)}"


def _sweep_table(sweep: Sequence[Row]) -> str:
    columns = {
        "beta": ("beta", "{:g}"),
        "mnl_mean": ("MNL", "{:.1f}"),
        "pnl_mean": ("PNL", "{:.1f}"),
        "speed_mean": ("actual speed (m/s)", "{:.2f}"),
        "velocity_error_sq": ("squared velocity error (m/s)²", "{:.4f}"),
        "training_seed": ("seed", "{}"),
    }
    asked = sweep[0]["command_speed"]
    return f"On wood, asked for {asked:g} m/s.\n\n" + markdown(sweep, columns)


def _time_of(walk: Row) -> str:
    """Return how long the robot that is drawn took, if it arrived."""
    if walk["end"] != "arrived":
        return ""
    return f", the one drawn in {walk['seconds']:.0f} s (the paper's {PAPER_WALK['seconds']:.0f} s)"


def _walk_text(walk: Row) -> str:
    mnl, pnl = (
        "none heard" if walk[f"{name}_mean"] is None else f"{walk[f'{name}_mean']:.1f} dBA"
        for name in ("mnl", "pnl")
    )
    return (
        f"{walk['path_length']:.1f} m over mixed floors, asked for {walk['course_speed']:g} m/s at "
        f"beta {walk['beta']:g}: {walk['arrived']} of {walk['trials']} robots arrived"
        f"{_time_of(walk)}; MNL {mnl}, PNL {pnl}; the paper's {PAPER_WALK['mnl']:.1f} and "
        f"{PAPER_WALK['pnl']:.1f} dBA, at a beta that it does not name."
    )
