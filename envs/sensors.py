"""Where the engine keeps what sensors read, now and in the physics steps of the last call."""

from __future__ import annotations

import mujoco
import torch

from .scene import LEGS
from .simulation import Simulation

__all__ = ["NUM_SHAPES", "RobotSensors", "sensor_slice"]

NUM_SHAPES = 10
"""Collision shapes other than feet: trunk, head, and thigh and shank of each leg."""
_NUM_TRUNK_SHAPES = 2
"""The first two of them: trunk and head."""


class RobotSensors:
    """What the robots' sensors read: views of the engine's own buffers, which follow every step."""

    def __init__(self, simulation: Simulation) -> None:
        """Find the sensors of the scene, see `envs.scene`.

        Args:
            simulation: The engine; from now on it records what its sensors read.

        Raises:
            ValueError: If the model lacks one of them.
        """
        feet, model = len(LEGS), simulation.model

        def now(first: str, count: int) -> torch.Tensor:
            return simulation.sensordata[:, sensor_slice(model, first, count)]

        self.foot_pos = now(f"{LEGS[0]}_foot_pos", feet).unflatten(1, (feet, 3))
        """Centre of each foot in the world, m. Shape: (num_envs, 4, 3)."""
        self.foot_vel = now(f"{LEGS[0]}_foot_vel", feet).unflatten(1, (feet, 3))
        """Velocity of each foot in the world, m/s. Shape: (num_envs, 4, 3)."""
        self.foot_contact = now(f"{LEGS[0]}_foot_contact", feet)
        """Number of contacts of each foot. Shape: (num_envs, 4)."""
        self.trunk_contact = now("trunk_contact", _NUM_TRUNK_SHAPES)
        """Number of contacts of trunk and head. Shape: (num_envs, 2)."""
        self.shape_contact = now("trunk_contact", NUM_SHAPES)
        """Number of contacts of every collision shape but the feet. Shape: (num_envs, 10)."""
        force = f"{LEGS[0]}_foot_force"
        measured = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SENSOR, force) >= 0
        self._foot_force = sensor_slice(model, force, feet) if measured else None
        self._weight = float(model.body_mass.sum() * abs(model.opt.gravity[2]))
        simulation.record("sensordata")
        self._simulation = simulation
        self._foot_vel_z = sensor_slice(model, f"{LEGS[0]}_foot_vel", feet).start + 2
        self._foot_contact = sensor_slice(model, f"{LEGS[0]}_foot_contact", feet)

    @property
    def foot_vel_z_substeps(self) -> torch.Tensor:
        """Vertical velocity of each foot at the physics steps of the last step, m/s.

        Shape: (num_steps, num_envs, 4).
        """
        columns = slice(self._foot_vel_z, self._foot_vel_z + 3 * len(LEGS), 3)
        return self._simulation.substeps["sensordata"][:, :, columns].transpose(0, 1).float()

    @property
    def foot_contact_substeps(self) -> torch.Tensor:
        """Number of contacts of each foot at the physics steps of the last step.

        Shape: (num_steps, num_envs, 4).
        """
        found = self._simulation.substeps["sensordata"][:, :, self._foot_contact]
        return found.transpose(0, 1).float()

    @property
    def foot_load(self) -> torch.Tensor | None:
        """Largest vertical force between each foot and the ground in the last step.

        In weights of the robot as its model has it. Shape: (num_envs, 4); None where the scene does
        not measure it.
        """
        if self._foot_force is None:
            return None
        columns = slice(self._foot_force.start + 2, self._foot_force.stop, 3)
        forces = self._simulation.substeps["sensordata"][:, :, columns]
        return forces.abs().amax(dim=1).float() / self._weight


def sensor_slice(model: mujoco.MjModel, first_name: str, count: int) -> slice:
    """Return the columns of `sensordata` that `count` sensors fill, from `first_name` on.

    Raises:
        ValueError: There is no such sensor, there are fewer than `count` from it on, or they are
            not of one kind and size, so that the columns would mix quantities.
    """
    first = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SENSOR, first_name)
    if first < 0:
        raise ValueError(f"first_name is {first_name!r}: the model has no such sensor")
    if not 1 <= count <= model.nsensor - first:
        raise ValueError(
            f"count is {count}: from {first_name!r} on the model has {model.nsensor - first}"
            " sensors, and at least 1 is needed"
        )
    kinds = {
        (int(model.sensor_type[i]), int(model.sensor_dim[i])) for i in range(first, first + count)
    }
    if len(kinds) != 1:
        names = [model.sensor(i).name for i in range(first, first + count)]
        raise ValueError(f"the {count} sensors from {first_name!r} on are not contiguous: {names}")
    start = int(model.sensor_adr[first])
    return slice(start, start + count * int(model.sensor_dim[first]))
