"""Print a policy's card, its noise and a benchmark as tables: python -m mute.card."""

from __future__ import annotations

from mute.command_lines.entry_points import card

if __name__ == "__main__":
    card()
