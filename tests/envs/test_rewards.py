"""Tests of a reward as the sum of its terms, and of what it may be made of."""

from __future__ import annotations

import dataclasses
import math

import pytest
import torch
from motion_helpers import make_motion

from mute.envs import reward_terms
from mute.envs.reward_terms import RewardFunction
from mute.envs.rewards import RewardsCfg, RewardSum, RewardTermCfg, reward_term
from mute.support.errors import MuteError

STEP_DT = 0.02


def _make_cfg(k=0.2, **weights):
    """Make a reward of these terms alone, each named as its function."""
    terms = {name: reward_term(name, weight) for name, weight in weights.items()}
    return RewardsCfg(terms=terms, k=k, guide_ramp=(0.0, 1.0))


def _make_sum(cfg):
    return RewardSum(cfg, STEP_DT, 2, torch.device("cpu"))


def test_default_weights_are_those_of_the_paper():
    weights = {name: term.weight for name, term in RewardsCfg().terms.items()}
    assert weights == {
        "lin_vel_tracking": 1.0,
        "ang_vel_tracking": 0.5,
        "foot_drop_velocity": -0.05,
        "foot_raise_velocity": 0.01,
        "lin_vel_z": -2.0,
        "ang_vel_xy": -0.05,
        "joint_power": -2.0e-5,
        "joint_acc": -2.5e-7,
        "action_rate": -0.01,
        "collision": -0.1,
        "base_height": -1.0,
        "orientation": -0.2,
    }


@pytest.mark.parametrize(
    ("name", "case", "factors"),
    [
        ("lin_vel_tracking", {}, (1.0, 0.8)),  # 1 - k beta, for beta 0 and 1
        ("landing_speed", {"landing_speed": [[1.0], [1.0]]}, (0.0, 1.0)),
        ("lin_vel_z", {"base_lin_vel": [[0, 0, 1.0], [0, 0, 1.0]]}, (1.0, 1.0)),
    ],
)
def test_beta_weighs_a_term_by_its_group(name, case, factors):
    motion = make_motion(command=[[0, 0, 0, 0.0], [0, 0, 0, 1.0]], **case)
    reward, _ = _make_sum(_make_cfg(k=0.2, **{name: 3.0}))(motion, 1.0, 1.0, 1.0)
    torch.testing.assert_close(reward, 3.0 * STEP_DT * torch.tensor(factors))


def test_k_decides_how_much_of_the_task_reward_beta_gives_up():
    motion = make_motion(command=[[0, 0, 0, 0.5], [0, 0, 0, 1.0]])
    reward, _ = _make_sum(_make_cfg(k=0.6, ang_vel_tracking=1.0))(motion, 1.0, 1.0, 1.0)
    torch.testing.assert_close(reward, STEP_DT * torch.tensor([0.7, 0.4]))


def test_each_curriculum_scales_its_group_alone():
    motion = make_motion(
        command=[[1.0, 0, 0, 0.5], [1.0, 0, 0, 1.0]],
        base_lin_vel=[[1.0], [1.0]],
        landing_speed=[[1.0], [1.0]],
        contact=[[1], [1, 0, 0, 1]],
        foot_speed_xy=[[1.0], [2.0]],
    )
    cfg = _make_cfg(
        k=0.2, landing_speed=-4.0, lin_vel_tracking=1.0, base_height=-1.0, foot_slip=-1.0,
        diagonal_support=2.0,
    )  # fmt: skip
    reward, _ = _make_sum(cfg)(motion, 0.25, 0.5, 0.125)
    # 1 - k beta, minus 4 quiet beta, minus 0.3^2, minus lift v^2, plus 2 guide (one foot, or two).
    expected = torch.tensor([0.9 - 0.5 - 0.09 - 0.5 + 0.125, 0.8 - 1.0 - 0.09 - 2.0 + 0.25])
    torch.testing.assert_close(reward, STEP_DT * expected)


