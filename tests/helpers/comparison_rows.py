"""Rows of the comparison that can be reckoned with by hand."""

from __future__ import annotations

from typing import Any


def make_row(
    label: str, mnl: float | None, surface: str = "wood", command: float = 0.5, **more: Any
) -> dict[str, Any]:
    """Return what was measured of a label on a floor at a command, m/s: its MNL, dBA, and more."""
    row = {
        "part": "levels",
        "label": label,
        "policy": "a.pt",
        "training_seed": 0,
        "beta": 0.0,
        "surface": surface,
        "command_speed": command,
        "speed_mean": command,
        "mnl_mean": mnl,
        "mnl_std": 0.5,
        "pnl_mean": None if mnl is None else mnl + 5.0,
        "pnl_std": 1.0,
        "velocity_error_sq": 0.01,
        "fall_rate": 0.0,
        "trials": 20,
        "trials_heard": 20,
    }
    sources = ("impacts", "body", "drive", "scuffing", "fan")
    return row | {f"laeq_{source}": 50.0 + i for i, source in enumerate(sources)} | more


def floors(label: str, *mnl: float) -> list[dict[str, Any]]:
    """Return rows of a label with an MNL on each of wood, carpet and tile."""
    return [
        make_row(label, value, surface)
        for value, surface in zip(mnl, ("wood", "carpet", "tile"), strict=True)
    ]
