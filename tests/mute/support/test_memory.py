"""Freed blocks are kept: what is allocated again brings no new pages."""

from __future__ import annotations

import subprocess
import sys

import pytest
from places import REPOSITORY

from mute.support.memory import keep_freed_memory

FAULTS = """
import resource
from mute.support.memory import keep_freed_memory
kept = {keep} and keep_freed_memory()
import torch
def work():
    for _ in range(20):
        a = torch.ones(2**24)
        b = a + 1.0
        del a, b
work()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
work()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def _faults(keep: bool) -> int:
    run = subprocess.run(
        [sys.executable, "-c", FAULTS.format(keep=keep)],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=True,
    )
    return int(run.stdout)


@pytest.mark.skipif(not keep_freed_memory(), reason="the C library is not glibc")
def test_memory_that_is_taken_again_has_its_pages():
    # A block may not fit where an earlier one was, and grow the heap; but not every time.
    assert _faults(keep=True) < 0.3 * _faults(keep=False)


def test_a_library_that_cannot_is_left_alone(monkeypatch):
    monkeypatch.setattr("mute.support.memory.ctypes.CDLL", lambda name: object())
    assert not keep_freed_memory()
