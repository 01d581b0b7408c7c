"""One number decides how many threads run, and they wait passively; what the user set is kept."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest
from places import REPOSITORY

from mute.support import threads

NAMES = (
    *("OMP_WAIT_POLICY", "GOMP_SPINCOUNT", "OMP_NUM_THREADS", "LOCAL_WORLD_SIZE"),
    "PYTHON_CPU_COUNT",
)

linux = pytest.mark.skipif(sys.platform != "linux", reason="threads are counted in /proc")

_POOL_NAMES = ("operators", "learning", "collection", "physics of 2", "physics")

REPORT = f"""
import json, os, sys
from mute.support.threads import configure_threads
configure_threads()
settings = {{name: os.environ.get(name) for name in {NAMES}}}
print(json.dumps([settings, "torch" in sys.modules]))
"""


_POOLS = """
import json, os, sys
given = json.loads(sys.argv[1])
if "affinity" in given:
    os.sched_setaffinity(0, given["affinity"])
from mute.support import threads
if "cores" in given:
    threads._allowed_cores = lambda: given["cores"]
    threads.cpu_quota = lambda: given["quota"]
threads.configure_threads()
import mujoco, torch
from mute.envs.engines import make_simulation
threads.limit_operator_threads()
first, used = torch.get_num_threads(), {"operators": torch.get_num_interop_threads()}
threads.use_learning_threads()
used["learning"] = torch.get_num_threads()
threads.use_collection_threads()
used["collection"] = torch.get_num_threads()
model = mujoco.MjModel.from_xml_string(
    "<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>"
)
def step(num_envs, num_threads):
    simulation = make_simulation(model, num_envs, num_threads=num_threads)
    simulation.step()
    return simulation, len(os.listdir("/proc/self/task"))
one, before = step(8, 1)
# The thread that calls is one of the pool's.
few, few_after = step(2, 0)
many, many_after = step(8, 0)
used |= {"physics of 2": 1 + few_after - before, "physics": 1 + many_after - few_after}
print(json.dumps([first, used]))
"""


def _pools(
    environment: dict[str, str] | None = None, **given: object
) -> tuple[int, dict[str, int]]:
    """Return how many threads torch has in a fresh process as it is loaded, and each pool then.

    As it is loaded, torch takes no more than the machine has.

    Args:
        environment: Variables to set.
        given: `affinity`, processors that it is bound to; or `cores` and `quota`, what it finds.
    """
    variables = {key: value for key, value in os.environ.items() if key not in NAMES}
    output = subprocess.run(
        [sys.executable, "-c", _POOLS, json.dumps(given)],
        cwd=REPOSITORY,
        env=variables | (environment or {}),
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    first, used = json.loads(output)
    return first, used


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
    assert _configure(OMP_NUM_THREADS="3")[0]["OMP_NUM_THREADS"] == "3"
    assert _configure(OMP_NUM_THREADS="3,2")[0]["OMP_NUM_THREADS"] == "3,2"


@pytest.mark.parametrize("given", [{}, {"OMP_NUM_THREADS": ""}, {"OMP_NUM_THREADS": "all"}])
def test_where_the_user_has_set_no_number_openmp_gets_the_processors_of_the_process(given):
    assert _configure(**given)[0]["OMP_NUM_THREADS"] == str(threads.usable_cores())


@linux
def test_a_process_bound_to_one_processor_runs_one_thread_a_pool():
    cores = [min(os.sched_getaffinity(0))]
    assert _pools(affinity=cores) == (1, dict.fromkeys(_POOL_NAMES, 1))


@linux
def test_a_container_with_the_time_of_one_processor_runs_one_thread_a_pool():
    assert _pools(cores=64, quota=1.0) == (1, dict.fromkeys(_POOL_NAMES, 1))


@linux
@pytest.mark.parametrize(("quota", "expected"), [(None, 5), (3.0, 3), (64.0, 5)])
def test_a_quota_decides_for_every_pool_where_it_is_less_than_the_processors(quota, expected):
    _, used = _pools(cores=5, quota=quota)
    assert used == dict.fromkeys(_POOL_NAMES, expected) | {"collection": 1, "physics of 2": 2}


@linux
def test_processes_that_torchrun_started_share_every_pool():
    ranks = {"LOCAL_WORLD_SIZE": "2", "OMP_NUM_THREADS": "1"}  # both as torchrun sets them
    _, used = _pools(ranks, cores=6, quota=None)
    assert used == dict.fromkeys(_POOL_NAMES, 3) | {"collection": 1, "physics of 2": 2}


@linux
def test_a_users_number_of_threads_for_torch_wins_and_leaves_the_physics_its_own():
    _, used = _pools({"OMP_NUM_THREADS": "4"}, cores=3, quota=None)
    torchs = {"operators": 4, "learning": 4, "collection": 1}
    assert used == torchs | {"physics of 2": 2, "physics": 3}


@pytest.mark.parametrize(
    ("quota", "expected"),
    [(None, 8), (0.1, 1), (0.5, 1), (1.0, 1), (1.25, 1), (1.5, 2), (2.0, 2), (2.4, 2), (9.0, 8)],
)
def test_a_quota_counts_as_the_nearest_number_of_processors_and_at_least_one(
    quota, expected, monkeypatch
):
    monkeypatch.setattr(threads, "_allowed_cores", lambda: 8)
    monkeypatch.setattr(threads, "cpu_quota", lambda: quota)
    assert threads.usable_cores() == expected


def test_the_number_of_processors_that_the_user_tells_python_is_taken(monkeypatch):
    monkeypatch.setattr(threads, "cpu_quota", lambda: None)
    monkeypatch.setattr(os, "process_cpu_count", lambda: 3, raising=False)
    assert threads.usable_cores() == 3


def test_where_there_is_neither_mask_nor_quota_all_processors_count(monkeypatch):
    monkeypatch.setattr(threads, "cpu_quota", lambda: None)
    monkeypatch.delattr(os, "process_cpu_count", raising=False)
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 12)
    assert threads.usable_cores() == 12


@pytest.mark.parametrize(
    ("processes", "limit", "expected"),
    [
        ("", "", 16),
        ("", "1", 1),
        ("8", "", 2),
        ("8", "1", 2),  # torchrun's own setting
        ("8", "3", 3),
        ("8", "3,1", 3),
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
