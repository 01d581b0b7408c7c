"""Holds the heading while no turn is asked for: what a policy that sees yaw rates alone cannot.

A stair that a foot strikes turns a robot, and so do legs that are not quite alike; with yaw rates
alone to go by, it goes on in the new direction. So the angle that it has turned by since it was
last asked to turn is summed up, from the gyroscope, and some yaw rate is asked for against it.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch

from mute.config import TaskCfg
from mute.envs.observations import OBSERVATION_WIDTHS, slices

__all__ = ["HeadingHold", "heading_hold"]

_MOST_TURNED = 0.6
"""Angle up to which it remembers how far a robot has turned, rad: whoever turned it further means
it, or stands in its way."""
_MOST_RATE = 0.5
"""Yaw rate that it asks for at most, rad/s."""


@dataclass(frozen=True)
class HeadingHold:
    """A function of the scaled observation and of the angle turned by so far; no learning in it."""

    gain: float
    """Yaw rate to turn back with, for each radian that the robot has turned by, 1/s."""
    step_dt: float
    """Control period, s."""
    ang_vel_scale: float
    """Factor of the angular velocity in the observation."""
    gravity_scale: float
    """Factor of gravity's direction in it."""
    command_scale: float
    """Factor of the command in it."""

    def step(self, obs: torch.Tensor, turned: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return what the policy is to see, and the angle turned by from now on.

        Both are those of before where a turn is asked for, or to stand, and the angle is 0 there.
        It is the vertical part of the angular velocity that counts: a trunk on stairs is tilted.

        Args:
            obs: The group `policy`. Shape: (num_envs, OBS_DIM).
            turned: The angle to the left, rad; 0 to begin with. Shape: (num_envs, 1).
        """
        rate = (obs[:, _ANG_VEL] * obs[:, _GRAVITY]).sum(dim=1, keepdim=True)
        rate = rate * (-1.0 / (self.ang_vel_scale * self.gravity_scale))
        speed_sq = (obs[:, _VELOCITY] * obs[:, _VELOCITY]).sum(dim=1, keepdim=True)
        asked = obs[:, _YAW_RATE]
        # Products of truths, as numbers: a graph of few operators runs everywhere.
        holds = (speed_sq > 0.0).float() * (1.0 - (asked * asked > 0.0).float())
        turned = holds * (turned + self.step_dt * rate).clamp(-_MOST_TURNED, _MOST_TURNED)
        against = (-self.gain * turned).clamp(-_MOST_RATE, _MOST_RATE)
        asked = asked + self.command_scale * against
        before, after = obs[:, : _YAW_RATE.start], obs[:, _YAW_RATE.stop :]
        return torch.cat((before, asked, after), dim=1), turned


def heading_hold(cfg: TaskCfg) -> HeadingHold | None:
    """Return what holds the heading of a task's robots, or None where nothing does."""
    scales = cfg.env.observations.scales
    if cfg.agent.heading_gain == 0.0:
        return None
    return HeadingHold(
        cfg.agent.heading_gain,
        cfg.env.step_dt,
        scales["base_ang_vel"],
        scales["projected_gravity"],
        scales["command"],
    )


_PARTS = slices(OBSERVATION_WIDTHS)
_ANG_VEL, _GRAVITY = _PARTS["base_ang_vel"], _PARTS["projected_gravity"]
_VELOCITY = slice(_PARTS["command"].start, _PARTS["command"].start + 2)
_YAW_RATE = slice(_VELOCITY.stop, _VELOCITY.stop + 1)
