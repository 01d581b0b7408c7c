"""How difficult each kind of ground is at each level: one table of figures.

Stairs are the ruler: risers of 3 to 14 cm on treads of 0.3 m, as a blind Go1 of published work
climbs 10 cm (mjlab's Go1 task) to 14 cm. What lies in the way elsewhere is as high as a riser of
the same level. Slopes end at 25 degrees, the pitch of stairs of 14 cm (RoboGauge has 8 to 30);
rough ground at 10 cm from the lowest to the highest block (legged_gym's random heights of 5 cm up
and down). Indoors, thresholds are up to 4 cm high, twice what DIN 18040-2 allows in homes without
barriers, and cables and the edges of carpets as thick as in a shop.
"""

from __future__ import annotations

import math

__all__ = ["FIGURES", "LEVELS", "TREAD"]

LEVELS = 5
"""Levels of every kind, 0 the easiest."""

TREAD = 0.3
"""Depth of a step, m."""

_RISERS = (0.03, 0.05, 0.08, 0.11, 0.14)

FIGURES: dict[str, tuple[float, ...]] = {
    "riser": _RISERS,
    "block": _RISERS,
    "slope": tuple(math.radians(angle) for angle in (5.0, 10.0, 15.0, 20.0, 25.0)),
    "uneven": (0.02, 0.04, 0.06, 0.08, 0.10),
    "sill": (0.01, 0.015, 0.02, 0.03, 0.04),
    "cable": (0.006, 0.008, 0.010, 0.012, 0.015),
    "carpet": (0.004, 0.006, 0.008, 0.010, 0.012),
}
"""By what it is and level: heights in m, the angle of a slope in rad."""
