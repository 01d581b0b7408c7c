"""What a robot knows of itself at the beginning of a control step, from what it measures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from tensordict import TensorDict

from mute.envs.base_state import GRAVITY
from mute.envs.observations import OBSERVATION_WIDTHS, SENSOR_WIDTHS, privileged_widths, slices
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.scene import FOOT_RADIUS

from .body import Body
from .legs import foot_jacobians, foot_positions, sole_jacobians
from .odometry import Attitude, LegOdometry
from .turning import cross, packed, turned

__all__ = ["Moment", "Senses"]

Array = NDArray[np.floating]

_OBSERVED = slices(OBSERVATION_WIDTHS)
_SENSED = slices(SENSOR_WIDTHS)

_VELOCITY = slices(privileged_widths(0))["base_lin_vel"]
"""The first columns, however many heights there are."""

_ALL_OF_IT = 0.99
"""Share of a control step in contact from which on a foot tells how fast the trunk is: where it
bounces, it is drawn backwards in the air."""


@dataclass(frozen=True)
class Moment:
    """What n robots know, in the directions of a world in which each began along x."""

    joint_pos: Array
    """rad. Shape: (n, 4, 3)."""
    turn: Array
    """From the trunk's frame to the world's. Shape: (n, 3, 3)."""
    yaw: Array
    """Heading, rad. Shape: (n,)."""
    ang_vel: Array
    """Of the trunk, rad/s. Shape: (n, 3)."""
    place: Array
    """Of the trunk, m. Shape: (n, 3)."""
    velocity: Array
    """Of the trunk, m/s. Shape: (n, 3)."""
    feet: Array
    """Places of their centres, m. Shape: (n, 4, 3)."""
    touching: NDArray[np.bool_]
    """Which feet touch the ground. Shape: (n, 4)."""
    command: Array
    """(v_x, v_y, w_z) in the heading frame, m/s and rad/s. Shape: (n, 3)."""

    @property
    def asked(self) -> Array:
        """The velocity that is asked for, m/s. Shape: (n, 3)."""
        forward, left = self.command[:, 0], self.command[:, 1]
        cos, sin = np.cos(self.yaw), np.sin(self.yaw)
        x, y = cos * forward - sin * left, sin * forward + cos * left
        return packed(x, y, np.zeros_like(x))


class Senses:
    """Follows attitude, place and velocity of each robot by its observations."""

    def __init__(self, cfg: QuadrupedEnvCfg, body: Body, true_velocity: bool) -> None:
        """Start with no past.

        Args:
            cfg: The robots' environment, whose observations have the group `sensors`.
            body: The robot.
            true_velocity: Whether the velocity is the true one.
        """
        num_envs = cfg.num_envs
        self._true_velocity = true_velocity
        self._step_dt = cfg.step_dt
        self._scales = cfg.observations.scales
        self._stand = body.stand
        self._attitude = Attitude(num_envs)
        self._odometry = LegOdometry(num_envs)

    def reset(self, robots: NDArray[np.bool_]) -> None:
        """Forget the past of some robots. Shape: (num_envs,)."""
        self._attitude.reset(robots)
        self._odometry.reset(robots)

    def update(self, observations: TensorDict, stance: NDArray[np.bool_]) -> Moment:
        """Take in what was measured in a control step.

        Args:
            observations: Groups `policy` and `sensors`, and `privileged` for the true velocity.
            stance: Which feet were to stand in it. Shape: (num_envs, 4).
        """
        seen = _numbers(observations, "policy")
        sensed = _numbers(observations, "sensors")
        part = {name: seen[:, at] / self._scales[name] for name, at in _OBSERVED.items()}
        joint_pos = part["joint_pos"].reshape(-1, 4, 3) + self._stand
        joint_vel = part["joint_vel"].reshape(-1, 4, 3, 1)
        ang_vel = part["base_ang_vel"]
        contact = sensed[:, _SENSED["foot_contact"]]
        self._attitude.update(ang_vel, part["projected_gravity"], self._step_dt)
        turn = self._attitude.turn
        legs = foot_positions(joint_pos)
        below = -FOOT_RADIUS * turn[:, None, 2]  # the world's vertical, as the trunk sees it
        # A sole does not move where it stands; the centre of a foot that rolls does.
        rolling = -(sole_jacobians(joint_pos, below) @ joint_vel)[..., 0]
        rolling -= cross(ang_vel[:, None], below)
        moving = (foot_jacobians(joint_pos) @ joint_vel)[..., 0] - rolling
        moving += cross(ang_vel[:, None], legs)
        legs = turned(turn, legs)
        acceleration = turned(turn, sensed[:, _SENSED["specific_force"]])
        acceleration[:, 2] -= GRAVITY
        odometry = self._odometry
        odometry.update(
            acceleration,
            legs,
            turned(turn, moving),
            turned(turn, rolling),
            stance & (contact > _ALL_OF_IT),
            self._step_dt,
        )
        velocity = odometry.velocity.copy()
        if self._true_velocity:
            velocity = turned(turn, _numbers(observations, "privileged")[:, _VELOCITY])
        return Moment(
            joint_pos=joint_pos,
            turn=turn,
            yaw=self._attitude.yaw,
            ang_vel=turned(turn, ang_vel),
            place=odometry.place.copy(),
            velocity=velocity,
            feet=odometry.place[:, None] + legs,
            touching=contact > 0.0,
            command=part["command"][:, :3],
        )


def _numbers(observations: TensorDict, group: str) -> Array:
    return observations[group].double().cpu().numpy()
