"""What a control step logs of all robots: scalars by name; what did not happen is left out."""

from __future__ import annotations

import torch
from torch import Tensor

from .curriculum import Curriculum
from .footfall import Footfalls

__all__ = ["curriculum_log", "episode_log", "gait_log"]


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


def episode_log(terminated: Tensor, time_outs: Tensor, unstable: Tensor) -> dict[str, Tensor]:
    """Return how episodes ended.

    Args:
        terminated: Robots that fell or whose simulation broke. Shape: (num_envs,), bool.
        time_outs: Robots whose time was up. Shape: (num_envs,), bool.
        unstable: Robots whose simulation broke. Shape: (num_envs,), bool.
    """
    log = {"Episode/unstable": unstable.sum().float()}
    finished = terminated | time_outs
    if bool(finished.any()):
        log["Episode/fall_rate"] = terminated.sum() / finished.sum()
    return log


def curriculum_log(factors: Curriculum, device: torch.device | str) -> dict[str, Tensor]:
    """Return the factors on the device of the rest."""
    return {
        f"Curriculum/{name}": torch.full((), factor, device=device)
        for name, factor in factors._asdict().items()
    }
