"""Noise levels that the paper measured on the real robot, in dBA."""

from __future__ import annotations

__all__ = ["PAPER_AT_08", "PAPER_LEVELS", "PAPER_WALK"]

PAPER_LEVELS: dict[str, dict[str, tuple[float, float]]] = {
    "dreamwaq": {"wood": (73.51, 83.18), "carpet": (71.90, 80.80), "tile": (72.34, 80.93)},
    "mpc": {"wood": (79.74, 84.03), "carpet": (77.92, 81.25), "tile": (79.38, 83.12)},
    "mute beta 0": {"wood": (68.61, 75.86), "carpet": (67.42, 74.40), "tile": (70.69, 79.30)},
    "mute beta 1": {"wood": (65.78, 73.18), "carpet": (62.48, 69.52), "tile": (66.15, 76.22)},
}
"""(MNL, PNL) at 0.5 m/s by method and floor: the paper's table of noise levels."""

PAPER_AT_08: dict[float, float] = {0.0: 77.85, 1.0: 73.18}
"""Levels by beta on wood, asked for 0.8 m/s: the paper's analysis of the quiet factor.

It does not say for certain whether they are means or peaks."""

PAPER_WALK: dict[str, float] = {"seconds": 256.0, "mnl": 68.25, "pnl": 76.8}
"""The paper's long walk over mixed floors."""
