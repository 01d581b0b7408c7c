"""Configurations survive being written, and say which of their fields is wrong."""

from __future__ import annotations

import dataclasses
import math
import typing

import pytest
import yaml

from mute.config import AgentCfg, EstimationCfg, PPOCfg, TaskCfg, from_plain, to_plain
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.networks.estimator import EstimatorCfg
from mute.tasks import make_task, task_names


def _leaves(value: object) -> set[type]:
    if isinstance(value, dict):
        return {type(key) for key in value} | {t for v in value.values() for t in _leaves(v)}
    if isinstance(value, list):
        return {t for v in value for t in _leaves(v)}
    return {type(value)}


@pytest.mark.parametrize("task", task_names())
def test_every_task_comes_back_equal_from_plain_data_and_from_yaml(task):
    cfg = make_task(task)
    plain = to_plain(cfg)
    assert _leaves(plain) <= {str, int, float, bool}
    assert from_plain(plain) == cfg
    assert from_plain(yaml.safe_load(yaml.safe_dump(plain))) == cfg


def test_a_changed_field_of_every_depth_comes_back():
    cfg = make_task("go1_mute")
    cfg.env.rewards.quiet_ramp = (1.0, 2.5)
    cfg.agent.actor_hidden = (6,)
    cfg.agent.estimation.network.latent_dim = 6
    back = from_plain(to_plain(cfg))
    assert back.env.rewards.quiet_ramp == (1.0, 2.5)
    assert back.agent.actor_hidden == (6,)
    assert back.agent.estimation.network.latent_dim == 6


def test_plain_data_shares_nothing_with_the_configuration():
    cfg = make_task("go1_mute")
    to_plain(cfg)["env"]["num_envs"] = 1
    assert cfg.env.num_envs != 1


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({"env": {"nope": 1}}, ["nope", "env"]),
        ({"agnet": {}}, ["agnet"]),
        ({"agent": {"ppo": {"gama": 0.9}}}, ["gama", "agent.ppo"]),
        ({"env": {"num_envs": -1}}, ["env.num_envs must be an integer >= 1", "got -1"]),
        ({"env": {"num_envs": 2.7}}, ["env.num_envs", "2.7"]),
        ({"env": {"num_envs": "many"}}, ["env.num_envs", "many"]),
        ({"env": {"random_heading": "False"}}, ["env.random_heading", "False"]),
        ({"env": {"rewards": {"k": 2.0}}}, ["rewards.k", "2.0"]),
        ({"env": {"rewards": {"landing_spede": 1.0}}}, ["landing_spede", "env.rewards"]),
        ({"env": {"rewards": {"landing_speed": "loud"}}}, ["landing_speed", "weight", "float"]),
        ({"env": {"rewards": {"terms": [1.0]}}}, ["env.rewards.terms"]),
        ({"env": {"rewards": {"terms": {"fall": 1.0}}}}, ["env.rewards.terms", "fall"]),
        (
            {"env": {"rewards": {"terms": {"x": {"function": "f", "weight": 1, "group": "lift"}}}}},
            ["rewards.terms.x.function", "'f'", "MUTE_PLUGINS"],
        ),
        ({"env": 3}, ["env"]),
        ({"agent": {"ppo": {"schedule": "cosine"}}}, ["agent.ppo.schedule", "cosine"]),
        ({"agent": {"iterations": 0}}, ["agent.iterations must be an integer >= 1", "got 0"]),
        ([], ["list"]),
        (None, ["NoneType"]),
    ],
)
def test_data_that_does_not_fit_is_refused_in_one_line_that_names_the_place(data, words):
    with pytest.raises(ValueError) as caught:
        from_plain(data)
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message


@pytest.mark.parametrize(
    ("cls", "field", "value", "name"),
    [
        (QuadrupedEnvCfg, "num_envs", -1, "env.num_envs"),
        (QuadrupedEnvCfg, "episode_length", 0.0, "env.episode_length"),
        (AgentCfg, "iterations", 0, "agent.iterations"),
        (AgentCfg, "num_steps_per_env", 0, "agent.num_steps_per_env"),
        (AgentCfg, "save_interval", 0, "agent.save_interval"),
        (AgentCfg, "init_std", -1.0, "agent.init_std"),
        (AgentCfg, "actor_hidden", (), "agent.actor_hidden"),
        (AgentCfg, "critic_hidden", (8, 0), "agent.critic_hidden"),
        (AgentCfg, "std_range", (0.0, 1.0), "agent.std_range"),
        (AgentCfg, "std_range", (2.0, 1.0), "agent.std_range"),
        (PPOCfg, "num_learning_epochs", 0, "agent.ppo.num_learning_epochs"),
        (PPOCfg, "num_mini_batches", 0, "agent.ppo.num_mini_batches"),
        (PPOCfg, "learning_rate", 0.0, "agent.ppo.learning_rate"),
        (PPOCfg, "clip_param", float("nan"), "agent.ppo.clip_param"),
        (PPOCfg, "gamma", 1.01, "agent.ppo.gamma"),
        (PPOCfg, "lam", -0.1, "agent.ppo.lam"),
        (PPOCfg, "entropy_coef", -0.1, "agent.ppo.entropy_coef"),
        (EstimationCfg, "num_mini_batches", 0, "agent.estimation.num_mini_batches"),
        (EstimationCfg, "robots_share", 0.0, "agent.estimation.robots_share"),
        (EstimationCfg, "robots_share", 1.1, "agent.estimation.robots_share"),
        (EstimationCfg, "learning_rate", -1.0, "agent.estimation.learning_rate"),
        (EstimationCfg, "lambda_kl", -1.0, "agent.estimation.lambda_kl"),
    ],
)
def test_a_bad_value_is_refused_with_the_fields_name_and_the_value(cls, field, value, name):
    with pytest.raises(ValueError) as caught:
        dataclasses.replace(cls(), **{field: value})
    assert name in str(caught.value)
    assert str(value) in str(caught.value)


