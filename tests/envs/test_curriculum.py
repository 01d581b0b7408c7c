"""Factors that grow, or fade, with the time trained so far."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mute.envs.commands import CommandsCfg
from mute.envs.curriculum import curriculum
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.rewards import RewardsCfg


def _make_cfg(start: float = 0.0, end: float = 0.0) -> QuadrupedEnvCfg:
    ramp = (start, end)
    rewards = RewardsCfg(quiet_ramp=ramp, lift_ramp=ramp, guide_ramp=ramp)
    return QuadrupedEnvCfg(num_envs=1, rewards=rewards, commands=CommandsCfg(ramp=ramp))


@given(
    st.floats(0.0, 100.0),
    st.floats(0.01, 100.0),
    st.integers(0, 20_000),
    st.integers(0, 20_000),
)
def test_factors_stay_in_0_to_1_and_never_turn_back(start, length, steps, more):
    cfg = _make_cfg(start, start + length)
    before, after = curriculum(cfg, steps), curriculum(cfg, steps + more)
    assert all(0.0 <= factor <= 1.0 for factor in (*before, *after))
    assert before.guide >= after.guide
    for name in ("quiet", "lift", "commands"):
        assert getattr(before, name) <= getattr(after, name)


def test_half_of_the_way_is_half_of_the_factor():
    cfg = _make_cfg(10.0, 30.0)
    for seconds, share in ((10.0, 0.0), (15.0, 0.25), (20.0, 0.5), (30.0, 1.0)):
        factors = curriculum(cfg, round(seconds / cfg.step_dt))
        assert factors == pytest.approx((share, share, 1.0 - share, share))


def test_without_ramps_everything_is_there_from_the_start_and_no_guide():
    assert curriculum(_make_cfg(), 0) == (1.0, 1.0, 0.0, 1.0)


def test_each_factor_has_a_ramp_of_its_own():
    rewards = RewardsCfg(quiet_ramp=(0.0, 10.0), lift_ramp=(0.0, 20.0), guide_ramp=(0.0, 40.0))
    cfg = QuadrupedEnvCfg(num_envs=1, rewards=rewards, commands=CommandsCfg(ramp=(0.0, 100.0)))
    factors = curriculum(cfg, round(5.0 / cfg.step_dt))
    assert factors._asdict() == pytest.approx(
        {"quiet": 0.5, "lift": 0.25, "guide": 0.875, "commands": 0.05}
    )
