"""What the motors are to do: torques, and where the joints are to be, in each physics step to come.

The motors hold set points with a stiffness and damping of their own. A set point that is ahead of
where a joint should be, by the torque over the stiffness, makes them push with that torque, and
hold the joint to its path beside.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mute.envs.base_state import GRAVITY
from mute.envs.scene import FOOT_RADIUS

from .body import Body
from .legs import foot_jacobians, joints_of_feet, sole_jacobians
from .senses import Moment
from .swing import swing_curve
from .turning import cross, into

__all__ = ["JointTargets", "set_points", "stance_targets", "swing_targets"]

Array = NDArray[np.floating]

_FASTEST = 20.0
"""Largest speed of a joint that is asked for, rad/s: what the calf's motor can do."""
_SHORTLY = 1e-3
"""Time over which a change of speed is taken, s."""
_SINGULAR = 1e-3
"""Keeps a Jacobian invertible where a leg is stretched out, m."""


@dataclass(frozen=True)
class JointTargets:
    """What legs are to do over the coming physics steps. Shape of each: (n, steps, 4, 3)."""

    torque: Array
    """Ahead of what holds the joints to their path, N m."""
    joint_pos: Array
    """rad."""
    joint_vel: Array
    """rad/s."""

    def merged(self, other: JointTargets, legs: NDArray[np.bool_]) -> JointTargets:
        """Return these, with those of another for some legs. Shape: (n, 4), or (n, 1) for all."""
        at = legs[:, None, :, None]
        return JointTargets(
            np.where(at, other.torque, self.torque),
            np.where(at, other.joint_pos, self.joint_pos),
            np.where(at, other.joint_vel, self.joint_vel),
        )


def stance_targets(
    now: Moment, body: Body, forces: Array, sinking: Array, ahead: Array
) -> JointTargets:
    """Return what legs on the ground are to do: push, while the trunk moves over the feet.

    Args:
        now: What is known of n robots.
        body: The robot.
        forces: Of the ground on the feet, world, N. Shape: (n, 4, 3).
        sinking: Speed at which feet are lowered that do not touch the ground, m/s; these do not
            push. Shape: (n, 4).
        ahead: Times from now, s. Shape: (steps,).
    """
    below = -FOOT_RADIUS * now.turn[:, None, 2]  # as the trunk sees it
    arms = now.feet - now.place[:, None] - (0.0, 0.0, FOOT_RADIUS)
    over = -now.velocity[:, None] - cross(now.ang_vel[:, None], arms)
    over[..., 2] -= sinking
    soles = foot_jacobians(now.joint_pos) + sole_jacobians(now.joint_pos, below)
    joint_vel = _joint_speeds(soles, into(now.turn, over))
    joint_pos = now.joint_pos[:, None] + joint_vel[:, None] * ahead[:, None, None]
    push = np.where(sinking[..., None] > 0.0, 0.0, into(now.turn, forces))
    soles = foot_jacobians(joint_pos) + sole_jacobians(joint_pos, below[:, None])
    still = np.zeros_like(joint_pos)
    torque = body.legs.torques(joint_pos, still, still, _gravity(now))
    torque -= (soles.swapaxes(-1, -2) @ push[:, None, ..., None])[..., 0]
    return JointTargets(torque, joint_pos, np.broadcast_to(joint_vel[:, None], joint_pos.shape))


def swing_targets(
    now: Moment,
    body: Body,
    start: Array,
    landing: Array,
    height: float,
    progress: Array,
    duration: float,
    ahead: Array,
) -> JointTargets:
    """Return what legs in the air are to do: carry their feet along the swing's curve.

    Args:
        now: What is known of n robots.
        body: The robot.
        start: Where the feet left the ground, m. Shape: (n, 4, 3).
        landing: Where they are to land, m. Shape: (n, 4, 3).
        height: To lift them to, m.
        progress: Of the swing in each step. Shape: (n, steps).
        duration: Of the swing, s.
        ahead: Times from now, s. Shape: (steps,).
    """
    # Each time twice, shortly after one another: what speeds change by is a difference.
    times = np.concatenate((ahead, ahead + _SHORTLY))
    progress = np.concatenate((progress, progress + _SHORTLY / duration), axis=1)
    legs = np.broadcast_to(progress[..., None], (*progress.shape, 4))
    place, velocity = swing_curve(start[:, None], landing[:, None], height, legs, duration)
    trunk = now.place[:, None] + now.velocity[:, None] * times[:, None]
    arms = place - trunk[:, :, None]
    moving = velocity - now.velocity[:, None, None] - cross(now.ang_vel[:, None, None], arms)
    joint_pos = joints_of_feet(into(now.turn, arms))
    joint_vel = _joint_speeds(foot_jacobians(joint_pos), into(now.turn, moving))
    count = len(ahead)
    joint_acc = (joint_vel[:, count:] - joint_vel[:, :count]) / _SHORTLY
    joint_pos, joint_vel = joint_pos[:, :count], joint_vel[:, :count]
    torque = body.legs.torques(joint_pos, joint_vel, joint_acc, _gravity(now))
    return JointTargets(torque, joint_pos, joint_vel)


def set_points(targets: JointTargets, body: Body) -> Array:
    """Return the set points of the motors, rad. Shape: (n, steps, 4, 3)."""
    ahead = (targets.torque + body.damping * targets.joint_vel) / body.stiffness
    return targets.joint_pos + ahead


def _gravity(now: Moment) -> Array:
    """Return gravity in the trunk's frame, m/s^2. Shape: (n, 3)."""
    return -GRAVITY * now.turn[:, 2]


def _joint_speeds(jacobians: Array, feet: Array) -> Array:
    """Return the joints' speeds that move the feet so, m/s -> rad/s, by damped least squares."""
    transposed = jacobians.swapaxes(-1, -2)
    square = transposed @ jacobians + _SINGULAR**2 * np.eye(3)
    speeds = np.linalg.solve(square, transposed @ feet[..., None])[..., 0]
    return np.clip(speeds, -_FASTEST, _FASTEST)
