"""Tests of the benchmark's processes: whose turn it is, what they do again, and how they end."""

from __future__ import annotations

import itertools
import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from places import REPOSITORY

from mute.command_lines import benchmark_worker
from mute.command_lines.benchmark_turns import (
    THIS,
    Version,
    Worker,
    other_version,
    shuffled_orders,
    take_turns,
)
from mute.support.errors import MuteError
from mute.tasks import DEFAULT_TASK


@pytest.fixture(scope="module")
def training():
    return benchmark_worker._Training(DEFAULT_TASK, 4)


@pytest.fixture(scope="module")
def replay(training):
    return benchmark_worker._Replay(training)


def _program(folder: Path, script: str) -> str:
    """Make a program that takes the place of an interpreter."""
    path = folder / "python"
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)
    return str(path)


_QPOS = slice(1, 20)
"""Where a state has the positions: after the time."""


def test_engine_and_environment_do_again_what_the_training_did(training, replay):
    simulation = training.runner.env.env.simulation
    for _ in range(2):  # the second rollout begins where the first one ended
        training.iterate()
        storage = training.runner.alg.storage
        assert not storage.dones.any()  # what is placed anew has no physics to compare
        replay.environment()
        assert torch.equal(replay._env.simulation.qpos, simulation.qpos)
        replay.engine()
        qpos = torch.from_numpy(replay._batch.state[:, _QPOS].copy()).float()
        torch.testing.assert_close(qpos, simulation.qpos, atol=1e-3, rtol=1e-3)
    friction = simulation.field("geom_friction").numpy()
    assert (replay._batch._batch.expand("geom_friction") == friction).all()
    assert friction.std() > 0.0


def test_the_engine_goes_on_with_a_robot_that_stands_where_an_episode_ended(training, replay):
    env, batch = training.runner.env.env, replay._batch
    actions = 0.4 * torch.randn(4, 4, 12, generator=torch.Generator().manual_seed(0))
    ended = np.zeros((4, 4), dtype=bool)
    ended[3, 1] = True
    replay._batch.state[:] = training.before["simulation"]["integration"].numpy()
    batch.time(env, actions, ended)
    standing = batch.state[:, _QPOS]
    np.testing.assert_allclose(standing[1], env.model.key("stand").qpos, atol=1e-12)
    assert abs(standing[0, 2] - standing[1, 2]) > 1e-6


def test_nominal_robots_do_the_same_in_every_turn(replay):
    states = []
    for _ in range(2):
        replay.nominal_engine()
        states.append(replay._nominal.state.copy())
    np.testing.assert_allclose(states[0], states[1], rtol=1e-9, atol=1e-9)
    assert np.abs(states[0][:, _QPOS] - replay._nominal.standing[_QPOS]).max() > 1e-3


def test_a_turn_has_every_part_of_every_version_once_and_the_versions_side_by_side():
    for order in itertools.islice(shuffled_orders(["new", "old"], 0), 20):
        assert len(set(order)) == len(order) == 8
        assert all(order[at][0] == order[at + 1][0] for at in range(0, 8, 2))


def test_no_part_comes_after_another_more_often_than_before_it():
    orders = list(itertools.islice(shuffled_orders(["new", "old"], 3), 40))
    assert len({tuple(order) for order in orders}) > 20
    for one, two in itertools.combinations(orders[0], 2):
        assert sum(order.index(one) < order.index(two) for order in orders) == 20


def test_the_order_is_that_of_the_seed():
    first, again, other = (
        list(itertools.islice(shuffled_orders(["new"], seed), 6)) for seed in (0, 0, 1)
    )
    assert first == again
    assert first != other


class _Counted:
    """Stands in for a worker: its n-th answer is n seconds."""

    def __init__(self, name: str) -> None:
        self.version = Version(name, "python", None)
        self._calls = itertools.count()

    def time(self, part: str) -> dict[str, float]:
        return {part: float(next(self._calls))}


def test_the_first_turn_is_no_figure():
    workers = [_Counted("new"), _Counted("old")]
    times = next(take_turns(workers, 0))  # pyright: ignore[reportArgumentType]
    for of_version in times.values():
        # The first turn took the answers 0 to 3.
        assert sorted(seconds for (seconds,) in of_version.values()) == [4.0, 5.0, 6.0, 7.0]


def test_a_worker_does_each_part_and_says_what_it_is():
    with Worker(THIS, DEFAULT_TASK, 4) as worker:
        assert worker.ready["control_steps"] == 96
        assert worker.ready["peak_memory_mb"] > 100.0
        loop = worker.time("loop")
        assert set(loop) == {"collection", "learning", "loop"}
        for part in ("engine", "nominal_engine", "environment"):
            assert worker.time(part)[part] > 0.0
        process = worker._process
        process.kill()
        with pytest.raises(MuteError, match="new version was ended by signal 9"):
            worker.time("engine")
    assert process.returncode == -9


def test_what_a_worker_cannot_do_is_told_in_its_words():
    for task, num_envs, told in (("fly", 4, "'fly'"), (DEFAULT_TASK, 2, "env.num_envs")):
        expected = rf"^the new version: .*{told}"
        with pytest.raises(MuteError, match=expected), Worker(THIS, task, num_envs):
            pass


def test_a_tree_that_lacks_a_part_is_told_and_not_completed_from_another_one(tmp_path):
    (tmp_path / "mute").mkdir()
    (tmp_path / "mute" / "__init__.py").touch()
    version = Version("old", sys.executable, tmp_path)
    with pytest.raises(MuteError) as caught, Worker(version, DEFAULT_TASK, 2):
        pass
    # The second is where MUTE is installed for development.
    told = "the process of the old version ended with status 1: "
    missing, foreign = "ModuleNotFoundError: No module named 'mute.support'", "mute.support is none"
    assert str(caught.value).startswith((told + missing, told + foreign))


@pytest.mark.parametrize(
    ("script", "told"),
    [
        ("echo broken >&2; exit 3", "ended with status 3: broken"),
        ("exit 3", "ended with status 3"),
        ("kill -9 $$", "was ended by signal 9"),
        ("echo hello; cat", "printed 'hello' where an answer was due"),
    ],
)
def test_a_worker_that_dies_is_told_in_one_line(tmp_path, script, told):
    version = other_version(_program(tmp_path, script))
    with pytest.raises(MuteError) as caught, Worker(version, DEFAULT_TASK, 2):
        pass
    assert str(caught.value) == f"the process of the old version {told}"


def test_workers_end_with_whoever_is_interrupted_beside_them(tmp_path):
    ready = json.dumps({"ready": {"engine": "none"}})
    version = other_version(_program(tmp_path, f"echo '{ready}'; cat > /dev/null"))
    with pytest.raises(KeyboardInterrupt), Worker(version, DEFAULT_TASK, 2) as worker:
        assert worker.ready == {"engine": "none"}
        assert worker._process.poll() is None
        raise KeyboardInterrupt
    assert worker._process.poll() is not None


def test_another_version_finds_its_own_tree_alone(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", "/mine")
    monkeypatch.setenv("OMP_WAIT_POLICY", "passive")
    own, other = THIS.environ(), other_version(f"{sys.executable}:{REPOSITORY}/mute/..").environ()
    assert own["PYTHONPATH"] == os.pathsep.join([str(REPOSITORY), "/mine"])
    assert other["PYTHONPATH"] == f"{REPOSITORY}/mute/.."
    assert "PYTHONPATH" not in other_version(sys.executable).environ()
    assert "OMP_WAIT_POLICY" not in other
