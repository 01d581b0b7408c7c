"""Every field of a configuration is applied where a run is resumed, or refused with its name."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import pytest
import torch
from learning_helpers import make_cfg, make_runner

from mute.checkpoint import CheckpointError, load_checkpoint, save_checkpoint
from mute.config import PPOCfg, TaskCfg, from_plain, to_plain
from mute.learning.resumption import RULES, check_resumption, flat_fields, rule_of
from mute.learning.runner import MuteRunner
from mute.tasks import make_task

_OTHER_WORDS = {
    "env.engine": "mujoco",
    "env.scene.integrator": "euler",
    "env.scene.cone": "elliptic",
    "env.scene.solver": "cg",
    "env.scene.look": "menagerie",
    "env.rewards.phase_source": "true",
    "agent.activation": "relu",
    "agent.matmul_precision": "high",
    "agent.ppo.schedule": "fixed",
    "agent.estimation.network.activation": "relu",
}
"""Other values of the fields that hold words."""


def _other(path: str, value: Any) -> Any:
    """Return another value of a field, in its range; the same where there is none to be had."""
    if path in _OTHER_WORDS:
        return _OTHER_WORDS[path]
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return value + 1
    if isinstance(value, float):
        return 0.9 * value if value else 0.01
    if isinstance(value, list):
        return [_other(path, item) for item in value]
    return value


def _changed(cfg: TaskCfg, paths: list[str]) -> TaskCfg:
    """Return a configuration of which some fields have other values."""
    plain = to_plain(cfg)
    for path in paths:
        *parents, name = path.split(".")
        part = plain
        for parent in parents:
            part = part[parent]
        part[name] = _other(path, part[name])
    return from_plain(plain)


def _paths(*rules: str) -> list[str]:
    return [path for path in flat_fields(make_cfg()) if rule_of(path) in rules]


@pytest.fixture(scope="module")
def saved(tmp_path_factory) -> Path:
    """The checkpoint of a run of one iteration."""
    directory = tmp_path_factory.mktemp("run")
    make_runner(directory, iterations=1).train()
    return directory / "model_0.pt"


@pytest.mark.parametrize("task", ["go1_mute", "go1_mute_paper"])
def test_every_field_has_a_rule_and_every_rule_a_field(task):
    paths = list(flat_fields(make_task(task)))
    assert [path for path in paths if rule_of(path) is None] == []
    parts = {".".join(path.split(".")[:depth]) for path in paths for depth in range(1, 6)}
    assert RULES.keys() - parts == set()


def test_no_rule_covers_the_environment_or_the_agent_as_a_whole():
    assert {rule.count(".") for rule in RULES} >= {1, 2}
    assert not {"env", "agent", ""} & RULES.keys()


@pytest.mark.parametrize("path", _paths("kept", "robots"))
def test_a_field_that_cannot_be_applied_is_refused_with_its_name_and_both_values(path):
    old, new = make_cfg(), make_cfg()
    parent, name = new, path.split(".")
    for part in name[:-1]:
        parent = parent[part] if isinstance(parent, dict) else getattr(parent, part)
    before = flat_fields(old)[path]
    after = _other(path, list(before) if isinstance(before, tuple) else before)
    if isinstance(parent, dict):
        parent[name[-1]] = after
    else:
        object.__setattr__(parent, name[-1], after)
    if before == () or before == after:
        object.__setattr__(parent, name[-1], (after := ("another",)))
    with pytest.raises(ValueError) as caught:
        check_resumption(old, new, robots_anew=False)
    assert str(caught.value) == f"{path}: a resumed run keeps {before!r}, got {after!r}"


@pytest.mark.parametrize("path", _paths("robots"))
def test_what_belongs_to_the_robots_alone_may_change_where_they_begin_anew(path):
    asked = make_cfg()
    asked.env = dataclasses.replace(asked.env, num_envs=4)
    check_resumption(make_cfg(), asked, robots_anew=True)
    with pytest.raises(ValueError, match=r"env\.num_envs: a resumed run keeps 8, got 4"):
        check_resumption(make_cfg(), asked, robots_anew=False)


def test_all_that_can_be_applied_is_applied_at_once_and_the_run_goes_on(saved, tmp_path):
    paths = _paths("applied")
    asked = _changed(make_cfg(iterations=1), paths)
    old, new = flat_fields(make_cfg(iterations=1)), flat_fields(asked)
    unchanged = [path for path in paths if old[path] == new[path]]
    assert {path.rpartition(".")[2] for path in unchanged} <= {"function", "group"}
    runner = MuteRunner("go1_mute", asked, tmp_path)
    runner.load(str(saved))
    assert runner.env.cfg == asked.env
    for field in dataclasses.fields(PPOCfg):
        assert getattr(runner.alg, field.name) == getattr(asked.agent.ppo, field.name), field.name
    rates = [group["lr"] for group in runner.alg.optimizer.param_groups]
    assert rates == [asked.agent.ppo.learning_rate]
    assert runner.alg.trainer.optimizer.param_groups[0]["lr"] == pytest.approx(9e-4)
    assert runner.alg.actor.distribution is not None
    assert runner.alg.actor.distribution.std_range == list(asked.agent.std_range)
    assert runner.train()
    assert from_plain(load_checkpoint(tmp_path / "model_1.pt")["config"]) == asked


def _with_current_rate(saved: Path, path: Path, rate: float) -> None:
    """Write a checkpoint to which the adaptive schedule has given another learning rate."""
    content = load_checkpoint(saved)
    content["optimizer_state_dict"]["param_groups"][0]["lr"] = rate
    save_checkpoint(path, content)


@pytest.mark.parametrize(
    ("asked", "schedule", "expected"),
    [(1e-3, "adaptive", 4e-4), (1e-6, "adaptive", 1e-6), (1e-3, "fixed", 1e-3)],
)
def test_the_schedules_learning_rate_goes_on_unless_another_is_asked_for(
    asked, schedule, expected, saved, tmp_path
):
    _with_current_rate(saved, tmp_path / "model_0.pt", 4e-4)
    cfg = make_cfg()
    cfg.agent.ppo = dataclasses.replace(cfg.agent.ppo, learning_rate=asked, schedule=schedule)
    runner = MuteRunner("go1_mute", cfg, None)
    runner.load(str(tmp_path / "model_0.pt"))
    assert runner.alg.learning_rate == expected
    assert [group["lr"] for group in runner.alg.optimizer.param_groups] == [expected]


def test_a_smaller_learning_rate_of_the_estimator_moves_it_less(saved):
    moved = []
    for rate in (1e-3, 1e-6):
        cfg = make_cfg()
        cfg.agent.estimation = dataclasses.replace(cfg.agent.estimation, learning_rate=rate)
        runner = MuteRunner("go1_mute", cfg, None)
        runner.load(str(saved))
        before = runner.env.estimator.lstm.weight_hh.detach().clone()
        runner.train()
        moved.append(float((runner.env.estimator.lstm.weight_hh.detach() - before).abs().max()))
    assert moved[0] > 1e-4
    assert 0.0 < moved[1] < 1e-5


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"agent": {"activation": "relu"}}, "agent.activation: a resumed run keeps 'elu', got"),
        ({"agent": {"init_std": 0.5}}, "agent.init_std: a resumed run keeps 1.0, got 0.5"),
        ({"env": {"decimation": 2}}, "env.decimation: a resumed run keeps 4, got 2"),
    ],
)
def test_the_runner_refuses_in_one_line_and_takes_nothing_over(change, words, saved):
    plain = to_plain(make_cfg())
    for part, fields in change.items():
        plain[part] |= fields
    runner = MuteRunner("go1_mute", from_plain(plain), None)
    before = [value.clone() for value in runner.alg.actor.parameters()]
    with pytest.raises(CheckpointError) as caught:
        runner.load(str(saved))
    assert "does not fit this configuration" in str(caught.value)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
    assert all(map(torch.equal, before, runner.alg.actor.parameters()))
