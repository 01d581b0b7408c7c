"""What physics hands over to be heard: landings, sliding, the work of the joints, and where all is.

The data are plain arrays, so that any simulator (or a test) can make them; `recorder` makes them
from the project's environments. Legs are in the order FR, FL, RR, RL, joints within a leg hip,
thigh, calf.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

__all__ = ["ContactBlock", "Impacts"]


@dataclass
class Impacts:
    """Contact onsets in the order of time. Each array's shape: (n,), but for `position`."""

    time: NDArray
    """Since the recording began, s: the physics step at which the contact was first found."""
    robot: NDArray
    """Index of the robot."""
    foot: NDArray
    """Index of the foot, 0 to 3."""
    speed: NDArray
    """Approach speed along the floor's normal just before contact, m/s, not negative."""
    mass: NDArray
    """Effective mass at the foot along the normal, (n^T J M^-1 J^T n)^-1, kg."""
    floor: NDArray
    """Index into the recording's tuple of floor names."""
    position: NDArray
    """In the world frame, m. Shape: (n, 3)."""

    def __len__(self) -> int:
        return len(self.time)

    def select(self, which: NDArray | slice) -> Impacts:
        """Return some of the impacts, by mask, indices or slice."""
        return Impacts(*(getattr(self, field.name)[which] for field in fields(self)))

    @staticmethod
    def none() -> Impacts:
        """Return no impacts at all."""
        whole = np.zeros(0, dtype=np.int64)
        real = np.zeros(0)
        return Impacts(real, whole, whole, real, real, whole, np.zeros((0, 3)))


@dataclass
class ContactBlock:
    """Consecutive physics steps of all robots; blocks follow each other without gaps."""

    start: float
    """Beginning of the first step, s since the recording began."""
    timestep: float
    """Physics step, s."""
    impacts: Impacts
    """Those with start <= time < end."""
    friction_power: NDArray
    """Friction power of each foot, W, not negative. Shape: (steps, robots, 4)."""
    foot_pos: NDArray
    """Feet in the world frame, m. Shape: (steps, robots, 4, 3)."""
    floor: NDArray
    """Floor under each foot, index into the recording's floor names. Shape: (steps, robots, 4)."""
    joint_pos: NDArray
    """Angle of each joint, rad. Shape: (steps, robots, 12)."""
    joint_vel: NDArray
    """Velocity of each joint, rad/s. Shape: (steps, robots, 12)."""
    joint_torque: NDArray
    """Torque of each joint's drive, N m. Shape: (steps, robots, 12)."""
    trunk_pos: NDArray
    """Trunk in the world frame, m. Shape: (steps, robots, 3)."""
    trunk_quat: NDArray
    """Trunk's orientation in the world, w x y z. Shape: (steps, robots, 4)."""

    @property
    def steps(self) -> int:
        """Number of physics steps."""
        return self.friction_power.shape[0]

    @property
    def num_robots(self) -> int:
        """Number of robots."""
        return self.friction_power.shape[1]

    @property
    def joint_power(self) -> NDArray:
        """|torque times velocity| of each joint, W. Shape: (steps, robots, 12)."""
        return np.abs(self.joint_torque * self.joint_vel)

    @property
    def end(self) -> float:
        """End of the last step, s since the recording began."""
        return self.start + self.steps * self.timestep

    def impact_steps(self) -> NDArray:
        """Return the step that each impact is in, counted from the block's first. Shape: (n,)."""
        # Times are multiples of the step, computed in floating point: hence the margin.
        step = np.floor((self.impacts.time - self.start) / self.timestep + 1e-6).astype(np.int64)
        return np.clip(step, 0, self.steps - 1)

    def part(self, first: int, stop: int) -> ContactBlock:
        """Return the steps from `first` up to, but without, `stop`, as a block of its own.

        Impacts go with the step that they are in.
        """
        if first == 0 and stop >= self.steps:
            return self
        step = self.impact_steps()
        return ContactBlock(
            self.start + first * self.timestep,
            self.timestep,
            self.impacts.select((step >= first) & (step < stop)),
            self.friction_power[first:stop],
            self.foot_pos[first:stop],
            self.floor[first:stop],
            self.joint_pos[first:stop],
            self.joint_vel[first:stop],
            self.joint_torque[first:stop],
            self.trunk_pos[first:stop],
            self.trunk_quat[first:stop],
        )
