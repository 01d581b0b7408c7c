"""The slope under a robot is that of the ground that its feet are over."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from mute.envs.base_state import base_state
from mute.envs.reward_terms import REWARD_FUNCTIONS
from mute.envs.terrain.slope import slope_under
from tests.helpers.motion_helpers import make_motion

FEET = torch.tensor([[[0.2, -0.13], [0.19, 0.12], [-0.22, -0.14], [-0.18, 0.13]]])


def _turned(places: torch.Tensor, angle: float) -> torch.Tensor:
    cos, sin = math.cos(angle), math.sin(angle)
    return places @ torch.tensor([[cos, sin], [-sin, cos]])


@pytest.mark.parametrize("angle", [0.0, 0.7, -2.5])
def test_the_slope_of_a_plane_is_the_planes_in_the_heading_frame(angle):
    rise = torch.tensor([0.3, -0.1])  # along the heading, to the left
    feet = _turned(FEET, angle) + torch.tensor([5.0, -3.0])
    heading = torch.tensor([[math.cos(angle), math.sin(angle)]])
    slope = slope_under(feet, FEET @ rise + 0.8, heading)
    torch.testing.assert_close(slope, rise[None], rtol=1e-3, atol=1e-4)


def test_a_step_between_the_feet_counts_by_how_far_they_are_apart():
    heights = torch.tensor([[0.08, 0.08, 0.0, 0.0]])
    feet = torch.tensor([[[0.2, -0.1], [0.2, 0.1], [-0.2, -0.1], [-0.2, 0.1]]])
    slope = slope_under(feet, heights, torch.tensor([[1.0, 0.0]]))
    torch.testing.assert_close(slope, torch.tensor([[0.2, 0.0]]), rtol=1e-3, atol=1e-6)


def test_feet_in_one_place_have_no_slope():
    slope = slope_under(torch.zeros(1, 4, 2), torch.rand(1, 4), torch.tensor([[1.0, 0.0]]))
    assert torch.equal(slope, torch.zeros(1, 2))


def test_a_trunk_along_a_diagonal_slope_does_not_lean():
    slope = np.array([0.6, 0.5])
    x = np.array([1.0, 0.0, slope[0]]) / np.hypot(1.0, slope[0])
    normal = np.array([-slope[0], -slope[1], 1.0])
    normal /= np.linalg.norm(normal)
    gravity = [-x[2], -np.cross(normal, x)[2], -normal[2]]
    motion = make_motion(projected_gravity=[gravity] * 2, ground_slope=[slope, [0.0, 0.0]])
    leaning = REWARD_FUNCTIONS["lean"].function(motion)
    assert float(leaning[0]) == pytest.approx(0.0, abs=1e-9)
    assert float(leaning[1]) > 0.1


@pytest.mark.parametrize(("pitch", "roll"), [(-0.3, 0.0), (0.2, 0.0), (0.0, 0.25)])
def test_a_trunk_that_follows_the_ground_does_not_lean(pitch, roll):
    # About one axis of the body alone, pitch downwards and roll to the right.
    half = 0.5 * (pitch + roll)
    axis = [math.sin(half) * (roll != 0.0), math.sin(half) * (pitch != 0.0)]
    qpos = torch.tensor([[0.0, 0.0, 0.3, math.cos(half), *axis, 0.0] + [0.0] * 12]).repeat(2, 1)
    gravity = base_state(qpos.double(), torch.zeros(2, 18).double()).projected_gravity
    slope = [-math.tan(pitch), math.tan(roll)]
    motion = make_motion(projected_gravity=gravity.tolist(), ground_slope=[slope, [0.0, 0.0]])
    leaning = REWARD_FUNCTIONS["lean"].function(motion)
    expected = torch.tensor([0.0, math.sin(pitch + roll) ** 2])
    torch.testing.assert_close(leaning, expected, rtol=1e-4, atol=1e-6)
