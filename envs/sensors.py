"""Where the engine keeps what sensors read, now and in past physics steps."""

from __future__ import annotations

import mujoco
import torch

from .scene import LEGS
from .simulation import Simulation

__all__ = ["RobotSensors", "sensor_history", "sensor_slice"]

_NUM_SHAPES = 14
"""Collision shapes other than feet: trunk, head, and hip, thigh and shank of each leg."""
_NUM_TRUNK_SHAPES = 2
"""The first two of them: trunk and head."""


class RobotSensors:
    """What the robots' sensors read: views of the engine's own buffers, which follow every step."""

    def __init__(self, simulation: Simulation) -> None:
        """Find the sensors of the scene, see `envs.scene`.

        Args:
            simulation: The engine, whose feet keep their readings of a control step.

        Raises:
            ValueError: If the model lacks one of them.
        """
        feet, model = len(LEGS), simulation.model

        def now(first: str, count: int) -> torch.Tensor:
            return simulation.sensordata[:, sensor_slice(model, first, count)]

        def past(first: str) -> torch.Tensor:
            columns, samples, size = sensor_history(model, first, feet)
            rows = simulation.history[:, columns].unflatten(1, (feet, -1))
            readings = rows[:, :, 2 + samples :].unflatten(2, (samples, size))
            return readings.permute(2, 0, 1, 3)

        self.foot_pos = now(f"{LEGS[0]}_foot_pos", feet).unflatten(1, (feet, 3))
        """Centre of each foot in the world, m. Shape: (num_envs, 4, 3)."""
        self.foot_vel = now(f"{LEGS[0]}_foot_vel", feet).unflatten(1, (feet, 3))
        """Velocity of each foot in the world, m/s. Shape: (num_envs, 4, 3)."""
        self.foot_contact = now(f"{LEGS[0]}_foot_contact", feet)
        """Number of contacts of each foot. Shape: (num_envs, 4)."""
        self.trunk_contact = now("trunk_contact", _NUM_TRUNK_SHAPES)
        """Number of contacts of trunk and head. Shape: (num_envs, 2)."""
        self.shape_contact = now("trunk_contact", _NUM_SHAPES)
        """Number of contacts of every collision shape but the feet. Shape: (num_envs, 14)."""
        self.foot_vel_z_history = past(f"{LEGS[0]}_foot_vel")[..., 2]
        """Vertical velocity of each foot at the last physics steps, the oldest first, m/s.
        Shape: (foot_samples, num_envs, 4)."""
        self.foot_contact_history = past(f"{LEGS[0]}_foot_contact")[..., 0]
        """Number of contacts of each foot, likewise. Shape: (foot_samples, num_envs, 4)."""


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


def sensor_history(model: mujoco.MjModel, first_name: str, count: int) -> tuple[slice, int, int]:
    """Return where `count` sensors, from `first_name` on, keep their past readings.

    Each keeps a row of two numbers of MuJoCo's own, a time for every sample, and the samples.

    Returns:
        The columns of `history` that all rows fill, the samples and the dimension of a sensor.

    Raises:
        ValueError: There are no such sensors, or they keep nothing.
    """
    dim = sensor_slice(model, first_name, count)  # checks that the sensors are there and of a kind
    size = (dim.stop - dim.start) // count
    first = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SENSOR, first_name)
    samples = int(model.sensor_history[first, 0])
    if samples < 1:
        raise ValueError(f"first_name is {first_name!r}: the sensor keeps no past readings")
    start = int(model.sensor_historyadr[first])
    return slice(start, start + count * (2 + samples * (1 + size))), samples, size
