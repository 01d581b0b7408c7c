"""What the controller knows of the robot as a body: masses, inertia, motors, as it is built.

Payloads, worn motors and slippery feet, which differ between robots, it does not know, as the
controller of a real robot does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from mute.envs.scene import LEGS

from .leg_dynamics import LegDynamics

__all__ = ["Body"]

_FREE = 6
"""Degrees of freedom of the trunk."""


@dataclass(frozen=True)
class Body:
    """The robot in its stance, as one rigid body on legs."""

    mass: float
    """Of all of it, kg."""
    com: NDArray[np.float64]
    """Centre of mass in the trunk's frame, m. Shape: (3,)."""
    inertia: NDArray[np.float64]
    """About the centre of mass, along the trunk's axes, kg m^2. Shape: (3, 3)."""
    legs: LegDynamics
    """What it takes to move the legs."""
    stand: NDArray[np.float64]
    """Joint positions of the stance, rad. Shape: (4, 3)."""
    stiffness: NDArray[np.float64]
    """Of the motors' own controllers, N m/rad. Shape: (4, 3)."""
    damping: NDArray[np.float64]
    """Likewise, N m s/rad. Shape: (4, 3)."""

    @classmethod
    def of(cls, model: mujoco.MjModel) -> Body:
        """Return the body of a robot's model, whose keyframe `stand` is its stance."""
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, model.key("stand").id)
        mujoco.mj_forward(model, data)
        whole = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, whole)
        mass = float(whole[0, 0])
        # Of a level trunk: force along y turns about z by x, and so on.
        com = np.array([whole[1, 5], whole[2, 3], whole[0, 4]]) / mass
        shift = mass * (com @ com * np.eye(3) - np.outer(com, com))
        legs = (len(LEGS), 3)
        return cls(
            mass=mass,
            com=com,
            inertia=whole[3:6, 3:6] - shift,
            legs=LegDynamics(model),
            stand=model.key("stand").qpos[_FREE + 1 :].reshape(legs).copy(),
            stiffness=model.actuator_gainprm[:, 0].reshape(legs).copy(),
            damping=-model.actuator_biasprm[:, 2].reshape(legs),
        )
