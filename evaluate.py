"""Measure policies: python evaluate.py noise."""

from __future__ import annotations

import sys

from mute.threads import configure_threads

configure_threads()  # before torch is imported

from mute.errors import run_cli
from mute.rendering.backend import configure_rendering


def _main() -> int:
    """Choose what renders, which mujoco reads as it is imported, and measure."""
    configure_rendering(sys.argv[1:])
    from mute.command_lines.evaluate import main

    return main()


if __name__ == "__main__":
    run_cli(_main)
