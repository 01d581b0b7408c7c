"""The trunk's state in its own frame, computed by hand for simple poses."""

from __future__ import annotations

import math

import pytest
import torch

from mute.envs.base_state import base_state

HALF = math.sqrt(0.5)


@pytest.mark.parametrize(
    ("quaternion", "lin_vel", "gravity", "heading"),
    [
        # Level, and facing along x.
        ((1.0, 0.0, 0.0, 0.0), (1.0, 2.0, 3.0), (0.0, 0.0, -1.0), (1.0, 0.0)),
        # Turned to the left by a right angle: the world's y is ahead, its x to the right.
        ((HALF, 0.0, 0.0, HALF), (2.0, -1.0, 3.0), (0.0, 0.0, -1.0), (0.0, 1.0)),
        # Rolled to its right side: its y points up, so that gravity points along -y.
        ((HALF, HALF, 0.0, 0.0), (1.0, 3.0, -2.0), (0.0, -1.0, 0.0), (1.0, 0.0)),
    ],
)
def test_velocity_and_gravity_are_turned_into_the_body_frame(quaternion, lin_vel, gravity, heading):
    qpos = torch.tensor([[5.0, 6.0, 7.0, *quaternion, 0.1]])
    qvel = torch.tensor([[1.0, 2.0, 3.0, 0.4, 0.5, 0.6, 0.7]])
    base = base_state(qpos, qvel)
    assert base.pos.tolist() == [[5.0, 6.0, 7.0]]
    assert base.ang_vel.tolist() == qvel[:, 3:6].tolist()
    torch.testing.assert_close(base.lin_vel, torch.tensor([lin_vel]))
    torch.testing.assert_close(base.projected_gravity, torch.tensor([gravity]))
    torch.testing.assert_close(base.heading, torch.tensor([heading]))


def test_a_trunk_that_stands_on_end_has_a_finite_heading():
    qpos = torch.tensor([[0.0, 0.0, 0.3, HALF, 0.0, HALF, 0.0]])
    assert base_state(qpos, torch.zeros(1, 6)).heading.isfinite().all()
