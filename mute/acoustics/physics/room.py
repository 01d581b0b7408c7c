"""Where sound goes: straight to the listener, and round the room until it is absorbed.

The mean square pressure at the distance r of a small source of the power W on a hard floor, in a
room of the absorption area A, is the classical sum of the direct and the reverberant field
(Kuttruff, Room Acoustics; Vigran, Building Acoustics, 2008, eq. 4.41)

    p^2 = rho c W (1 / (2 pi r^2) + 4 / A).

A room's reverberation time T follows Sabine, A = 0.161 V / T.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, pi, prod

__all__ = ["OPEN", "ROOMS", "Room"]

_SABINE = 0.161
"""s / m."""


@dataclass(frozen=True)
class Room:
    """A room, as the reverberant field knows it."""

    absorption: float
    """Equivalent absorption area A, m^2; infinite in the open."""
    size: tuple[float, float, float] | None = None
    """Length, width and height, m; None in the open."""

    @property
    def volume(self) -> float:
        """m^3."""
        return inf if self.size is None else prod(self.size)

    @property
    def reverberation_time(self) -> float:
        """Time in which sound falls by 60 dB, s; 0 in the open."""
        return 0.0 if self.absorption == inf else _SABINE * self.volume / self.absorption

    @property
    def has_walls(self) -> bool:
        """Whether anything comes back."""
        return self.absorption < inf

    @property
    def echo(self) -> float:
        """Mean square of the reverberant field over that of the source alone at 1 m: 8 pi / A."""
        return 8.0 * pi / self.absorption


OPEN = Room(inf)
"""No walls."""

ROOMS = {
    "open": OPEN,
    "office": Room(absorption=16.1, size=(5.0, 4.0, 2.5)),
    "corridor": Room(absorption=10.0, size=(12.4, 2.0, 2.5)),
    "ward": Room(absorption=13.4, size=(8.0, 5.0, 2.5)),
}
"""Rooms by name: of 0.5, 1.0 and 1.2 s."""
