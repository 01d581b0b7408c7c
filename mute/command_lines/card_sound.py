"""The part of `docs/sound.md` that holds what the model predicts to what the paper measured."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.optimize import brentq

from mute.command_lines.card_tables import markdown, usual_rows
from mute.evaluation.intervals import with_interval
from mute.evaluation.paper_levels import PAPER_AT_08, PAPER_LEVELS, PAPER_WALK
from mute.support.errors import MuteError

__all__ = ["predicted_and_measured"]

_METHODS = {"mute beta 0": 0.0, "mute beta 1": 1.0}
"""The paper's rows that there are policies for, and their beta."""
_COLUMNS = {
    "method": ("method", "{}"),
    "surface": ("floor", "{}"),
    "mnl": ("MNL, model", "{}"),
    "paper_mnl": ("paper", "{:.1f}"),
    "mnl_off": ("off by", "{}"),
    "pnl": ("PNL, model", "{}"),
    "paper_pnl": ("paper", "{:.1f}"),
    "pnl_off": ("off by", "{}"),
}


def predicted_and_measured(
    noise: Sequence[Mapping[str, Any]],
    sweep_beta: Sequence[Mapping[str, Any]],
    walk: Mapping[str, Any],
    fitted: tuple[str, str] | None,
) -> str:
    """Return the part.

    Args:
        noise: Rows of `evaluate.py noise` at 0.5 m/s.
        sweep_beta: Rows of `evaluate.py sweep-beta` at 0.8 m/s on wood.
        walk: What `evaluate.py walk` wrote.
        fitted: The paper's row, and the floor, whose mean level is fitted; None if that level is
            of another policy than these.

    Raises:
        MuteError: If one lacks what the part is made of.
    """
    usual = {(row["surface"], row["beta"]): row for row in usual_rows(noise)}
    rows = [
        _row(method, surface, usual.get((surface, _METHODS.get(method))), fitted)
        for method, levels in PAPER_LEVELS.items()
        for surface in levels
    ]
    measured = [row for row in rows if row["mnl_error"] is not None]
    predicted = [row for row in measured if not row["fitted"]]
    if not predicted:
        raise MuteError("the levels of evaluate.py noise hold no row to predict")
    mnl = _root_mean_square([row["mnl_error"] for row in predicted])
    pnl = _root_mean_square([row["pnl_error"] for row in measured])
    fast = {row["beta"]: row for row in usual_rows(sweep_beta)}
    return "\n\n".join(
        (
            f"Asked for 0.5 m/s, {noise[0]['trials']} robots, dBA at the trunk, with the 95 % "
            "intervals of the means (`python evaluate.py noise --nominal --out docs/noise`). For "
            "rows without levels there is no policy here yet.",
            markdown(rows, _COLUMNS),
            f"Root mean square over the {len(predicted)} MNL that were not fitted: "
            f"**{mnl:.1f} dBA**; over the {len(measured)} PNL: {pnl:.1f} dBA.",
            _if_fitted_elsewhere(usual, fitted),
            _at_08(fast),
            f"**The long walk** at beta {walk['beta']:g} has an MNL of "
            f"{_with_interval(walk, 'mnl')} and a PNL of {_with_interval(walk, 'pnl')} dBA over "
            f"{walk['arrived']} robots, the paper's {PAPER_WALK['mnl']:.1f} and "
            f"{PAPER_WALK['pnl']:.1f}, at a beta that it does not name.",
        )
    )


def _if_fitted_elsewhere(
    usual: Mapping[tuple[str, float], Mapping[str, Any]], fitted: tuple[str, str] | None
) -> str:
    """Tell what the error would be had another row been fitted, by the levels of the sources.

    Args:
        usual: Rows by floor and beta.
        fitted: The row that is, if it is one of them.
    """
    levels = {
        (method, surface): (usual[surface, beta], PAPER_LEVELS[method][surface][0])
        for method, beta in _METHODS.items()
        for surface in PAPER_LEVELS[method]
        if (surface, beta) in usual and usual[surface, beta]["mnl_mean"] is not None
    }
    told = []
    for case, (row, target) in levels.items():
        if case == fitted:
            continue
        place = f"{case[1]} at {case[0].removeprefix('mute ')}"
        shift = _shift_that_reaches(row, target)
        if shift is None:
            told.append(f"{place}, which no share reaches")
            continue
        others = [
            _shifted(other, shift) - level
            for name, (other, level) in levels.items()
            if name != case
        ]
        told.append(f"{place}, {shift:+.0f} dB of share: {_root_mean_square(others):.1f} dBA")
    return (
        "The same root mean square had another row been fitted, estimated from the levels of the "
        f"sources: {'; '.join(told)}."
    )


