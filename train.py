"""Learn a task: python train.py --task go1_mute."""

from __future__ import annotations

from mute.memory import keep_freed_memory
from mute.threads import configure_threads

configure_threads()  # before torch is imported
keep_freed_memory()

from mute.command_lines.train import main
from mute.errors import run_cli

if __name__ == "__main__":
    run_cli(main)
