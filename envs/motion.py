"""What a control step looked like: all that a reward may read."""

from __future__ import annotations

from dataclasses import dataclass

import torch

__all__ = ["Motion"]


@dataclass(slots=True)
class Motion:
    """What one control step looked like, for the reward. Velocities in m/s, angles in rad."""

    command: torch.Tensor
    """(v_x, v_y, w_z, beta). Shape: (num_envs, 4)."""
    base_lin_vel: torch.Tensor
    """Trunk velocity in the body frame. Shape: (num_envs, 3)."""
    base_ang_vel: torch.Tensor
    """Trunk angular velocity in the body frame. Shape: (num_envs, 3)."""
    velocity_error: torch.Tensor
    """What is missing to the (v_x, v_y, w_z) that the following terms ask for, averaged over
    `RewardsCfg.following_time`. Shape: (num_envs, 3)."""
    yaw_drift: torch.Tensor
    """What is missing to the yaw rate, averaged over 2 s. Shape: (num_envs,)."""
    projected_gravity: torch.Tensor
    """Direction of gravity in the body frame. Shape: (num_envs, 3)."""
    base_height: torch.Tensor
    """Trunk height above the ground, m. Shape: (num_envs,)."""
    joint_pos: torch.Tensor
    """Joint positions relative to the stance. Shape: (num_envs, 12)."""
    joint_vel: torch.Tensor
    """Joint velocities. Shape: (num_envs, 12)."""
    joint_acc: torch.Tensor
    """Joint accelerations over the control step, rad/s^2. Shape: (num_envs, 12)."""
    torque: torch.Tensor
    """Joint torques, N m. Shape: (num_envs, 12)."""
    action: torch.Tensor
    """Action of this step. Shape: (num_envs, 12)."""
    last_action: torch.Tensor
    """Action one step before. Shape: (num_envs, 12)."""
    action_before_last: torch.Tensor
    """Action two steps before. Shape: (num_envs, 12)."""
    collisions: torch.Tensor
    """Number of links other than feet that touch the ground. Shape: (num_envs,)."""
    phase: torch.Tensor
    """Phase of each foot that the phase terms use. Shape: (num_envs, 4)."""
    foot_drop_sq: torch.Tensor
    """Mean over the physics steps of max(-v_z, 0)^2, world frame. Shape: (num_envs, 4)."""
    foot_raise_sq: torch.Tensor
    """Mean over the physics steps of max(v_z, 0)^2, world frame. Shape: (num_envs, 4)."""
    foot_vel_z_substeps: torch.Tensor
    """Vertical velocity of each foot at the last physics step before the control step and at its
    own, world frame. Shape: (1 + num_steps, num_envs, 4)."""
    foot_load: torch.Tensor | None
    """Largest vertical force of the ground on each foot in the control step, in weights of the
    robot; None unless `scene.foot_forces`. Shape: (num_envs, 4)."""
    foot_speed_xy: torch.Tensor
    """Horizontal speed of each foot. Shape: (num_envs, 4)."""
    foot_height: torch.Tensor
    """Clearance under each foot, m. Shape: (num_envs, 4)."""
    foot_lift: torch.Tensor
    """The same above the highest ground near each foot, m. Shape: (num_envs, 4)."""
    contact: torch.Tensor
    """Debounced contact of each foot, bool. Shape: (num_envs, 4)."""
    touchdown: torch.Tensor
    """Feet that landed, bool. Shape: (num_envs, 4)."""
    landing_speed: torch.Tensor
    """Landing speed of the feet that landed, else 0. Shape: (num_envs, 4)."""
    stride_time: torch.Tensor
    """Time since the last landing of the feet that landed, else 0, s. Shape: (num_envs, 4)."""
    swing_apex: torch.Tensor
    """How far the current or last swing got above the highest ground near it, m.
    Shape: (num_envs, 4)."""
    ground_slope: torch.Tensor
    """Rise of the ground from foot to foot, along the heading and to the left, m a metre.
    Shape: (num_envs, 2)."""
    fallen: torch.Tensor
    """Robots whose episode this step ends by a fall, bool. Shape: (num_envs,)."""
