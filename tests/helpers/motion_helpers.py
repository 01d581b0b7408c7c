"""Motions made by hand, for the tests of what is rewarded."""

from __future__ import annotations

import torch

from mute.envs.motion import Motion

WIDTHS = {
    "command": 4,
    "base_lin_vel": 3,
    "base_ang_vel": 3,
    "velocity_error": 3,
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
    "foot_load": 4,
    "foot_speed_xy": 4,
    "foot_height": 4,
    "foot_lift": 4,
    "contact": 4,
    "touchdown": 4,
    "landing_speed": 4,
    "stride_time": 4,
    "swing_apex": 4,
    "ground_slope": 2,
}


def _padded(row, width):
    return [float(value) for value in row] + [0.0] * (width - len(row))


def make_motion(**given):
    """Make the motion of two robots; rows are filled up with zeros."""
    values = {}
    for name, width in WIDTHS.items():
        rows = given.pop(name, [[], []])
        values[name] = torch.tensor([_padded(row, width) for row in rows])
    for name in ("contact", "touchdown"):
        values[name] = values[name] > 0.5
    for name in ("base_height", "collisions", "yaw_drift"):
        values[name] = torch.tensor(given.pop(name, [0.0, 0.0]))
    # By physics step, then robot.
    values["foot_vel_z_substeps"] = torch.tensor(
        [
            [_padded(row, 4) for row in rows]
            for rows in given.pop("foot_vel_z_substeps", [[[], []], [[], []]])
        ]
    )
    values["fallen"] = torch.tensor(given.pop("fallen", [False, False]))
    assert not given
    return Motion(**values)