_ROBOT, _REST = ("body", "drive"), ("impacts", "scuffing", "fan")
"""Sources that go with the share that is fitted, and those that do not."""
_FARTHEST_SHIFT = 40.0


def _shifted(row: Mapping[str, Any], shift: float) -> float:
    """Return the mean level with the robot's own sources louder by so many dB."""

    def energy(names: Sequence[str]) -> float:
        levels = [row[f"laeq_{name}"] for name in names]
        return sum(10.0 ** (0.1 * level) for level in levels if level is not None)

    robot, rest = energy(_ROBOT), energy(_REST)
    louder = (10.0 ** (0.1 * shift) * robot + rest) / (robot + rest)
    return row["mnl_mean"] + 10.0 * math.log10(louder)


def _shift_that_reaches(row: Mapping[str, Any], target: float) -> float | None:
    """Return by how many dB the robot's own sources must be louder for a level, None if none is."""
    ends = [_shifted(row, shift) - target for shift in (-_FARTHEST_SHIFT, _FARTHEST_SHIFT)]
    if ends[0] * ends[1] > 0.0:
        return None
    found = brentq(lambda shift: _shifted(row, shift) - target, -_FARTHEST_SHIFT, _FARTHEST_SHIFT)
    return float(found)  # pyright: ignore[reportArgumentType]


def _root_mean_square(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _at_08(fast: Mapping[float, Mapping[str, Any]]) -> str:
    """Tell of 0.8 m/s in both readings of the paper.

    Args:
        fast: Rows by beta.

    Raises:
        MuteError: If an end is missing.
    """
    if not fast.keys() >= {0.0, 1.0}:
        raise MuteError("the levels of evaluate.py sweep-beta must hold beta 0 and beta 1")
    if any(fast[beta][name] is None for beta in (0.0, 1.0) for name in ("mnl_mean", "pnl_mean")):
        raise MuteError("the levels of evaluate.py sweep-beta lack those of beta 0 or beta 1")
    loud, quiet = (PAPER_AT_08[beta] for beta in (0.0, 1.0))

    def compared(name: str) -> str:
        found = [fast[beta][name] for beta in (0.0, 1.0)]
        return (
            f"the model's {found[0]:.1f} and {found[1]:.1f} are {_off(found[0] - loud)} and "
            f"{_off(found[1] - quiet)} dB from them"
        )

    return (
        f"**Asked for 0.8 m/s on wood**, the paper's text gives {loud:.1f} dBA at beta 0 and "
        f"{quiet:.1f} at beta 1. Read as means, {compared('mnl_mean')}; as peaks, "
        f"{compared('pnl_mean')}. The text says that levels *peaked near* the first, and the "
        "second is also its peak level at 0.5 m/s. As means they would ask for 45 lg v from 0.5 to "
        "0.8 m/s, where a blow has 20 to 28, while the long walk says the opposite."
    )


def _row(
    method: str, surface: str, row: Mapping[str, Any] | None, fitted_row: tuple[str, str] | None
) -> dict[str, Any]:
    """Return a level of the paper beside the model's, which there is none of without a policy."""
    paper = PAPER_LEVELS[method][surface]
    fitted = (method, surface) == fitted_row
    shown: dict[str, Any] = {
        "method": method,
        "surface": surface,
        "fitted": fitted,
        "paper_mnl": paper[0],
        "paper_pnl": paper[1],
    }
    for name, level in zip(("mnl", "pnl"), paper, strict=True):
        mean = None if row is None else row[f"{name}_mean"]
        error = None if mean is None else mean - level
        shown[f"{name}_error"] = error
        shown[name] = None if row is None or mean is None else _with_interval(row, name)
        shown[f"{name}_off"] = None if error is None else _off(error)
    if fitted and shown["mnl_error"] is not None:
        shown["mnl_off"] = "fitted"
    return shown


def _with_interval(row: Mapping[str, Any], name: str) -> str:
    """Return a mean level with its 95 % interval, where there is one."""
    mean, half_width = row[f"{name}_mean"], row[f"{name}_ci95"]
    return "-" if mean is None else with_interval(mean, half_width)


def _off(error: float) -> str:
    return f"{error:+.1f}"
