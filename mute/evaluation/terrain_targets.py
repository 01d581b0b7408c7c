"""What a policy is to reach over ground, and under hardships."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from mute.evaluation.endurance import HARDSHIPS
from mute.evaluation.reliability.figures import Figure, Target

__all__ = ["terrain_targets"]

_Rows = Sequence[Mapping[str, Any]]

_CROSSINGS = {
    ("flat", 0): 0.99,
    ("uneven", 3): 0.97,
    ("blocks", 3): 0.95,
    ("stairs", 1): 0.95,
    ("stairs", 2): 0.90,
    ("stairs", 3): 0.70,
    ("stairs_down", 1): 0.95,
    ("stairs_down", 2): 0.90,
    ("stairs_down", 3): 0.70,
}
"""Shares of the robots that are to get across, by kind and level. Ours: risers of 14 cm, nearly
half of the robot's height, have none."""
_SURVIVAL = 0.95
"""Share that is not to fall, under each hardship and in half an hour at random commands, where
DreamWaQ's paper has 95 %."""
_PUSH = 1.0
"""Largest push to bear, m/s; DreamWaQ's paper has 1.12."""


def terrain_targets(tables: Mapping[str, _Rows]) -> list[Figure]:
    """Return the figures that have a target, of what was measured; at the worst speed.

    Args:
        tables: What `evaluate.py terrain` measured, by part.
    """
    figures: list[Figure] = []
    crossings = tables.get("crossings", ())
    for (kind, level), least in _CROSSINGS.items():
        shares = [row["success"] for row in crossings if _is_of(row, kind, level)]
        if shares:
            where = kind if kind == "flat" else f"{kind}, level {level}"
            figures.append(_share("crossings", f"{where}: get across", shares, least))
    survived = {row["hardship"]: row["survived"] for row in tables.get("hardships", ())}
    figures += [
        _share("hardships", f"{name}: do not fall", [survived[name]], _SURVIVAL)
        for name in HARDSHIPS
        if name in survived and name != "none"
    ]
    for row in tables.get("pushes", ()):
        target = Target(at_least=_PUSH)
        figures.append(Figure("pushes", "largest push, mean", row["largest"], "m/s", target))
    for row in tables.get("walk", ()):
        name = f"{row['minutes']:g} min at random: do not fall"
        figures.append(_share("walk", name, [row["survived"]], _SURVIVAL))
    return figures


def _is_of(row: Mapping[str, Any], kind: str, level: int) -> bool:
    return row["kind"] == kind and (row["level"] == level or kind == "flat")


def _share(part: str, name: str, shares: Sequence[float], least: float) -> Figure:
    value = math.nan if any(map(math.isnan, shares)) else min(shares)
    return Figure(part, name, value, "share", Target(at_least=least))
