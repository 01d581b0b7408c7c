"""The constant of the model of sound: what it is fitted to, and what DreamWaQ would make of it."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mute.acoustics.body import CALIBRATION_FILE, load_transmissibility
from mute.command_lines.calibrate import REFERENCES, CalibrationArgs, fitted
from mute.evaluation.comparison.conclusions import PAPERS_ROWS
from mute.evaluation.comparison.measurements import Extent, Kept
from mute.evaluation.comparison.walkers import DREAMWAQ, Walker
from mute.evaluation.tables import read_json
from mute.support.errors import MuteError

__all__ = ["constant_in_use", "dreamwaqs_constants"]

_SHOWN = ("floor", "transmissibility", "target_mnl", "mnl", "mnl_ci95", "robots")


def constant_in_use(path: Path = CALIBRATION_FILE) -> dict[str, Any]:
    """Return the constant, and the label, floor and policy whose level it is fitted to.

    What the file does not say of these is None.

    Raises:
        MuteError: If the file is missing or broken.
    """
    share, saved = load_transmissibility(path), read_json(path)
    label_of = {row: name for name, row in PAPERS_ROWS.items()}
    policy = saved.get("policy")
    return {
        "transmissibility": share,
        "label": label_of.get(REFERENCES.get(saved.get("reference"), "")),
        "floor": saved.get("floor"),
        "policy_sha256": policy.get("sha256") if isinstance(policy, dict) else None,
    }


def dreamwaqs_constants(
    walkers: Sequence[Walker], extent: Extent, seed: int, kept: Kept, measured: bool, anew: bool
) -> list[dict[str, Any]]:
    """Return the constant that gives DreamWaQ the paper's level on wood, a row for each training.

    Nothing of it is used: levels are those of the constant that is there.

    Args:
        walkers: What is compared.
        extent: How many robots walk, and how long.
        seed: Seed of the robots, of initial states and of the noise.
        kept: What was measured before, and where what is measured now goes.
        measured: Whether to measure what is not there; else it is none of them unless all are.
        anew: Whether to measure what is there, too.
    """
    rows: list[dict[str, Any]] = []
    for walker in walkers:
        if walker.method != DREAMWAQ:
            continue
        asked = CalibrationArgs(
            policy=Path(walker.name),
            reference="dreamwaq",
            trials=extent.calibration_trials,
            seconds=extent.calibration_seconds,
            seed=seed,
        )
        key = _key(asked, walker)
        before = None if measured and anew else kept.read(key, walker)
        if before is None and not measured:
            return []
        rows += before if before is not None else _fitted(asked, walker, kept, key)
    return rows


def _key(asked: CalibrationArgs, walker: Walker) -> dict[str, Any]:
    """Return what decides how a fit comes out; the constant in use is not among it."""
    words = ("reference", "floor", "speed", "trials", "seconds", "seed")
    return {
        "part": "calibration",
        "sha256": walker.sha256,
        **{name: value for name, value in dataclasses.asdict(asked).items() if name in words},
    }


def _fitted(
    asked: CalibrationArgs, walker: Walker, kept: Kept, key: dict[str, Any]
) -> list[dict[str, Any]]:
    row: dict[str, Any] = {
        "part": "calibration",
        "label": walker.label(0.0),
        "policy": walker.name,
        "training_seed": walker.training_seed,
        "method": walker.method,
        "beta": 0.0,
    }
    try:
        found = fitted(asked, walker.driver)
    except MuteError as error:  # of one that falls, say, which the report can tell
        return kept.write(key, [row | dict.fromkeys(_SHOWN) | {"reason": str(error)}])
    return kept.write(key, [row | {name: found[name] for name in _SHOWN} | {"reason": None}])
