"""Run the benchmark of training: python -m mute.benchmark."""

from __future__ import annotations

from mute.command_lines.entry_points import benchmark

if __name__ == "__main__":
    benchmark()
