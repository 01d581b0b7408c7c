"""Configurations of earlier versions mean what they meant."""

from __future__ import annotations

import copy
import math
import re

import pytest
from earlier_versions import estimators_own_heights, flat_rewards, with_terms_of_then
from places import REPOSITORY

from mute.checkpoint import load_checkpoint
from mute.config import TaskCfg, from_plain, to_plain
from mute.config_versions import MOVED, check_resumable, earlier_terms, upgraded
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.rewards import RewardsCfg, paper_terms, reward_term
from mute.tasks import make_task, task_names


def _with_flat_rewards(**changed: float) -> dict:
    return flat_rewards(to_plain(with_terms_of_then(make_task("go1_mute"))), **changed)


def _with_old_heights(offset: float, scale: float) -> dict:
    return estimators_own_heights(to_plain(make_task("go1_mute")), offset, scale)


@pytest.mark.parametrize("task", task_names())
def test_what_is_written_now_is_left_as_it_is(task):
    plain = to_plain(make_task(task))
    assert upgraded(plain) == plain


def test_the_estimators_scale_of_heights_becomes_that_of_the_height_map():
    cfg = from_plain(_with_old_heights(0.25, 0.5))
    assert (cfg.env.height_map.offset, cfg.env.height_map.scale) == (0.25, 0.5)
    assert cfg.agent == make_task("go1_mute").agent


def test_an_engine_that_is_gone_becomes_the_one_that_took_its_place():
    plain = to_plain(make_task("go1_mute"))
    plain["env"]["engine"] = "mjbatch"
    assert from_plain(plain).env.engine == "mujoco"


def test_friction_whatever_the_floor_becomes_a_factor_on_the_floors():
    plain = to_plain(make_task("go1_mute"))
    plain["env"]["scene"]["floor_friction"] = 0.5
    del plain["env"]["randomization"]["friction_factor"]
    plain["env"]["randomization"]["friction"] = [0.4, 1.25]
    assert from_plain(plain).env.randomization.friction_factor == (0.8, 2.5)
    del plain["env"]["scene"]["floor_friction"]
    assert from_plain(plain).env.randomization.friction_factor == (0.5, 1.5625)


def test_a_configuration_with_both_frictions_is_refused():
    plain = to_plain(make_task("go1_mute"))
    plain["env"]["randomization"]["friction"] = [0.4, 1.25]
    with pytest.raises(ValueError, match=r"friction.*env\.randomization"):
        from_plain(plain)


@pytest.mark.parametrize("bad", ["slippery", [0.4, "high"], 0.4])
def test_friction_that_is_no_range_is_left_to_be_refused(bad):
    with pytest.raises(ValueError, match=r"friction.*env\.randomization"):
        from_plain({"env": {"randomization": {"friction": bad}}})


def test_weights_that_were_fields_become_the_terms_that_they_weighed():
    assert from_plain(_with_flat_rewards()) == with_terms_of_then(make_task("go1_mute"))


def test_a_constant_of_all_rewards_becomes_a_parameter_of_its_term():
    changed = {"desired_height": 0.28, "clearance_target": 0.05, "apex_target": 0.03}
    terms = from_plain(_with_flat_rewards(**changed)).env.rewards.terms
    assert terms["base_height"] == reward_term("base_height", -1.0, desired=0.28)
    assert terms["foot_clearance"] == reward_term("foot_clearance", -20.0, target=0.05)
    assert terms["touchdown_apex"] == reward_term("touchdown_apex", -4.0, target=0.03)


@pytest.mark.parametrize(
    ("asked", "was", "points"), [(0.45, 0.6, 5), (0.6, 0.6, 5), (0.95, 0.9, 7), (0.1, 0.0, 1)]
)
def test_a_height_map_keeps_the_odd_number_of_points_that_was_made_of_its_extent(
    asked, was, points
):
    data = _with_flat_rewards()
    data["env"]["height_map"]["width"] = asked
    height_map = from_plain(data).env.height_map
    assert height_map.width == pytest.approx(was)
    assert len(height_map.grid()[:, 1].unique()) == points
    assert height_map.length == 0.9


def test_a_term_without_weight_is_gone_and_one_that_is_not_given_has_the_papers():
    rewards = {"lin_vel_z": 0.0, "smoothness": -0.01, "tilt": -2.0, "k": 0.3}
    cfg = from_plain({"env": {"rewards": rewards}}).env.rewards
    expected = paper_terms() | {
        "smoothness": reward_term("smoothness", -0.01),
        "tilt": reward_term("orientation", -2.0, group="lift"),
    }
    del expected["lin_vel_z"]
    assert (cfg.terms, cfg.k) == (expected, 0.3)


def test_terms_and_weights_in_one_reward_are_refused():
    plain = to_plain(make_task("go1_mute"))
    plain["env"]["rewards"]["landing_speed"] = -1.0
    with pytest.raises(ValueError, match="landing_speed"):
        from_plain(plain)


@pytest.mark.parametrize("task", ["go1_mute", "go1_mute_flat"])
def test_a_policy_that_ships_was_trained_with_the_rewards_of_its_task(task):
    saved = load_checkpoint(REPOSITORY / "resources" / "go1" / f"{task}.pt")
    assert from_plain(saved["config"]).env.rewards == make_task(task).env.rewards


@pytest.mark.parametrize("name", ["landing_speed", "apex_target"])
def test_a_bad_figure_of_an_earlier_version_is_refused_where_it_is_now(name):
    path = MOVED[f"env.rewards.{name}"].removeprefix("env.")
    with pytest.raises(ValueError, match=re.escape(path)):
        from_plain(_with_flat_rewards(**{name: math.inf}))


def test_every_field_that_was_moved_has_a_place_now():
    def at(data: object, path: str) -> object:
        for part in path.split("."):
            assert isinstance(data, dict)
            data = data[part]
        return data

    plain = to_plain(TaskCfg(QuadrupedEnvCfg(rewards=RewardsCfg(terms=earlier_terms()))))
    for path in MOVED.values():
        assert isinstance(at(plain, path), float)


def test_a_scale_in_both_places_is_refused():
    plain = _with_old_heights(0.25, 0.5)
    plain["env"]["height_map"]["scale"] = 0.1
    with pytest.raises(ValueError, match="height_scale"):
        from_plain(plain)


def test_what_is_upgraded_is_not_changed_itself():
    plain = _with_old_heights(0.25, 0.5)
    before = copy.deepcopy(plain)
    upgraded(plain)
    assert plain == before


def test_a_training_whose_critic_saw_another_scale_cannot_go_on():
    check_resumable(to_plain(make_task("go1_mute")))
    check_resumable(_with_old_heights(0.30, 0.1))
    with pytest.raises(ValueError, match=r"network\.height_scale was 0\.5 .* and 0\.1"):
        check_resumable(_with_old_heights(0.30, 0.5))


@pytest.mark.parametrize(
    "data",
    [{}, {"agent": 3}, {"agent": {"estimation": None}}, {"env": {"rewards": [1]}}, {"env": 2}],
)
def test_data_without_the_place_of_a_field_is_left_as_it_is(data):
    assert upgraded(data) == data