def test_the_shares_are_means_per_second_and_add_up_to_the_reward():
    motion = make_motion(
        command=[[0, 0, 0, 0.0], [0, 0, 0, 1.0]], base_lin_vel=[[0, 0, 1.0], [0, 0, 2.0]]
    )
    reward, shares = _make_sum(_make_cfg(lin_vel_tracking=1.0, lin_vel_z=-2.0))(
        motion, 1.0, 1.0, 1.0
    )
    assert {name: share.item() for name, share in shares.items()} == pytest.approx(
        {"lin_vel_tracking": 0.9, "lin_vel_z": -5.0}
    )
    assert reward.mean().item() == pytest.approx((0.9 - 5.0) * STEP_DT)


def test_a_reward_may_be_told_to_pay_no_less_than_nothing():
    cfg = _make_cfg(lin_vel_z=-2.0, lin_vel_tracking=1.0)
    motion = make_motion(base_lin_vel=[[0.0, 0.0, 0.0], [0.0, 0.0, 3.0]])
    free, shares = _make_sum(cfg)(motion, 1.0, 1.0, 1.0)
    assert float(free[0]) > 0.0 > float(free[1])
    floored, same = _make_sum(dataclasses.replace(cfg, never_negative=True))(motion, 1.0, 1.0, 1.0)
    assert floored.tolist() == [float(free[0]), 0.0]
    assert same == shares  # what each term says is what it says


def test_a_term_without_weight_is_neither_evaluated_nor_listed():
    motion = make_motion(joint_acc=[[math.nan], [math.nan]])
    reward_sum = _make_sum(_make_cfg(orientation=-1.0))
    reward, shares = reward_sum(motion, 1.0, 1.0, 1.0)
    assert reward_sum.names == ["orientation"] == list(shares)
    assert reward.isfinite().all()


def test_a_reward_is_not_changed_by_the_next_call():
    reward_sum = _make_sum(_make_cfg(collision=-1.0))
    reward, shares = reward_sum(make_motion(collisions=[1.0, 2.0]), 1.0, 1.0, 1.0)
    kept, kept_share = reward.clone(), shares["collision"].clone()
    reward_sum(make_motion(collisions=[5.0, 5.0]), 1.0, 1.0, 1.0)
    assert torch.equal(reward, kept)
    assert torch.equal(shares["collision"], kept_share)


def test_one_function_stands_in_two_groups_with_a_weight_and_parameters_in_each():
    terms = {
        "height": reward_term("base_height", -1.0, desired=0.4),
        "first_height": reward_term("base_height", -3.0, group="lift", desired=0.5),
    }
    motion = make_motion(base_height=[0.3, 0.5])
    reward, shares = _make_sum(RewardsCfg(terms=terms))(motion, 1.0, 0.5, 0.0)
    expected = torch.tensor([-0.01 - 1.5 * 0.04, -0.01])
    torch.testing.assert_close(reward, STEP_DT * expected)
    assert list(shares) == ["height", "first_height"]
    assert shares["first_height"].item() == pytest.approx(-0.5 * 1.5 * 0.04)


def test_the_order_in_which_a_task_lists_its_terms_does_not_decide_what_scales_them():
    motion = make_motion(
        command=[[0, 0, 0, 1.0], [0, 0, 0, 0.5]], landing_speed=[[1.0], [1.0]], base_height=[0, 0]
    )
    names = {"base_height": -1.0, "landing_speed": -2.0, "ang_vel_tracking": 1.0}
    expected = STEP_DT * torch.tensor([-0.09 - 2.0 * 0.25 + 0.8, -0.09 - 0.25 + 0.9])
    for order in (list(names), list(reversed(names))):
        cfg = _make_cfg(**{name: names[name] for name in order})
        reward, shares = _make_sum(cfg)(motion, 0.25, 1.0, 1.0)
        torch.testing.assert_close(reward, expected)
        assert shares["landing_speed"].item() == pytest.approx(-2.0 * 0.25 * 0.75)


