"""Write what was measured as pages: python -m mute.card --out docs."""

from __future__ import annotations

from mute.command_lines.entry_points import card

if __name__ == "__main__":
    card()
