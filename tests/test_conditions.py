"""The tests say the same wherever they are started: in a background job, a hook, a pipe."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from places import REPOSITORY
from rich.console import Console

_SLEEP = "import time; print('ready', flush=True); time.sleep(600)"

_IGNORE = "import os, signal, sys; {} os.execv(sys.executable, [sys.executable, *sys.argv[1:]])"

_INHERITED = (
    "[signal.signal(n, signal.SIG_IGN) for n in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM)];"
    "signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGUSR1});"
)


def test_signals_reach_what_a_test_starts():
    for number in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM, signal.SIGUSR1):
        command = [sys.executable, "-c", _SLEEP]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as child:
            try:
                assert child.stdout is not None
                assert child.stdout.readline() == b"ready\n"
                child.send_signal(number)
                assert child.wait(timeout=60) == -number
            finally:
                child.kill()


def test_a_test_sees_no_variable_of_the_users():
    assert os.environ["OMP_NUM_THREADS"] == "1"
    assert not {"MUJOCO_GL", "DISPLAY", "WORLD_SIZE"} & os.environ.keys()
    assert (Console().width, Console().color_system) == (80, None)


def test_the_tests_above_pass_where_signals_are_ignored_and_variables_set():
    tests = [test_signals_reach_what_a_test_starts, test_a_test_sees_no_variable_of_the_users]
    words = ["-m", "pytest", "-q", "-p", "no:xdist", "-o", "addopts=", "-p", "no:cacheprovider"]
    words += [f"{Path(__file__)}::{test.__name__}" for test in tests]
    theirs = {"OMP_NUM_THREADS": "3", "MUJOCO_GL": "crayons", "DISPLAY": ":987", "COLUMNS": "33"}
    run = subprocess.run(
        [sys.executable, "-c", _IGNORE.format(_INHERITED), *words],
        cwd=REPOSITORY,
        env=os.environ | theirs | {"WORLD_SIZE": "7", "FORCE_COLOR": "1"},
        capture_output=True,
        text=True,
        timeout=240,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    assert "2 passed" in run.stdout


@pytest.mark.parametrize(
    ("cores", "places", "workers"),
    [(1, ["tests"], 0), (2, ["tests"], 2), (64, ["tests"], 8), (8, ["a.py", "b.py::test"], 2)],
)
def test_there_is_a_process_for_each_core_that_may_be_used(
    cores, places, workers, request, monkeypatch
):
    plugin = request.config.pluginmanager.get_plugin(str(REPOSITORY / "tests" / "conftest.py"))
    monkeypatch.setattr(plugin, "usable_cores", lambda: cores)
    config = SimpleNamespace(args=places)
    assert plugin.pytest_xdist_auto_num_workers(config) == workers


def test_the_files_that_come_first_are_there(request):
    conftest = REPOSITORY / "tests" / "conftest.py"
    plugin = request.config.pluginmanager.get_plugin(str(conftest))
    names = {path.name for path in conftest.parent.rglob("test_*.py")}
    assert set(plugin._LONGEST) <= names
