"""Measure policies: python evaluate.py gait."""

from __future__ import annotations

from mute.threads import configure_threads

configure_threads()  # before torch is imported

from mute.command_lines.evaluate import main
from mute.errors import run_cli

if __name__ == "__main__":
    run_cli(main)
