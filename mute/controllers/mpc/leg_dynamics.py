"""What it takes to move a leg: inertia, weight and the pull of its own motion, joint by joint.

A leg is a thigh and a calf that turn in one plane, and that plane about the hip's axis. What a
motion of the hip does to that of the others, and they to it, is left out where it goes with speeds;
a swing hardly moves the hip. Arrays of joints are (n, ..., 4, 3), as in `legs`.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from mute.envs.scene import LEGS

from .legs import LINK, OFFSETS
from .turning import packed

__all__ = ["LegDynamics"]

Array = NDArray[np.floating]


@dataclass(frozen=True)
class _Point:
    """How the centre of mass of a link moves."""

    jacobian: Array
    """With the joints, m/rad. Shape: (n, ..., 4, 3, 3)."""
    pulled: Array
    """Its acceleration while the joints keep their speeds, m/s^2. Shape: (n, ..., 4, 3)."""


class LegDynamics:
    """Masses and inertias of the legs of a model."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """Read them from the model."""
        bodies = [[model.body(f"{leg}_{part}").id for part in _PARTS] for leg in LEGS]
        self._mass = model.body_mass[bodies]
        self._com = model.body_ipos[bodies]
        turns = np.array([_about_axes(model, body) for body in np.ravel(bodies)])
        turns = turns.reshape(len(LEGS), len(_PARTS), 3)
        stand = model.key("stand").qpos[7:].reshape(len(LEGS), len(_PARTS))
        dofs = [[model.joint(f"{leg}_{part}_joint").dofadr[0] for part in _PARTS] for leg in LEGS]
        self._rotors = model.dof_armature[dofs]
        # Of the links' own turning: all about the hip's axis, as they are in the stance, thigh and
        # calf about theirs.
        tilt = np.cumsum(stand * (0.0, 1.0, 1.0), axis=1)
        about_hip = turns[..., 0] * np.cos(tilt) ** 2 + turns[..., 2] * np.sin(tilt) ** 2
        own = np.zeros((len(LEGS), 3, 3))
        own[:, 0, 0] = about_hip.sum(axis=1)
        own[:, 1, 1] = turns[:, 1, 1] + turns[:, 2, 1]
        own[:, 1, 2] = own[:, 2, 1] = own[:, 2, 2] = turns[:, 2, 1]
        self._own = own + self._rotors[..., None] * np.eye(3)

    def torques(
        self, joint_pos: Array, joint_vel: Array, joint_acc: Array, gravity: Array
    ) -> Array:
        """Return the torques of a motion of the legs, the trunk being at rest, N m.

        Args:
            joint_pos: rad. Shape: (n, ..., 4, 3).
            joint_vel: rad/s. The same shape.
            joint_acc: rad/s^2. The same shape.
            gravity: In the trunk's frame, m/s^2. Shape: (n, 3).

        Returns:
            Shape: (n, ..., 4, 3).
        """
        falls = gravity.reshape(len(gravity), *[1] * (joint_pos.ndim - 2), 3)
        torque = (self._own @ joint_acc[..., None])[..., 0]
        hip = np.sin(joint_pos[..., 0]), np.cos(joint_pos[..., 0])
        for link in range(len(_PARTS)):
            point = self._point(joint_pos, joint_vel, link, hip)
            speeds_up = (point.jacobian @ joint_acc[..., None])[..., 0] + point.pulled - falls
            force = self._mass[:, link, None] * speeds_up
            torque += (point.jacobian.swapaxes(-1, -2) @ force[..., None])[..., 0]
        return torque

    def _point(
        self, joint_pos: Array, joint_vel: Array, link: int, hip: tuple[Array, Array]
    ) -> _Point:
        """Return how the centre of mass of hip, thigh or calf moves, by its number.

        Args:
            joint_pos: rad. Shape: (n, ..., 4, 3).
            joint_vel: rad/s. The same shape.
            link: 0, 1 or 2.
            hip: Sine and cosine of the hip's joint. Shape of each: (n, ..., 4).
        """
        com = self._com[:, link]
        angle = joint_pos[..., 1 : link + 1].sum(axis=-1)
        sin, cos = np.sin(angle), np.cos(angle)
        # In the leg's plane, x forward and z down the leg's own way, from the joint it turns about.
        near = com[:, 0] * cos + com[:, 2] * sin, com[:, 2] * cos - com[:, 0] * sin
        x, z = near
        rate = joint_vel[..., 1 : link + 1].sum(axis=-1)
        pulled_x, pulled_z = -(rate**2) * x, -(rate**2) * z
        if link == _CALF:
            thigh, thigh_rate = joint_pos[..., 1], joint_vel[..., 1] ** 2
            knee = -LINK * np.sin(thigh), -LINK * np.cos(thigh)
            x, z = x + knee[0], z + knee[1]
            pulled_x, pulled_z = pulled_x - thigh_rate * knee[0], pulled_z - thigh_rate * knee[1]
        side = com[:, 1] + (OFFSETS if link else 0.0)
        sin, cos = hip
        jacobian = np.zeros((*joint_pos.shape, 3))
        jacobian[..., 1, 0], jacobian[..., 2, 0] = -z * cos - side * sin, side * cos - z * sin
        for joint, (ahead, up) in enumerate(((z, -x), (near[1], -near[0]))[:link], 1):
            jacobian[..., 0, joint] = ahead
            jacobian[..., 1, joint], jacobian[..., 2, joint] = -up * sin, up * cos
        return _Point(jacobian, packed(pulled_x, -pulled_z * sin, pulled_z * cos))


_CALF = 2
_PARTS = ("hip", "thigh", "calf")


def _about_axes(model: mujoco.MjModel, body: int) -> Array:
    """Return a link's moments of inertia about axes through its centre along its frame's."""
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.body_iquat[body])
    turn = turn.reshape(3, 3)
    return np.diag(turn @ np.diag(model.body_inertia[body]) @ turn.T).copy()
