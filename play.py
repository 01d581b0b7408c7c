"""Watch, record and steer a policy: python play.py --beta 0.7."""

from __future__ import annotations

from mute.command_lines.entry_points import play

if __name__ == "__main__":
    play()