def test_parameters_that_are_left_out_are_filled_in():
    terms = {"drop": RewardTermCfg("near_ground_drop", -1.0, "other")}
    assert RewardsCfg(terms=terms).terms["drop"].params == {"depth": 0.02}


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("phase_source", "guessed"),
        ("k", 1.5),
        ("k", math.nan),
        ("quiet_ramp", (2.0, 1.0)),
        ("quiet_ramp", (-1.0, 1.0)),
        ("lift_ramp", (2.0, 1.0)),
        ("lift_ramp", (0.0, math.inf)),
        ("guide_ramp", (2.0, 1.0)),
    ],
)
def test_a_bad_constant_is_refused_by_name(field, value):
    with pytest.raises(ValueError, match=f"rewards.{field}"):
        RewardsCfg(**{field: value})


@pytest.mark.parametrize(
    ("term", "words"),
    [
        (RewardTermCfg("base_height", math.nan, "other"), ["x.weight", "<= 1000000000", "nan"]),
        (RewardTermCfg("base_height", -math.inf, "other"), ["x.weight", ">= -1000000000", "-inf"]),
        (RewardTermCfg("base_hight", 1.0, "other"), ["x.function", "base_height", "'base_hight'"]),
        (RewardTermCfg("base_height", 1.0, "loud"), ["x.group", "phase", "'loud'"]),  # pyright: ignore[reportArgumentType]
        (reward_term("base_height", 1.0, desired=0.0), ["x.params.desired", ">= 1e-06", "0.0"]),
        (
            reward_term("touchdown_apex", 1.0, target=math.inf),
            ["x.params.target", "<= 1000000000", "inf"],
        ),
        (reward_term("foot_clearance", 1.0, target=-0.1), ["x.params.target", ">= 1e-06", "-0.1"]),
        (reward_term("base_height", 1.0, hight=1.0), ["x.params", "of desired", "'hight'"]),
        (reward_term("fall", 1.0, hight=1.0), ["x.params", "empty", "'hight'"]),
        (reward_term("base_height", "1"), ["x.weight", "got 1"]),  # pyright: ignore[reportArgumentType]
        (reward_term("diagonal_support", 0.7), ["rewards.guide_ramp", "x.weight", "0.7"]),
    ],
)
def test_a_bad_term_is_refused_by_its_place_with_what_is_allowed(term, words):
    with pytest.raises(ValueError) as caught:
        RewardsCfg(terms={"x": term})
    message = str(caught.value)
    assert "\n" not in message
    assert all(word in message for word in words), message


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (torch.tensor(1.0), ["(2,)", "shape ()"]),
        (torch.ones(2, 12), ["(2,)", "shape (2, 12)"]),
        (torch.ones(2, 1), ["(2,)", "shape (2, 1)"]),
        (1.0, ["(2,)", "got 1.0"]),
    ],
)
def test_a_function_that_returns_no_number_for_each_robot_is_refused(value, words, monkeypatch):
    known = RewardFunction(lambda motion: value, "other", {})
    monkeypatch.setattr(reward_terms, "_functions", reward_terms._functions)
    monkeypatch.setitem(reward_terms._functions, "odd", known)
    reward_sum = _make_sum(RewardsCfg(terms={"mine": reward_term("odd", 1.0)}))
    with pytest.raises(MuteError) as caught:
        reward_sum(make_motion(base_height=[0.3, 0.3]), 1.0, 1.0, 1.0)
    message = str(caught.value)
    assert all(word in message for word in ["env.rewards.terms.mine", "odd", *words]), message


def test_a_term_whose_name_could_be_no_option_is_refused():
    with pytest.raises(
        ValueError, match=r"rewards\.terms must have names as Python has, got 'a b'"
    ):
        RewardsCfg(terms={"a b": reward_term("fall", 1.0)})


def test_a_term_of_an_unknown_function_cannot_be_made():
    with pytest.raises(ValueError, match=r"base_height.*got 'base_hight'"):
        reward_term("base_hight", 1.0)
