"""What a control step logs of all robots: scalars by name; what did not happen is left out."""

from __future__ import annotations

import torch
from torch import Tensor

from .curriculum import Curriculum
from .footfall import Footfalls
from .terrain import BoxGround, Ground

__all__ = ["curriculum_log", "episode_log", "gait_log", "ground_log"]


def gait_log(
    command: Tensor, base_lin_vel: Tensor, power: Tensor, footfalls: Footfalls
) -> dict[str, Tensor]:
    """Return how well the robots follow their commands, and how they land at low and high beta.

    Args:
        command: (v_x, v_y, w_z, beta). Shape: (num_envs, 4).
        base_lin_vel: Velocity of the trunk in its frame, m/s. Shape: (num_envs, 3).
        power: Power of the motors, W. Shape: (num_envs,).
        footfalls: Contacts and landings of the feet.
    """
    error = (command[:, :2] - base_lin_vel[:, :2]).square().sum(dim=1)
    log = {
        "Gait/velocity_error_sq": error.mean(),
        "Gait/power": power.mean(),
        "Gait/duty_factor": footfalls.contact_share.mean(),
    }
    beta = command[:, 3]
    for name, chosen in (("low_beta", beta < 0.25), ("high_beta", beta > 0.75)):
        landed = footfalls.touchdown & chosen.unsqueeze(1)
        if bool(landed.any()):
            log[f"Gait/landing_speed_{name}"] = footfalls.landing_speed[landed].mean()
            log[f"Gait/apex_{name}"] = footfalls.swing_apex[landed].mean()
    return log


def episode_log(
    dones: Tensor, fallen: Tensor, unstable: Tensor, invalid_action: Tensor
) -> dict[str, Tensor]:
    """Return how episodes ended, and how many robots went wrong. All shapes: (num_envs,), bool.

    Args:
        dones: Robots whose episode ended.
        fallen: Robots that fell.
        unstable: Robots whose simulation blew up, which is no fall.
        invalid_action: Robots whose action held NaN or infinity.
    """
    log = {
        "Episode/unstable": unstable.sum().float(),
        "Episode/invalid_actions": invalid_action.sum().float(),
    }
    if bool(dones.any()):
        log["Episode/fall_rate"] = fallen.sum() / dones.sum()
    return log


def curriculum_log(factors: Curriculum, device: torch.device | str) -> dict[str, Tensor]:
    """Return the factors on the device of the rest."""
    return {
        f"Curriculum/{name}": torch.full((), factor, device=device)
        for name, factor in factors._asdict().items()
    }


def ground_log(ground: Ground) -> dict[str, Tensor]:
    """Return the mean level of each kind of ground that has levels."""
    if not isinstance(ground, BoxGround):
        return {}
    return {
        f"Ground/level_{name}": ground.level[ground.kind == index].float().mean()
        for index, name in enumerate(ground.kinds)
        if name != "flat"
    }
