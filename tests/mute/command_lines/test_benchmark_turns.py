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
    take_blocks,
    times_of,
)
from mute.support import threads
from mute.support.errors import MuteError
from mute.tasks import FLAT_TASK


@pytest.fixture(scope="module")
def training():
    training = benchmark_worker._Training(FLAT_TASK, 4)
    # The engine alone is not pushed.
    training.runner.env.env.cfg.randomization.push_interval = 0.0
    return training


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
    flags = replay._batch._batch.model.opt.disableflags
    assert flags == simulation._batch.model.opt.disableflags  # of one and the same model
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
        # What engine and environment do again is the rollout of the loop before them.
        assert {part for part, _ in order[:2]} == {"loop"}
        assert len(set(order)) == len(order) == 8
        assert all(order[at][0] == order[at + 1][0] for at in range(0, 8, 2))


def test_no_part_comes_after_another_more_often_than_before_it():
    orders = list(itertools.islice(shuffled_orders(["new", "old"], 3), 40))
    assert len({tuple(order) for order in orders}) > 20
    pairs = [*itertools.combinations(orders[0][:2], 2), *itertools.combinations(orders[0][2:], 2)]
    for one, two in pairs:
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
        self.ready = {"name": name}
        self.open = False
        self._calls = itertools.count()

    def __enter__(self):
        self.open = True
        return self

    def __exit__(self, *exc: object) -> None:
        self.open = False

    def time(self, part: str) -> dict[str, float]:
        return {part: float(next(self._calls))}


def _counted_blocks(turns: int, begun: list[list[_Counted]]):
    def begin(number: int) -> list[_Counted]:
        assert number == len(begun)
        begun.append([_Counted("new"), _Counted("old")])
        return begun[-1]

    return take_blocks(begin, turns, 0)  # pyright: ignore[reportArgumentType]


def test_the_first_turn_of_a_block_is_no_figure():
    for number, blocks in enumerate(itertools.islice(_counted_blocks(1, []), 3)):
        assert len(blocks) == number + 1
        for of_version in blocks[-1].times.values():
            # The first turn took the answers 0 to 3.
            assert sorted(second for (second,) in of_version.values()) == [4.0, 5.0, 6.0, 7.0]


def test_each_block_has_its_turns_from_workers_of_its_own_and_ends_them():
    begun: list[list[_Counted]] = []
    taken = _counted_blocks(2, begun)
    sizes = [[block.turns for block in blocks] for blocks in itertools.islice(taken, 5)]
    assert sizes == [[1], [2], [2, 1], [2, 2], [2, 2, 1]]
    assert [[worker.open for worker in workers] for workers in begun] == [
        [False, False],
        [False, False],
        [True, True],
    ]
    taken.close()
    assert not any(worker.open for worker in begun[-1])


def test_times_are_told_by_version_and_part_block_by_block():
    blocks = next(itertools.islice(_counted_blocks(2, []), 3, None))
    times = times_of(blocks)
    assert set(times) == {"new", "old"}
    for of_version in times.values():
        assert set(of_version) == {"loop", "engine", "nominal_engine", "environment"}
        assert [len(block) for block in of_version["loop"]] == [2, 2]
    assert times["new"]["loop"][0] == [4.0, 8.0]  # the loop comes first in its turn


def test_a_worker_does_each_part_and_says_what_it_is():
    with Worker(THIS, FLAT_TASK, 4) as worker:
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
    for task, num_envs, told in (("fly", 4, "'fly'"), (FLAT_TASK, 2, "env.num_envs")):
        expected = rf"^the new version: .*{told}"
        with pytest.raises(MuteError, match=expected), Worker(THIS, task, num_envs):
            pass


def test_a_tree_that_lacks_a_part_is_told_and_not_completed_from_another_one(tmp_path):
    (tmp_path / "mute").mkdir()
    (tmp_path / "mute" / "__init__.py").touch()
    version = Version("old", sys.executable, tmp_path)
    with pytest.raises(MuteError) as caught, Worker(version, FLAT_TASK, 2):
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
    with pytest.raises(MuteError) as caught, Worker(version, FLAT_TASK, 2):
        pass
    assert str(caught.value) == f"the process of the old version {told}"


def test_workers_end_with_whoever_is_interrupted_beside_them(tmp_path):
    ready = json.dumps({"ready": {"engine": "none"}})
    version = other_version(_program(tmp_path, f"echo '{ready}'; cat > /dev/null"))
    with pytest.raises(KeyboardInterrupt), Worker(version, FLAT_TASK, 2) as worker:
        assert worker.ready == {"engine": "none"}
        assert worker._process.poll() is None
        raise KeyboardInterrupt
    assert worker._process.poll() is not None


def test_a_worker_trains_with_the_seed_that_it_is_given():
    one, other = (benchmark_worker._Training(FLAT_TASK, 4, seed) for seed in (3, 4))
    assert one.runner.env.env.cfg.seed == 3
    fields = (each.runner.env.env.simulation.field("geom_friction") for each in (one, other))
    assert not torch.equal(*fields)


def test_the_engine_fills_and_records_what_it_does_in_a_training(training, replay):
    training.iterate()
    replay.engine()
    batch, simulation = replay._batch, training.runner.env.env.simulation
    assert set(batch._records) == {"sensordata"} == set(simulation.substeps)
    records = torch.from_numpy(batch._records["sensordata"])
    assert records.shape == simulation.substeps["sensordata"].shape
    # Whose episode ended goes on elsewhere.
    whole = ~training.runner.alg.storage.dones[..., 0].bool().any(dim=0)
    assert whole.any()
    expected = simulation.substeps["sensordata"]
    torch.testing.assert_close(records[whole], expected[whole], atol=0.2, rtol=1e-2)
    assert torch.equal(records[:, -1], torch.from_numpy(batch._read[0].copy()))


def test_a_number_of_threads_that_nobody_asked_for_is_left_to_each_version(monkeypatch):
    monkeypatch.setattr(threads, "_own", {"OMP_NUM_THREADS": "2"})
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    assert "OMP_NUM_THREADS" not in THIS.environ()
    monkeypatch.setattr(threads, "_own", {})
    assert THIS.environ()["OMP_NUM_THREADS"] == "2"


def test_another_version_finds_its_own_tree_alone(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", "/mine")
    monkeypatch.setenv("OMP_WAIT_POLICY", "passive")
    own, other = THIS.environ(), other_version(f"{sys.executable}:{REPOSITORY}/mute/..").environ()
    assert own["PYTHONPATH"] == os.pathsep.join([str(REPOSITORY), "/mine"])
    assert other["PYTHONPATH"] == f"{REPOSITORY}/mute/.."
    assert "PYTHONPATH" not in other_version(sys.executable).environ()
    assert "OMP_WAIT_POLICY" not in other
