"""What a checkpoint holds has the form of what would be saved, or nothing of it is taken over."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import torch
from learning_helpers import clone_tree, differences, everything, make_runner

from mute.checkpoint import CheckpointError, load_checkpoint, save_checkpoint
from mute.controllers import load_policy
from mute.learning import runner as runner_module
from mute.learning.runner import MuteRunner
from mute.learning.saved_state import check_form

Place = tuple[Any, ...]


@pytest.fixture(scope="module")
def saved(tmp_path_factory) -> dict[str, Any]:
    """What a run of three iterations saved."""
    directory = tmp_path_factory.mktemp("run")
    make_runner(directory, iterations=3).train()
    return load_checkpoint(directory / "model_2.pt")


@pytest.fixture(scope="module")
def fresh() -> MuteRunner:
    """A run that has not begun; what it refuses changes nothing of it."""
    return make_runner(iterations=9)


def _leaves(tree: Any, place: Place = ()) -> Iterator[Place]:
    """Yield the place of every value that holds no others."""
    items = tree.items() if isinstance(tree, dict) else enumerate(tree)
    for key, value in items:
        if isinstance(value, dict | list | tuple) and len(value):
            yield from _leaves(value, (*place, key))
        else:
            yield (*place, key)


def _replaced(tree: dict[str, Any], place: Place, new: Any) -> dict[str, Any]:
    """Return a copy with another value at a place; `...` removes it."""
    tree = clone_tree(tree)
    part = tree
    for key in place[:-1]:
        part = part[key]
    if new is ...:
        del part[place[-1]]
    else:
        part[place[-1]] = new
    return tree


def _refusal(runner: MuteRunner, content: dict[str, Any], monkeypatch) -> str:
    monkeypatch.setattr(runner_module, "load_checkpoint", lambda *_: content)
    with pytest.raises(CheckpointError) as caught:
        runner.load("model_2.pt")
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith("model_2.pt does not fit this configuration: ")
    return message


def test_nothing_that_a_run_goes_on_from_may_be_another_kind_of_thing(saved, fresh, monkeypatch):
    before = everything(fresh)
    places = [
        place
        for place in _leaves(saved)
        if place[0] not in ("config", "task")
        and place != ("cuda_random_state",)
        # Settings of Adam that are not taken over.
        and not ("param_groups" in place and place[-1] != "lr" and "params" not in place)
    ]
    assert len(places) > 150
    for place in places:
        message = _refusal(fresh, _replaced(saved, place, "junk"), monkeypatch)
        assert len(message) < 300, message
    assert differences(everything(fresh), before) == []


@pytest.mark.parametrize(
    ("place", "new", "words"),
    [
        (("iter",), ..., "iter is missing"),
        (("iter",), "2", "iter must be int, got '2'"),
        (("iter",), True, "iter must be int, got True"),
        (("iter",), -1, "iter must be >= 0, got -1"),
        (("infos",), ..., "infos is missing"),
        (("infos",), 3, "infos must be a mapping"),
        (("env",), ..., "env is missing"),
        (("logger",), ..., "logger is missing"),
        (("config",), ..., "config is missing"),
        (("env", "env", "step_count"), ..., "step_count"),
        (("env", "env", "step_count"), 2.0, "env.env.step_count must be int, got 2.0"),
        (("actor_state_dict",), [], "actor_state_dict must be a mapping, got a list"),
        (("actor_state_dict", "mlp.0.bias"), ..., "actor_state_dict.mlp.0.bias is missing"),
        (("actor_state_dict", "more"), torch.ones(1), "actor_state_dict.more is not known"),
        (
            ("critic_state_dict", "mlp.0.bias"),
            torch.zeros(16, dtype=torch.float64),
            "critic_state_dict.mlp.0.bias must be a tensor of torch.float32 and shape (16,), got "
            "torch.float64 and (16,)",
        ),
        (("critic_state_dict", "mlp.0.bias"), torch.zeros(1), "shape (16,), got torch.float32"),
        (
            ("critic_state_dict", "mlp.0.bias"),
            torch.full((16,), math.inf),
            "critic_state_dict.mlp.0.bias holds numbers that are not finite",
        ),
        (
            ("optimizer_state_dict", "param_groups", 0, "lr"),
            math.nan,
            "optimizer_state_dict.param_groups[0].lr must be > 0 and finite, got nan",
        ),
        (
            ("optimizer_state_dict", "state", 0, "exp_avg"),
            torch.zeros(1),
            "optimizer_state_dict.state[0].exp_avg must be a tensor",
        ),
        (
            ("optimizer_state_dict", "state", 99),
            {},
            "optimizer_state_dict.state[99] is of no parameter",
        ),
        (
            ("estimator_trainer", "past", "contact"),
            torch.zeros(8, 8, 4),
            "estimator_trainer.past.contact must be a tensor of torch.bool",
        ),
        (("estimator_trainer", "past", "obs"), torch.zeros(8), "estimator_trainer.past.obs"),
        (("logger", "rewards"), ["1.0"], "logger.rewards must be a list of numbers"),
        (("logger", "total_time"), "long", "logger.total_time must be float, got 'long'"),
        (("other_ranks",), 3, "other_ranks must be a list"),
    ],
    ids=lambda value: ".".join(map(str, value)) if isinstance(value, tuple) else None,
)
def test_the_place_of_what_does_not_fit_is_named(place, new, words, saved, fresh, monkeypatch):
    assert words in _refusal(fresh, _replaced(saved, place, new), monkeypatch)


@pytest.mark.parametrize(
    ("place", "new", "words"),
    [
        (("task",), ..., "task is missing"),
        (("task",), 3, "task must be str, got 3"),
        (("iter",), ..., "iter is missing"),
        (("iter",), "2", "iter must be int, got '2'"),
        (("config",), ..., "config is missing"),
        (("config",), [1], "configuration must be a dictionary, got list"),
        (("config", "env"), 3, "env"),
        (("config", "agent", "actor_hidden"), ["a"], "actor_hidden"),
        (("actor_state_dict",), ..., "actor_state_dict is missing"),
        (("actor_state_dict",), 1.0, "actor_state_dict must be a mapping, got a float"),
        (("actor_state_dict", "mlp.0.weight"), torch.zeros(1), "shape (16, "),
        (("actor_state_dict", "mlp.0.bias"), torch.zeros(16).int(), "got torch.int32"),
        (("actor_state_dict", "mlp.0.bias"), torch.full((16,), math.nan), "not finite"),
        (("estimator_state_dict", "lstm.bias_hh"), ..., "estimator_state_dict.lstm.bias_hh is"),
        (("estimator_state_dict", "lstm.bias_hh"), [0.0], "got a list"),
    ],
    ids=lambda value: ".".join(map(str, value)) if isinstance(value, tuple) else None,
)
def test_a_policy_that_does_not_fit_is_refused_with_the_place(place, new, words, saved, tmp_path):
    path = tmp_path / "policy.pt"
    save_checkpoint(path, _replaced(saved, place, new))
    with pytest.raises(CheckpointError) as caught:
        load_policy(path)
    message = str(caught.value)
    assert message.startswith(f"{path} holds no policy that fits this version: ")
    assert words in message
    assert "\n" not in message


def test_the_form_of_what_was_saved_is_that_of_what_is_saved(saved):
    check_form(saved, clone_tree(saved), "")


def test_where_not_all_is_asked_for_what_is_missing_or_more_does_not_count():
    own = {"a": torch.zeros(2), "b": 1.0}
    check_form({"b": 2, "c": "more"}, own, "", whole=False)
    with pytest.raises(ValueError, match=r"^b must be float, got '2'"):
        check_form({"b": "2"}, own, "", whole=False)
    with pytest.raises(ValueError, match=r"^a is missing"):
        check_form({"b": 2}, own, "")


def test_an_empty_path_of_a_run_that_has_just_begun_loads(tmp_path: Path):
    make_runner(tmp_path, iterations=1).train()
    content = load_checkpoint(tmp_path / "model_0.pt")
    assert content["estimator_trainer"]["optimizer"]["state"] == {}
    make_runner(iterations=9).load(str(tmp_path / "model_0.pt"))


def test_a_training_whose_critic_knew_less_of_its_robots_is_refused_in_plain_words(
    saved, fresh, monkeypatch
):
    physics = saved["env"]["env"]["physics"][:, :5]
    weight = saved["critic_state_dict"]["mlp.0.weight"][:, :-2]
    earlier = _replaced(saved, ("env", "env", "physics"), physics)
    earlier = _replaced(earlier, ("critic_state_dict", "mlp.0.weight"), weight)
    assert (
        "its critic knows 5 figures of a robot's physics, and here it would 7; a training of"
        in (_refusal(fresh, earlier, monkeypatch))
    )