_PLACES = {
    AgentCfg: "agent",
    PPOCfg: "agent.ppo",
    EstimationCfg: "agent.estimation",
    EstimatorCfg: "network",
}


def _holds_numbers(hint: object) -> bool:
    return hint in (int, float) or any(map(_holds_numbers, typing.get_args(hint)))


def _fields_with_numbers() -> list[tuple[type, str]]:
    """Return every field of the agent that holds numbers."""
    return [
        (cls, name)
        for cls in _PLACES
        for name, hint in typing.get_type_hints(cls).items()
        if _holds_numbers(hint)
    ]


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, -1])
@pytest.mark.parametrize(
    ("cls", "name"), _fields_with_numbers(), ids=lambda value: getattr(value, "__name__", value)
)
def test_no_field_of_the_agent_takes_what_is_no_number_or_below_zero(cls, name, value):
    default = getattr(cls(), name)
    if not isinstance(default, tuple):
        changed = [value]
    else:
        changed = [
            (*default[:index], value, *default[index + 1 :]) for index in range(len(default))
        ]
    for wrong in changed:
        with pytest.raises(ValueError) as caught:
            dataclasses.replace(cls(), **{name: wrong})
        message = str(caught.value)
        assert f"{_PLACES[cls]}.{name} must be" in message
        assert str(wrong) in message
        assert "\n" not in message


@pytest.mark.parametrize(
    ("cls", "name"), _fields_with_numbers(), ids=lambda value: getattr(value, "__name__", value)
)
def test_every_count_of_the_agent_has_an_upper_end(cls, name):
    default = getattr(cls(), name)
    if isinstance(default, float) or name == "std_range":
        pytest.skip("a float may be as large as it can be")
    wrong = (10**40,) if isinstance(default, tuple) else 10**40
    with pytest.raises(ValueError, match=rf"{_PLACES[cls]}\.{name} must be .* and <= \d+, got"):
        dataclasses.replace(cls(), **{name: wrong})


def test_the_agents_fields_with_numbers_are_all_found():
    names = {name for _, name in _fields_with_numbers()}
    assert len(_fields_with_numbers()) == 12 + 10 + 7 + 6
    assert {"actor_hidden", "std_range", "learning_rate", "lambda_kl"} <= names


@pytest.mark.parametrize("seed", [-1, 2**63])
def test_a_seed_that_torch_does_not_take_is_refused(seed):
    with pytest.raises(ValueError, match=r"env\.seed"):
        TaskCfg(env=QuadrupedEnvCfg(seed=seed))


def test_more_mini_batches_than_samples_are_refused():
    env = QuadrupedEnvCfg(num_envs=4)
    estimation = EstimationCfg(num_mini_batches=4)
    most = AgentCfg(num_steps_per_env=3, ppo=PPOCfg(num_mini_batches=12), estimation=estimation)
    TaskCfg(env, most)
    with pytest.raises(ValueError, match=r"agent\.ppo\.num_mini_batches must be <= .* 12, got 13"):
        TaskCfg(env, dataclasses.replace(most, ppo=PPOCfg(num_mini_batches=13)))


def test_more_mini_batches_of_the_estimator_than_robots_are_refused():
    env = QuadrupedEnvCfg(num_envs=4)
    TaskCfg(env, AgentCfg(estimation=EstimationCfg(num_mini_batches=4)))
    words = r"agent\.estimation\.num_mini_batches must be <= .*robots_share or 4, got 5"
    with pytest.raises(ValueError, match=words):
        TaskCfg(env, AgentCfg(estimation=EstimationCfg(num_mini_batches=5)))


def test_a_share_of_the_robots_counts_against_the_mini_batches_of_the_estimator():
    env = QuadrupedEnvCfg(num_envs=8)
    TaskCfg(env, AgentCfg(estimation=EstimationCfg(num_mini_batches=4, robots_share=0.5)))
    with pytest.raises(ValueError, match=r"env\.num_envs \* .*robots_share or 4, got 5"):
        TaskCfg(env, AgentCfg(estimation=EstimationCfg(num_mini_batches=5, robots_share=0.5)))


@pytest.mark.parametrize(
    ("share", "robots", "expected"), [(0.29, 100, 29), (0.5, 5, 2), (1.0, 7, 7), (0.01, 8, 1)]
)
def test_a_share_of_the_robots_is_rounded_down_and_never_empty(share, robots, expected):
    assert EstimationCfg(robots_share=share).robots_learnt_from(robots) == expected
