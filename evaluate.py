"""Measure policies: python evaluate.py noise."""

from __future__ import annotations

from mute.command_lines.entry_points import evaluate

if __name__ == "__main__":
    evaluate()
