"""What of a command a robot is asked for by now, and how far it is from that."""

from __future__ import annotations

import math

import torch

from .rewards import RewardsCfg

__all__ = ["FollowedVelocity"]


class FollowedVelocity:
    """The velocity that the following terms ask for, and the mean of what is missing to it.

    Both are (v_x, v_y, w_z) in the body frame, in m/s and rad/s. Shapes: (num_envs, 3). What is
    missing to the yaw rate is averaged over a longer time as well.
    """

    def __init__(
        self, cfg: RewardsCfg, step_dt: float, num_envs: int, device: torch.device
    ) -> None:
        """Begin at rest.

        Args:
            cfg: Acceleration and time of the average.
            step_dt: Control step, s.
            num_envs: Number of robots.
            device: Where they are.
        """
        acceleration, time = cfg.following_acceleration, cfg.following_time
        self._step = acceleration * step_dt if acceleration else math.inf
        self._share = -math.expm1(-step_dt / time) if time else 1.0
        self._drift_share = -math.expm1(-step_dt / _DRIFT_TIME)
        self.reference = torch.zeros(num_envs, 3, device=device)
        """The command, or what lies on the way to it where the acceleration is bounded."""
        self.error = torch.zeros(num_envs, 3, device=device)
        """What is missing to it, an exponential average over `RewardsCfg.following_time`."""
        self.drift = torch.zeros(num_envs, device=device)
        """What is missing to its yaw rate, an average over 2 s, rad/s. Shape: (num_envs,)."""

    def update(
        self, command: torch.Tensor, base_lin_vel: torch.Tensor, base_ang_vel: torch.Tensor
    ) -> torch.Tensor:
        """Take in a control step and return the error. Shape: (num_envs, 3).

        Args:
            command: (v_x, v_y, w_z, beta), m/s and rad/s. Shape: (num_envs, 4).
            base_lin_vel: Trunk velocity in the body frame, m/s. Shape: (num_envs, 3).
            base_ang_vel: Trunk angular velocity in the body frame, rad/s. Shape: (num_envs, 3).
        """
        change = (command[:, :3] - self.reference).clamp(-self._step, self._step)
        self.reference = self.reference + change
        velocity = torch.cat((base_lin_vel[:, :2], base_ang_vel[:, 2:]), dim=1)
        missing = self.reference - velocity
        self.error = self.error.lerp(missing, self._share)
        self.drift = self.drift.lerp(missing[:, 2], self._drift_share)
        return self.error

    def reset(self, mask: torch.Tensor) -> None:
        """Let masked robots begin at rest. Shape: (num_envs,), bool."""
        column = mask.unsqueeze(1)
        self.reference = self.reference.masked_fill(column, 0.0)
        self.error = self.error.masked_fill(column, 0.0)
        self.drift = self.drift.masked_fill(mask, 0.0)

    def state_dict(self) -> dict[str, torch.Tensor]:
        """Return all that is needed to continue bit for bit."""
        return {name: getattr(self, name).clone() for name in _STATE}

    def load_state_dict(self, state: dict[str, torch.Tensor]) -> None:
        """Continue from a `state_dict`."""
        for name in _STATE:
            if name in state:  # earlier versions have no drift
                setattr(self, name, state[name].to(self.error.device, copy=True))


_DRIFT_TIME = 2.0
"""Some strides long, s: what is left then is where the robot turns to."""

_STATE = ("reference", "error", "drift")
