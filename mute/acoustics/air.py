"""The air of a room at 20 degrees Celsius, in one place."""

from __future__ import annotations

__all__ = ["AIR_DENSITY", "AIR_IMPEDANCE", "SPEED_OF_SOUND"]

SPEED_OF_SOUND = 343.0
"""m/s."""

AIR_DENSITY = 1.204
"""kg / m^3."""

AIR_IMPEDANCE = AIR_DENSITY * SPEED_OF_SOUND
"""Density times speed of sound, Pa s / m."""
