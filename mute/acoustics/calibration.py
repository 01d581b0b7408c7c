"""Fit the one unknown of the sound model: python -m mute.acoustics.calibration."""

from __future__ import annotations

from mute.command_lines.entry_points import calibrate

if __name__ == "__main__":
    calibrate()
