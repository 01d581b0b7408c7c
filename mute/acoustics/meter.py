"""Run the sound level meter: python -m mute.acoustics.meter FILE.wav."""

from __future__ import annotations

from mute.command_lines.entry_points import meter

if __name__ == "__main__":
    meter()
