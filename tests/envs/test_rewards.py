"""Tests of the reward terms against hand-computed cases, and of their sum."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

import pytest
import torch

from mute.envs.rewards import GROUPS, TERMS, Motion, RewardsCfg, RewardSum

STEP_DT = 0.02

WIDTHS = {
    "command": 4,
    "base_lin_vel": 3,
    "base_ang_vel": 3,
    "projected_gravity": 3,
    "joint_pos": 12,
    "joint_vel": 12,
    "joint_acc": 12,
    "torque": 12,
    "action": 12,
    "last_action": 12,
    "action_before_last": 12,
    "phase": 4,
    "foot_drop_sq": 4,
    "foot_raise_sq": 4,
    "foot_speed_xy": 4,
    "foot_height": 4,
    "contact": 4,
    "touchdown": 4,
    "landing_speed": 4,
    "swing_apex": 4,
}

# For each term: what two robots did, the rest being zero, and what the term makes of it.
CASES = {
    "lin_vel_tracking": (
        {"command": [[1.0], [0.0, 0.25]], "base_lin_vel": [[0.5, 0.0, 9.0], []]},
        [math.exp(-1.0), math.exp(-0.25)],
    ),
    "ang_vel_tracking": (
        {"command": [[0, 0, 0.5], [0, 0, -1.0]], "base_ang_vel": [[7.0], [0, 0, -1.0]]},
        [math.exp(-1.0), 1.0],
    ),
    "foot_drop_velocity": (
        {"phase": [[0.0, 1.0], [0, 0, 0, 0.5]], "foot_drop_sq": [[1.0, 2.0], [0, 0, 0, 3.0]]},
        [1.0 + 2.0 * math.e, 3.0 * math.exp(0.5)],
    ),
    "foot_raise_velocity": (
        {"phase": [[0.0, 1.0], [0, 0, 0, 0.5]], "foot_raise_sq": [[1.0, 2.0], [0, 0, 0, 3.0]]},
        [1.0 + 2.0 / math.e, 3.0 * math.exp(-0.5)],
    ),
    "near_ground_drop": (
        {"foot_height": [[0.0, 0.02], [-0.01]], "foot_drop_sq": [[1.0, 1.0], [2.0]]},
        [1.0 + math.exp(-1.0), 2.0],
    ),
    "landing_speed": ({"landing_speed": [[0.3, 0.4], [0, 0, 0, 2.0]]}, [0.25, 4.0]),
    "lin_vel_z": ({"base_lin_vel": [[9.0, 9.0, -0.5], [0, 0, 2.0]]}, [0.25, 4.0]),
    "ang_vel_xy": ({"base_ang_vel": [[3.0, -4.0, 100.0], [0.0, 1.0]]}, [25.0, 1.0]),
    "joint_power": (
        {"torque": [[2.0, 1.0], [5.0]], "joint_vel": [[-3.0, 4.0], [0.0, 5.0]]},
        [10.0, 0.0],
    ),
    "joint_acc": ({"joint_acc": [[3.0, -4.0], [0.0, 2.0]]}, [25.0, 4.0]),
    "action_rate": (
        {"action": [[1.0, 0.0, 1.0], []], "last_action": [[-1.0, 0.0, 3.0], [0.5]]},
        [8.0, 0.25],
    ),
    "collision": ({"collisions": [0.0, 3.0]}, [0.0, 3.0]),
    "base_height": ({"base_height": [0.2, 0.35]}, [0.01, 0.0025]),
    "orientation": ({"projected_gravity": [[0.3, -0.4, -0.86], [0, 0, -1.0]]}, [0.25, 0.0]),
    "smoothness": (
        {
            "action": [[1.0], [2.0]],
            "last_action": [[0.0], [1.0]],
            "action_before_last": [[1.0], [0.0]],
        },
        [4.0, 0.0],  # there and back again; a steady ramp
    ),
    # Powers 12, 0, 0, ...: mean 1, mean square 12. Powers 6, -6, 0, ...: mean 0, mean square 6.
    "power_distribution": (
        {"torque": [[4.0], [2.0, -2.0]], "joint_vel": [[3.0], [3.0, 3.0]]},
        [11.0, 6.0],
    ),
    "foot_clearance": (
        {"foot_height": [[0.04] * 4, [0.06] * 4], "foot_speed_xy": [[2.0], [2.0]]},
        [0.0008, 0.0],
    ),
    "touchdown_apex": (
        {
            "command": [[0.0, 0.0, 0.1], [0, 0, 0, 1.0]],
            "touchdown": [[1, 1, 1, 0], [1]],
            "swing_apex": [[0.02, 0.08, 0.01, 0.05], [0.01]],
        },
        # Half of the target, above it, a quarter of it, still in the air; a robot asked to stand.
        [0.5 + 0.0 + 0.75, 0.0],
    ),
    "foot_slip": (
        {"contact": [[1], [1, 1]], "foot_speed_xy": [[2.0, 5.0], [1.0, 3.0]]},
        [4.0, 10.0],
    ),
    "stand_still": (
        {"command": [[0, 0, 0, 0.7], [0, 0.1]], "joint_pos": [[0.1, -0.2], [0.1, -0.2]]},
        [0.3, 0.0],
    ),
    "tilt": ({"projected_gravity": [[0.3, -0.4, -0.86], [0, 0, -1.0]]}, [0.25, 0.0]),
    "diagonal_support": (
        # FR and RL alone; FR, RL and RR; FL alone; all; FL and RR, but asked to stand.
        {
            "command": [[0.5], [0, 0.5], [0, 0, 0.5], [0.5], [0, 0, 0, 1.0]],
            "contact": [[1, 0, 0, 1], [1, 0, 1, 1], [0, 1, 0, 0], [1, 1, 1, 1], [0, 1, 1, 0]],
        },
        [1.0, 0.5, 0.5, 0.0, 0.0],
    ),
    "fall": ({"fallen": [False, True]}, [0.0, 1.0]),
}


def _padded(row, width):
    return [float(value) for value in row] + [0.0] * (width - len(row))


def _make_motion(**given):
    """Make the motion of two robots; rows are filled up with zeros."""
    values = {}
    for name, width in WIDTHS.items():
        rows = given.pop(name, [[], []])
        values[name] = torch.tensor([_padded(row, width) for row in rows])
    for name in ("contact", "touchdown"):
        values[name] = values[name] > 0.5
    for name in ("base_height", "collisions"):
        values[name] = torch.tensor(given.pop(name, [0.0, 0.0]))
    values["fallen"] = torch.tensor(given.pop("fallen", [False, False]))
    assert not given
    return Motion(**values)


def _make_cfg(**given):
    """Make a configuration whose weights are 0, but for those given."""
    weights: dict[str, Any] = dict.fromkeys(TERMS, 0.0)
    weights["guide_ramp"] = (0.0, 1.0)
    return RewardsCfg(**(weights | given))


def _make_sum(cfg):
    return RewardSum(cfg, STEP_DT, 2, torch.device("cpu"))


@pytest.mark.parametrize("name", TERMS)
def test_a_term_gives_what_was_computed_by_hand(name):
    given, expected = CASES[name]
    value = TERMS[name](_make_motion(**given), RewardsCfg())
    torch.testing.assert_close(value, torch.tensor(expected))


def test_constants_of_the_configuration_reach_their_terms():
    cfg = RewardsCfg(desired_height=0.5, clearance_target=0.1, apex_target=0.1)
    motion = _make_motion(
        command=[[1.0], []], touchdown=[[1], []], swing_apex=[[0.06], []], foot_speed_xy=[[1.0], []]
    )
    expected = {"base_height": 0.25, "foot_clearance": 0.01, "touchdown_apex": 0.4}
    for name, value in expected.items():
        assert TERMS[name](motion, cfg)[0].item() == pytest.approx(value)


def test_every_term_is_named_as_its_weight_and_stands_in_one_group():
    names = [term.__name__ for terms in GROUPS.values() for term in terms]
    assert len(names) == len(set(names))
    constants = {
        "k", "desired_height", "clearance_target", "apex_target", "phase_source", "quiet_ramp",
        "lift_ramp", "guide_ramp",
    }  # fmt: skip
    assert set(names) == set(TERMS) == {field.name for field in fields(RewardsCfg)} - constants


def test_default_weights_are_those_of_the_paper():
    cfg = RewardsCfg()
    weights = {name: getattr(cfg, name) for name in TERMS if getattr(cfg, name) != 0.0}
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
    motion = _make_motion(command=[[0, 0, 0, 0.0], [0, 0, 0, 1.0]], **case)
    reward, _ = _make_sum(_make_cfg(k=0.2, **{name: 3.0}))(motion, 1.0, 1.0, 1.0)
    torch.testing.assert_close(reward, 3.0 * STEP_DT * torch.tensor(factors))


def test_k_decides_how_much_of_the_task_reward_beta_gives_up():
    motion = _make_motion(command=[[0, 0, 0, 0.5], [0, 0, 0, 1.0]])
    reward, _ = _make_sum(_make_cfg(k=0.6, ang_vel_tracking=1.0))(motion, 1.0, 1.0, 1.0)
    torch.testing.assert_close(reward, STEP_DT * torch.tensor([0.7, 0.4]))


def test_each_curriculum_scales_its_group_alone():
    motion = _make_motion(
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
    motion = _make_motion(
        command=[[0, 0, 0, 0.0], [0, 0, 0, 1.0]], base_lin_vel=[[0, 0, 1.0], [0, 0, 2.0]]
    )
    reward, shares = _make_sum(_make_cfg(lin_vel_tracking=1.0, lin_vel_z=-2.0))(
        motion, 1.0, 1.0, 1.0
    )
    assert {name: share.item() for name, share in shares.items()} == pytest.approx(
        {"lin_vel_tracking": 0.9, "lin_vel_z": -5.0}
    )
    assert reward.mean().item() == pytest.approx((0.9 - 5.0) * STEP_DT)


def test_a_term_without_weight_is_neither_evaluated_nor_listed():
    motion = _make_motion(joint_acc=[[math.nan], [math.nan]])
    reward_sum = _make_sum(_make_cfg(orientation=-1.0))
    reward, shares = reward_sum(motion, 1.0, 1.0, 1.0)
    assert reward_sum.names == ["orientation"] == list(shares)
    assert reward.isfinite().all()


def test_a_reward_is_not_changed_by_the_next_call():
    reward_sum = _make_sum(_make_cfg(collision=-1.0))
    reward, shares = reward_sum(_make_motion(collisions=[1.0, 2.0]), 1.0, 1.0, 1.0)
    kept, kept_share = reward.clone(), shares["collision"].clone()
    reward_sum(_make_motion(collisions=[5.0, 5.0]), 1.0, 1.0, 1.0)
    assert torch.equal(reward, kept)
    assert torch.equal(shares["collision"], kept_share)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("phase_source", "guessed"),
        ("k", 1.5),
        ("quiet_ramp", (2.0, 1.0)),
        ("quiet_ramp", (-1.0, 1.0)),
        ("lift_ramp", (2.0, 1.0)),
        ("guide_ramp", (2.0, 1.0)),
        ("diagonal_support", 0.7),
        ("desired_height", 0.0),
        ("clearance_target", -0.1),
        ("apex_target", 0.0),
        ("apex_target", math.inf),
        ("desired_height", math.nan),
        ("landing_speed", math.nan),
        ("lin_vel_tracking", math.inf),
        ("collision", -math.inf),
        ("lift_ramp", (0.0, math.inf)),
    ],
)
def test_a_bad_constant_is_refused_by_name(field, value):
    with pytest.raises(ValueError, match=f"rewards.{field}"):
        RewardsCfg(**{field: value})
