"""Learn a task: python train.py --task go1_mute."""

from __future__ import annotations

from mute.command_lines.entry_points import train

if __name__ == "__main__":
    train()
