"""Time other ways to step a Go1 on the CPU, beside the benchmark: `mute.benchmark --peers`.

Each peer runs in a process of its own, one after the other and after MUTE's own parts: they share
the machine and the run, but unlike those parts they are not interleaved with the engine. They need
not share the work: Gymnasium steps MUTE's scene without a task, while mjlab and MuJoCo Playground
step robots, tasks and rewards of their own; each one's note says which. mjlab and Playground pin
other versions of MuJoCo, so each has a virtual environment of its own.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mute.command_lines.arguments import check_distinct
from mute.support.errors import MuteError
from mute.support.provenance import REPOSITORY

__all__ = ["ALL_PEERS", "PEERS", "PeerRate", "peer_names", "time_peer"]

PEERS = ("gymnasium", "mjlab", "mujoco_playground")
"""Names of the peers: those that `benchmarks/peer_program.py` knows."""

ALL_PEERS = "all"
"""The word that stands for every peer."""

_PROGRAM = REPOSITORY / "benchmarks" / "peer_program.py"
"""The program that times a peer: a checkout has it, an installed package does not."""

_WAITING = ("OMP_WAIT_POLICY", "GOMP_SPINCOUNT")
"""What `support.threads` sets to suit our own loop; a peer runs with what it would find itself. The
number of threads stays: that of the processors suits everybody."""


@dataclass
class PeerRate:
    """How fast a peer is; what is not known, since it did not run, is None."""

    name: str
    """Its name, one of `PEERS`."""
    version: str | None
    """Version of its package."""
    num_envs: int | None
    """Robots that it steps at once."""
    steps_per_second: float | None
    """Control steps a second, robots times steps."""
    note: str
    """What it steps, or why it did not run."""


def peer_names(given: Sequence[str]) -> tuple[str, ...]:
    """Return the peers that --peers names; none if it is not given.

    Raises:
        MuteError: If there is no such peer, or one is named twice.
    """
    if not given:
        return ()
    check_distinct("peers", given)
    if not _PROGRAM.exists():
        raise MuteError("--peers needs a checkout of MUTE: its programs are not installed")
    if tuple(given) == (ALL_PEERS,):
        return PEERS
    for name in given:
        if name not in PEERS:
            raise MuteError(
                f"--peers must be {ALL_PEERS} or some of {', '.join(PEERS)}, got {name!r}"
            )
    return tuple(given)


def time_peer(name: str, python: Path | None, num_envs: int, rounds: int, task: str) -> PeerRate:
    """Time one peer; one that cannot run says so in its note.

    Args:
        name: Its name.
        python: Interpreter that has it, or None for this one.
        num_envs: Robots; Gymnasium takes a number of its own.
        rounds: Rounds, of a second or a step at least; the median counts.
        task: Name of the task whose scene Gymnasium steps.
    """
    # -P keeps the modules beside the program from passing for others of the same name.
    command = [str(python or sys.executable), "-P", str(_PROGRAM), name]
    command += [str(num_envs), str(rounds), task]
    environment = {key: value for key, value in os.environ.items() if key not in _WAITING}
    try:
        result = subprocess.run(command, capture_output=True, text=True, env=environment)
        if result.returncode != 0:
            reason = (result.stderr.strip().splitlines() or ["no message"])[-1]
            return _not_timed(name, f"failed with status {result.returncode}: {reason[-200:]}")
        return PeerRate(name=name, **json.loads(result.stdout.splitlines()[-1]))
    except OSError as error:
        return _not_timed(name, f"{command[0]} does not start: {error.strerror}")
    except (IndexError, TypeError, ValueError):
        return _not_timed(name, f"{command[0]} printed no rate")


def _not_timed(name: str, note: str) -> PeerRate:
    return PeerRate(name=name, version=None, num_envs=None, steps_per_second=None, note=note)
