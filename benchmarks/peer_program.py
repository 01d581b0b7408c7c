"""Step and train one peer in the interpreter that has it, as `benchmark_peers` asks.

    python -P benchmarks/peer_program.py NAME NUM_ENVS TASK [DEVICE]

MUTE and mjlab run on a DEVICE that is not the CPU as well.

It prints a line of JSON when the peer is ready: its version and the fields of `peers.parts.Facts`,
or {"missing": WHY}. After that it answers every line of its input with a line of JSON:

    environment           control steps of at least a second, or one: {"steps": N, "seconds": S}
    loop                  an iteration of its own training:           {"steps": N, "seconds": S}
    walk TRIALS SECONDS   what it learnt walks: {"velocity_error_sq": E, "fall_rate": F}

A part that the peer does not have is answered with {"absent": PART}, and what fails with
{"error": WHY}. It ends with its input.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
import time
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

if TYPE_CHECKING:
    from peers.parts import Parts

_ROUND_SECONDS = 1.0
"""Shortest duration of a round of the environment, s."""

_WARM_UP_STEPS = 3
"""Steps before the first round: kernels are compiled in them, some only in the second."""

PROGRAMS = {
    "mute": ("mute", "mute_itself"),
    "gymnasium": ("gymnasium", "gymnasium_go1"),
    "mjlab": ("mjlab", "mjlab_go1"),
    "mujoco_playground": ("playground", "playground_go1"),
    "unilab": ("unilab", "unilab_go2"),
}
"""By a peer's name, the package it comes in and the module of `peers` that makes it."""


def main() -> None:
    """Make the peer that the command line names, and do what is asked."""
    name, num_envs, task, *device = sys.argv[1:]
    answers = _answers()
    package, module = PROGRAMS[name]
    try:
        version = _version(package)
    except metadata.PackageNotFoundError:
        _answer(answers, {"missing": f"{package} is not installed for {sys.executable}"})
        return
    # -P leaves the folder out; at the end nothing in it passes for another of the same name.
    sys.path.append(str(Path(__file__).parent))
    parts: Parts = importlib.import_module(f"peers.{module}").make(int(num_envs), task, *device)
    _answer(answers, {"version": version, **vars(parts.facts)})
    environment = _Environment(parts.environment, parts.facts.num_envs)
    for line in sys.stdin:
        try:
            _answer(answers, _do(line.split(), parts, environment))
        except Exception as error:
            reason = " ".join(str(error).split()) or type(error).__name__
            _answer(answers, {"error": reason[-200:]})


def _version(package: str) -> str:
    if package == "mute":  # a checkout need not be installed
        return importlib.import_module("mute").__version__
    return metadata.version(package)


def _answers() -> TextIO:
    """Return the standard output, and let all else that prints use the standard error."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    return answers


def _answer(answers: TextIO, content: dict[str, Any]) -> None:
    print(json.dumps(content), file=answers, flush=True)


def _do(words: list[str], parts: Parts, environment: _Environment) -> dict[str, Any]:
    part, *numbers = words
    if part == "environment":
        steps, seconds = environment.run()
    elif part == "loop" and parts.loop is not None:
        steps, seconds = parts.loop()
    elif part == "walk" and parts.walk is not None:
        error, falls = parts.walk(int(numbers[0]), float(numbers[1]))
        return {"velocity_error_sq": error, "fall_rate": falls}
    else:
        return {"absent": part}
    return {"steps": steps, "seconds": seconds}


class _Environment:
    """Steps the environment alone, for a round."""

    def __init__(self, step: Callable[[], None], num_envs: int) -> None:
        self._step, self._num_envs = step, num_envs
        self._warm = False

    def run(self) -> tuple[int, float]:
        """Step for a round; return its control steps and seconds."""
        for _ in range(0 if self._warm else _WARM_UP_STEPS):
            self._step()
        self._warm = True
        start, steps, elapsed = time.perf_counter(), 0, 0.0
        while elapsed < _ROUND_SECONDS:
            self._step()
            steps += 1
            elapsed = time.perf_counter() - start
        return steps * self._num_envs, elapsed


if __name__ == "__main__":
    main()
