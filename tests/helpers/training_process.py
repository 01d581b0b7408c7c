"""A small training as a process of its own: started, stopped by a signal, and what it said."""

from __future__ import annotations

import signal
import subprocess
import sys
from typing import Any

from places import REPOSITORY

TINY = ["--plain", "--num-envs", "4", "--env.num-threads", "1", "--agent.num-steps-per-env", "6"]
TINY += ["--agent.actor-hidden", "8", "--agent.critic-hidden", "8", "--agent.noise-interval", "0"]
"""Options of a training whose iterations take a moment."""


def start_training(*arguments: str, **how: Any) -> subprocess.Popen[str]:
    """Start `train.py`; `how` goes to `Popen`."""
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "cwd": REPOSITORY}
    command = [sys.executable, str(REPOSITORY / "train.py"), *TINY, *arguments]
    return subprocess.Popen(command, text=True, **(streams | how))


def stop_after(process: subprocess.Popen[str], lines: int, how: signal.Signals) -> tuple[str, str]:
    """Wait for the lines of some iterations, send a signal, return what came out in all."""
    assert process.stdout is not None
    head = "".join(process.stdout.readline() for _ in range(lines))
    process.send_signal(how)
    out, err = process.communicate(timeout=120)
    return head + out, err
