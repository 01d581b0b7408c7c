"""How every command starts: the process is set up first, and only then is torch imported.

Nothing else changes the process it runs in: whoever imports MUTE as a library keeps the threads and
the memory as they are.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import sys
from typing import NoReturn

from mute.rendering.backend import configure_rendering
from mute.support.errors import run_cli
from mute.support.memory import keep_freed_memory
from mute.support.plugins import load_plugins
from mute.support.streams import patient_output
from mute.support.threads import configure_threads, limit_operator_threads

__all__ = [
    "benchmark",
    "calibrate",
    "card",
    "evaluate",
    "export",
    "meter",
    "play",
    "release",
    "train",
    "web",
]


def train() -> NoReturn:
    """Learn a task: `train.py`."""
    keep_freed_memory()
    _start("train", keeps_files=True)


def play() -> NoReturn:
    """Watch, record and steer a policy: `play.py`."""
    _start("play", renders=True)


def evaluate() -> NoReturn:
    """Measure policies: `evaluate.py`."""
    _start("evaluate", renders=True, keeps_files=True)


def export() -> NoReturn:
    """Export a policy as one ONNX file: `python -m mute.export`."""
    _start("export", keeps_files=True)


def meter() -> NoReturn:
    """Measure recordings with a sound level meter: `python -m mute.acoustics.meter`."""
    _start("meter")


def calibrate() -> NoReturn:
    """Fit the one unknown of the sound model: `python -m mute.acoustics.calibration`."""
    _start("calibrate", keeps_files=True)


def benchmark() -> NoReturn:
    """Measure the speed of training: `python -m mute.benchmark`."""
    keep_freed_memory()
    _start("benchmark", keeps_files=True)


def release() -> NoReturn:
    """Make the files of a policy that ships: `python -m mute.release`."""
    _start("release", keeps_files=True)


def web() -> NoReturn:
    """Write the assets of the page: `python -m mute.web`."""
    _start("web", keeps_files=True)


def card() -> NoReturn:
    """Write what was measured as pages: `python -m mute.card`."""
    _start("card")


def _start(command: str, renders: bool = False, keeps_files: bool = False) -> NoReturn:
    """Run the main function of a command's module and end the process with its status.

    Args:
        command: Name of the module.
        renders: Whether it may make pictures.
        keeps_files: Whether it works for files, and so goes on where nobody reads what it prints.
    """

    def main() -> int | None:
        _print_what_can_be()
        configure_threads()  # before torch is imported
        configure_rendering(sys.argv[1:] if renders else [])  # before mujoco is
        load_plugins()
        with patient_output() if keeps_files else contextlib.nullcontext():
            module = importlib.import_module(f"mute.command_lines.{command}")
            limit_operator_threads()  # after torch is imported, where it is
            return module.main()

    run_cli(main)


def _print_what_can_be() -> None:
    """Print a question mark for what the terminal or the file has no character for.

    A figure's unit must not cost the figures.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
