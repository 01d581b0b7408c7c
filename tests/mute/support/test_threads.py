"""The waiting policy of OpenMP is set before torch is loaded, and the user's own is kept."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest
from places import REPOSITORY

from mute.support import threads

NAMES = ("OMP_WAIT_POLICY", "GOMP_SPINCOUNT", "OMP_NUM_THREADS")

REPORT = f"""
import json, os, sys
from mute.support.threads import configure_threads
configure_threads()
settings = {{name: os.environ.get(name) for name in {NAMES}}}
print(json.dumps([settings, "torch" in sys.modules]))
"""


def _configure(**given: str) -> tuple[dict[str, str | None], bool]:
    """Return what a fresh process has set after the call, and whether torch was loaded by then."""
    environment = {key: value for key, value in os.environ.items() if key not in NAMES} | given
    command = [sys.executable, "-c", REPORT]
    output = subprocess.run(
        command, cwd=REPOSITORY, env=environment, check=True, capture_output=True, text=True
    ).stdout
    settings, torch_loaded = json.loads(output)
    return settings, torch_loaded


def test_waiting_becomes_passive_before_torch_is_loaded():
    settings, torch_loaded = _configure()
    assert settings["OMP_WAIT_POLICY"] == "passive"
    assert int(settings["GOMP_SPINCOUNT"] or "-1") in range(10_000)
    assert not torch_loaded


def test_a_users_waiting_policy_is_kept_and_not_undone_by_a_spin_count():
    settings, _ = _configure(OMP_WAIT_POLICY="active")
    assert settings["OMP_WAIT_POLICY"] == "active"
    assert settings["GOMP_SPINCOUNT"] is None


def test_a_users_spin_count_is_kept_and_not_undone_by_a_policy():
    settings, _ = _configure(GOMP_SPINCOUNT="7")
    assert settings["GOMP_SPINCOUNT"] == "7"
    assert settings["OMP_WAIT_POLICY"] is None


def test_the_number_of_threads_stays_the_users():
    assert _configure()[0]["OMP_NUM_THREADS"] is None
    assert _configure(OMP_NUM_THREADS="3")[0]["OMP_NUM_THREADS"] == "3"


@pytest.mark.parametrize(
    ("processes", "limit", "expected"),
    [
        ("", "", 16),
        ("", "1", 1),
        ("8", "", 2),
        ("8", "1", 2),  # torchrun's own setting
        ("8", "3", 3),
        ("32", "1", 1),
    ],
)
def test_the_processes_that_torchrun_starts_on_a_machine_share_its_cores(
    processes, limit, expected, monkeypatch
):
    monkeypatch.setattr(threads, "usable_cores", lambda: 16)
    monkeypatch.setenv("LOCAL_WORLD_SIZE", processes)
    monkeypatch.setenv("OMP_NUM_THREADS", limit)
    threads._learning_threads.cache_clear()
    try:
        assert threads._learning_threads() == expected
    finally:
        threads._learning_threads.cache_clear()
