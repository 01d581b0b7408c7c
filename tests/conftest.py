"""What every test may count on, whoever starts the tests, from where and on what machine.

Signals act, lines have 80 columns, no variable of the user's changes what a program does, and torch
runs on one thread and is left as it was found.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import hypothesis
import pytest

_MOST_WORKERS = 8
"""Processes of `-n auto` at most: each holds a torch of its own, and starts more."""

_LONGEST = (
    *("test_video.py", "test_distributed.py", "test_engines.py", "test_filmed_evaluations.py"),
    *("test_resume.py", "test_lost_work.py", "test_programs.py", "test_runner.py"),
    *("test_benchmark.py", "test_benchmark_turns.py", "test_sound_benchmark.py"),
    *("test_gym_making.py",),
)
"""Files that take longest. They come first, so that no process is alone with one at the end."""

_NOT_OURS = (
    *("CLICOLOR", "CLICOLOR_FORCE", "FORCE_COLOR", "NO_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE"),
    *("DISPLAY", "WAYLAND_DISPLAY", "MPLBACKEND", "MUJOCO_GL", "PYOPENGL_PLATFORM"),
    *("GOMP_SPINCOUNT", "KMP_BLOCKTIME", "MKL_NUM_THREADS", "OMP_WAIT_POLICY"),
    *("RANK", "WORLD_SIZE", "LOCAL_RANK", "LOCAL_WORLD_SIZE", "MASTER_ADDR", "MASTER_PORT"),
    *("GIT_DIR", "GIT_INDEX_FILE", "GIT_WORK_TREE"),  # set where a hook of git runs the tests
    *("PYTHONINSPECT", "PYTHONWARNINGS"),
)
"""Variables that change what programs do, and that a user may have."""

_KEPT_IGNORED = ("SIGPIPE", "SIGXFSZ", "SIGTTIN", "SIGTTOU")
"""Signals that Python ignores by itself, or a shell for a job in the background."""


def _set_environment() -> None:
    for name in _NOT_OURS:
        os.environ.pop(name, None)
    os.environ |= {"COLUMNS": "80", "LINES": "24"}
    # Tensors here are tiny, and on a busy machine the threads of two pools cost more time than all
    # tests together.
    os.environ["OMP_NUM_THREADS"] = "1"
    # Programs that tests start in other folders find this tree, and no other.
    paths = [str(Path(__file__).resolve().parents[1]), os.environ.get("PYTHONPATH", "")]
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, paths))


_set_environment()

import torch  # noqa: E402 -- it reads the environment once

from mute.support.threads import usable_cores  # noqa: E402 -- with numpy, which does so as well

# A slow machine is no fault, and the same examples are drawn everywhere.
hypothesis.settings.register_profile(
    "everywhere",
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
hypothesis.settings.load_profile("everywhere")

_FOUND = torch.get_num_threads(), torch.get_float32_matmul_precision()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Return how many processes `-n auto` means: one a core, within limits; 0 for none of its own.

    The cores are those that the affinity mask and a container's quota leave.

    A file's tests stay together, so that what names files needs no more processes than files.
    """
    workers = min(usable_cores(), _MOST_WORKERS)
    places = {argument.split("::")[0] for argument in config.args}
    if all(place.endswith(".py") for place in places):
        workers = min(workers, len(places))
    return workers if workers > 1 else 0


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the longest files first and leave the order as it is elsewhere."""
    places = {name: place for place, name in enumerate(_LONGEST)}
    items.sort(key=lambda item: places.get(item.path.name, len(places)))


@pytest.fixture(autouse=True, scope="session")
def _signals_act() -> Iterator[None]:
    """Let signals act, on the tests and what they start, that were ignored or blocked before.

    A shell starts a job in the background with SIGINT ignored, and nohup does so with SIGHUP; both
    are passed on to children.
    """
    ignored = {
        number: signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL
        for number in signal.valid_signals()
        if signal.getsignal(number) == signal.SIG_IGN
        and signal.Signals(number).name not in _KEPT_IGNORED
    }
    for number, handler in ignored.items():
        signal.signal(number, handler)
    blocked = signal.pthread_sigmask(signal.SIG_SETMASK, ())
    yield
    signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
    for number in ignored:
        signal.signal(number, signal.SIG_IGN)


@pytest.fixture(autouse=True)
def _restore_torch_settings() -> Iterator[None]:
    """Put back what a training run sets for its whole process, in a test or in its fixtures."""
    _reset_torch()
    yield
    _reset_torch()


def _reset_torch() -> None:
    threads, precision = _FOUND
    torch.set_num_threads(threads)
    torch.set_float32_matmul_precision(precision)
