"""Where the robots that begin anew are put, from given draws."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest
import torch

from mute.envs.initial_state import NUM_DRAWS, place
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg

STAND = torch.arange(12.0)


def _placed(**given: Any) -> Any:
    engine: Any = SimpleNamespace(
        qpos=torch.full((2, 19), 9.0), qvel=torch.full((2, 18), 9.0), ctrl=torch.full((2, 12), 9.0)
    )
    cfg = QuadrupedEnvCfg(initial_joint_noise=0.1, initial_velocity=0.2, **given)
    mask, heading = torch.tensor([True, False]), torch.full((2,), 0.5 * math.pi)
    place(engine, mask, torch.full((2, NUM_DRAWS), 0.5), heading, STAND, cfg)
    return engine


def test_joints_and_velocities_lie_off_the_stance_by_their_share_of_the_draw():
    engine = _placed()
    torch.testing.assert_close(engine.qpos[0, 7:], STAND + 0.05)
    torch.testing.assert_close(engine.qvel[0, :6], torch.full((6,), 0.1))
    assert engine.ctrl[0].tolist() == STAND.tolist()


def test_a_robot_is_turned_to_the_heading_that_it_is_given():
    engine = _placed()
    half = 0.5**0.5  # cos and sin of half the angle, pi / 4
    assert engine.qpos[0, 3:7].tolist() == pytest.approx([half, 0.0, 0.0, half])
    assert _placed(random_heading=False).qpos[0, 3:7].tolist() == [9.0] * 4


def test_robots_that_do_not_begin_anew_are_left_as_they_are():
    engine = _placed()
    assert all((part[1] == 9.0).all() for part in (engine.qpos, engine.qvel, engine.ctrl))
