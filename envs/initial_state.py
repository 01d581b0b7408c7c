"""How a robot begins an episode: near the stance, in any direction, hardly moving."""

from __future__ import annotations

import torch

from .quadruped_env_cfg import QuadrupedEnvCfg
from .simulation import Simulation

__all__ = ["NUM_DRAWS", "place"]

NUM_DRAWS = 19
"""Random numbers that a robot needs: joints, velocities of its trunk, heading."""


def place(
    simulation: Simulation,
    mask: torch.Tensor,
    draw: torch.Tensor,
    heading: torch.Tensor,
    stand: torch.Tensor,
    cfg: QuadrupedEnvCfg,
) -> None:
    """Write the first state and set points of the masked robots; no other robot is touched.

    Args:
        simulation: The engine, with those robots in its keyframe of the stance.
        mask: Robots that begin anew. Shape: (num_envs,), bool.
        draw: Random numbers in [-1, 1). Shape: (num_envs, NUM_DRAWS).
        heading: Direction of each robot, where directions are random, rad. Shape: (num_envs,).
        stand: Joint positions of the stance, rad. Shape: (12,).
        cfg: The task.
    """
    column = mask.unsqueeze(1)
    qpos, qvel = simulation.qpos, simulation.qvel
    joint_pos = stand + cfg.initial_joint_noise * draw[:, :12]
    qpos[:, 7:] = torch.where(column, joint_pos, qpos[:, 7:])
    qvel[:, :6] = torch.where(column, cfg.initial_velocity * draw[:, 12:18], qvel[:, :6])
    if cfg.random_heading:
        half = 0.5 * heading
        zero = torch.zeros_like(half)
        turned = torch.stack((half.cos(), zero, zero, half.sin()), dim=1)
        qpos[:, 3:7] = torch.where(column, turned, qpos[:, 3:7])
    simulation.ctrl[:] = torch.where(column, stand, simulation.ctrl)
