"""Tests of the benchmark and of the files of a release."""

from __future__ import annotations

import dataclasses
import json
import math
import sys

import numpy as np
import pytest
import torch
from bare_go1 import BareGo1
from mujoco.batch import Batch

from mute import tasks
from mute.command_lines import benchmark
from mute.envs.quadruped_env import NUM_ACTIONS, QuadrupedEnv
from mute.envs.scene import STAND_JOINT_POS, build_scene
from mute.support import provenance
from mute.support.errors import MuteError
from mute.tasks import DEFAULT_TASK, make_task


def test_the_benchmark_prints_the_rates_of_every_part_as_json(capsys):
    peers = ["--peers", "gymnasium,mjlab", "--mjlab-python", "/nowhere/python"]
    assert benchmark.main(["--num-envs", "4", "--rollouts", "1", "--json", *peers]) == 0
    content = json.loads(capsys.readouterr().out)
    (rates,) = content["rates"]
    assert (rates["num_envs"], rates["rollouts"]) == (4, 1)
    names = ("engine", "nominal_engine", "environment", "collection", "learning", "loop")
    parts = [rates[name] for name in names]
    assert all(rate > 0.0 for rate in parts)
    # The loop is collection and learning, one after the other.
    assert 1.0 / rates["loop"] == pytest.approx(1.0 / rates["collection"] + 1.0 / rates["learning"])
    for name in ("environment", "collection", "learning", "loop"):
        assert rates[f"{name}_over_engine"] == pytest.approx(rates[name] / rates["engine"])
    assert rates["peak_memory_mb"] > 100.0
    itself, gymnasium, mjlab = content["peers"]
    assert [peer["name"] for peer in content["peers"]] == ["mute", "gymnasium", "mjlab"]
    assert (itself["num_envs"], itself["task"]) == (4, "go1_mute")
    assert min(itself["environment"], itself["loop"], gymnasium["environment"]) > 0.0
    assert gymnasium["over_mute"]["environment"] > 0.0
    assert gymnasium["version"].startswith("1.")
    assert (gymnasium["num_envs"] % 4, gymnasium["loop"]) == (0, None)
    told = "/nowhere/python does not start: No such file or directory"
    assert (mjlab["environment"], mjlab["note"]) == (None, told)


@pytest.fixture
def _own_task(tmp_path, monkeypatch):
    """Work in a folder with a module that registers a task, and forget both afterwards."""
    (tmp_path / "mute_own_walk.py").write_text(
        "from mute.tasks import make_task, register_task\n"
        "register_task('own_walk', lambda: make_task('go1_mute'))\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(tasks, "_TASKS", dict(tasks._TASKS))
    yield
    sys.modules.pop("mute_own_walk", None)


@pytest.mark.usefixtures("_own_task")
def test_a_task_of_a_users_own_module_is_measured_in_every_process(capsys):
    argv = ["--task", "mute_own_walk:own_walk", "--num-envs", "4", "--rollouts", "1", "--json"]
    assert benchmark.main([*argv, "--peers", "gymnasium"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["task"] == "own_walk"
    assert content["rates"][0]["loop"] > 0.0
    assert content["peers"][1]["environment"] > 0.0


def test_engine_and_environment_do_again_what_the_training_did():
    task = make_task(DEFAULT_TASK)
    cfg = dataclasses.replace(task.env, num_envs=3)
    env = QuadrupedEnv(cfg)
    replay = benchmark._Replay(env)
    generator = torch.Generator().manual_seed(0)
    actions = 0.5 * torch.randn(20, 3, NUM_ACTIONS, generator=generator)
    actions[3, 0, :2] = torch.tensor([math.nan, 50.0])  # what the environment clips
    for _ in range(2):  # the second one starts where the first one ended
        before = env.state_dict()
        for action in actions:
            # Resets are the environment's alone.
            assert not env.step(action)[2].any()
        replay.load(before, actions)
        replay.engine()
        replay.environment()
        assert torch.equal(replay._env.simulation.qpos, env.simulation.qpos)
        qpos = torch.from_numpy(replay._physics.batch.bind("qpos")).float()
        torch.testing.assert_close(qpos, env.simulation.qpos, atol=1e-4, rtol=1e-4)
    friction = env.simulation.field("geom_friction").numpy()
    assert (replay._physics.batch.expand("geom_friction") == friction).all()
    assert friction.std() > 0.0


def test_a_part_is_compared_with_the_engine_turn_by_turn():
    # Turns say 1/2, 1/6 and 1/2; the medians of the times, 1 and 6, would say 1/6.
    assert benchmark._median_ratio([1.0, 1.0, 3.0], [2.0, 6.0, 6.0]) == 0.5


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        (["--num-envs", "0"], "--num-envs"),
        (["--rollouts", "0"], "--rollouts"),
        (["--task", "fly"], "--task"),
        (["--peers", "isaac"], "--peers"),
        (["--peers", "mjlab,mjlab"], "--peers"),
    ],
)
def test_the_benchmark_refuses_bad_input_by_name(arguments, names):
    with pytest.raises(MuteError, match=names):
        benchmark.main(arguments)


def test_the_robots_of_gymnasium_move_as_those_of_the_engine():
    cfg = make_task(DEFAULT_TASK).env
    model = build_scene(cfg.scene, pictured=False)
    batch = Batch(model, 1)
    ctrl, qpos = batch.bind("ctrl"), batch.bind("qpos")
    batch.reset(keyframe=model.key("stand").id)
    robot = BareGo1(cfg)
    start, _ = robot.reset(seed=0)
    observation = start
    for action in 0.1 * np.random.default_rng(0).standard_normal((20, NUM_ACTIONS)):
        ctrl[:] = np.add(STAND_JOINT_POS, action)
        batch.step(nstep=cfg.decimation)
        observation, *_ = robot.step(action)
    np.testing.assert_allclose(observation[: model.nq], qpos[0], atol=1e-9)
    assert np.abs(observation - start).max() > 0.05


def test_the_machine_is_told_with_its_cores():
    assert "cores" in provenance.machine_kind()
