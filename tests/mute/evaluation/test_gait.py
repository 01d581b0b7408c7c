"""The figures of a gait, on an environment made by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest
import torch

from mute.evaluation.gait import Gait, GaitMeter


class _HandMadeEnv:
    """Two robots with four feet; every figure the meter reads can be set."""

    num_envs, step_dt = 2, 0.02

    def __init__(self) -> None:
        self.base_lin_vel = torch.zeros(2, 3)
        self.base_ang_vel = torch.zeros(2, 3)
        self.power = torch.zeros(2)
        self.fallen = torch.zeros(2, dtype=torch.bool)
        self.unstable = torch.zeros(2, dtype=torch.bool)
        self.invalid_action = torch.zeros(2, dtype=torch.bool)
        self.footfalls = SimpleNamespace(
            touchdown=torch.zeros(2, 4, dtype=torch.bool),
            landing_speed=torch.zeros(2, 4),
            swing_apex=torch.zeros(2, 4),
            contact_share=torch.zeros(2, 4),
        )


def _make_meter(settle_time: float = 0.0) -> tuple[_HandMadeEnv, GaitMeter]:
    env = _HandMadeEnv()
    return env, GaitMeter(env, settle_time)  # pyright: ignore[reportArgumentType]


COMMAND = torch.tensor([[0.5, 0.1, 0.2, 0.0], [0.5, 0.1, 0.2, 1.0]])
NOBODY = torch.tensor([False, False])


def test_means_over_time_and_robots_are_those_of_hand_calculation():
    env, meter = _make_meter()
    for speed in (0.5, 0.7):
        env.base_lin_vel = torch.tensor([[speed, 0.1, 9.0], [0.3, 0.0, 9.0]])
        env.base_ang_vel = torch.tensor([[9.0, 9.0, 0.2], [9.0, 9.0, -0.3]])
        env.power = torch.tensor([100.0, 20.0])
        env.footfalls.contact_share = torch.tensor([[1.0] * 4, [1.0, 0.5, 0.0, 0.5]])
        meter.update(COMMAND, NOBODY)
    gait = meter.gait()
    assert gait.speed == pytest.approx((0.5 + 0.7 + 0.3 + 0.3) / 4)
    # Robot 0: 0 and 0.2^2; robot 1: 0.2^2 + 0.1^2, twice.
    assert gait.velocity_error_sq == pytest.approx((0.04 + 0.05 + 0.05) / 4)
    assert gait.yaw_rate_error_sq == pytest.approx((0.25 + 0.25) / 4)
    assert gait.power == pytest.approx(60.0)
    assert gait.duty_factor == pytest.approx(0.75)


def test_landings_are_averaged_over_landings_and_not_over_time():
    env, meter = _make_meter()
    feet = env.footfalls
    # The apex of feet in the air does not count yet.
    feet.swing_apex = torch.full((2, 4), 0.5)
    meter.update(COMMAND, NOBODY)
    feet.touchdown = torch.tensor([[True, False, True, False], [True, False, False, False]])
    feet.landing_speed = torch.tensor([[0.1, 0.0, 0.2, 0.0], [0.6, 0.0, 0.0, 0.0]])
    feet.swing_apex = torch.tensor([[0.02, 0.5, 0.04, 0.5], [0.06, 0.5, 0.5, 0.5]])
    meter.update(COMMAND, NOBODY)
    gait = meter.gait()
    assert gait.landing_speed_mean == pytest.approx(0.3)
    assert gait.landing_speed_rms == pytest.approx(math.sqrt((0.01 + 0.04 + 0.36) / 3))
    assert gait.apex_mean == pytest.approx(0.04)
    # 3 landings in 2 robots x 2 steps x 20 ms x 4 feet.
    assert gait.stride_frequency == pytest.approx(3 / (2 * 2 * 0.02 * 4))


def test_figures_can_be_of_some_robots_only():
    env, meter = _make_meter()
    env.base_lin_vel = torch.tensor([[1.0, 0.0, 0.0], [0.2, 0.0, 0.0]])
    env.fallen = torch.tensor([True, False])
    meter.update(COMMAND, NOBODY)
    gait = meter.gait(torch.tensor([False, True]))
    assert gait.speed == pytest.approx(0.2)
    assert gait.fall_rate == 0.0
    assert meter.gait().fall_rate == 0.5


def test_where_nothing_landed_the_figures_of_landings_are_nan_and_the_others_are_not():
    _, meter = _make_meter()
    meter.update(COMMAND, NOBODY)
    gait = meter.gait()
    assert all(map(math.isnan, (gait.landing_speed_mean, gait.landing_speed_rms, gait.apex_mean)))
    assert gait.stride_frequency == 0.0
    assert gait.speed == 0.0


def test_before_anything_was_measured_means_are_nan():
    _, meter = _make_meter()
    gait = meter.gait()
    assert math.isnan(gait.speed)
    assert math.isnan(gait.stride_frequency)
    assert gait.fall_rate == 0.0


def test_the_time_to_settle_is_left_out_of_every_episode():
    env, meter = _make_meter(settle_time=0.04)  # two steps
    # Robot 1's episode ends with step 2 (from 0), so that it settles again in steps 3 and 4.
    for step in range(6):
        env.base_lin_vel = torch.tensor([[float(step), 0.0, 0.0], [10.0 * step, 0.0, 0.0]])
        meter.update(COMMAND, torch.tensor([False, step == 2]))
    assert meter.gait(torch.tensor([True, False])).speed == pytest.approx((2 + 3 + 4 + 5) / 4)
    assert meter.gait(torch.tensor([False, True])).speed == pytest.approx(50.0)


def test_the_step_that_ends_an_episode_is_not_measured_as_its_state_is_the_next_ones():
    env, meter = _make_meter()
    env.base_lin_vel = torch.tensor([[0.4, 0.0, 0.0], [float("nan"), 0.0, 0.0]])
    meter.update(COMMAND, torch.tensor([False, True]))
    assert meter.gait().speed == pytest.approx(0.4)


def test_a_fall_counts_while_settling_and_a_robot_only_once():
    env, meter = _make_meter(settle_time=1.0)
    env.fallen = torch.tensor([True, False])
    meter.update(COMMAND, torch.tensor([True, False]))
    meter.update(COMMAND, torch.tensor([True, False]))
    env.fallen = NOBODY
    meter.update(COMMAND, NOBODY)
    assert meter.gait().fall_rate == 0.5


def test_unstable_simulations_and_invalid_actions_are_counted_every_time_and_are_no_falls():
    env, meter = _make_meter(settle_time=1.0)
    env.unstable = torch.tensor([True, False])
    env.invalid_action = torch.tensor([True, True])
    for _ in range(2):
        meter.update(COMMAND, env.unstable)
    env.unstable = NOBODY
    meter.update(COMMAND, NOBODY)
    gait, second = meter.gait(), meter.gait(torch.tensor([False, True]))
    assert (gait.unstable, gait.invalid_actions, gait.fall_rate) == (2, 6, 0.0)
    assert (second.unstable, second.invalid_actions) == (0, 3)


def test_the_figures_have_the_names_that_others_print():
    _, meter = _make_meter()
    assert list(meter.gait().as_dict()) == [
        "speed",
        "velocity_error_sq",
        "yaw_rate_error_sq",
        "landing_speed_mean",
        "landing_speed_rms",
        "apex_mean",
        "duty_factor",
        "stride_frequency",
        "power",
        "fall_rate",
        "unstable",
        "invalid_actions",
    ]
    assert isinstance(meter.gait(), Gait)
