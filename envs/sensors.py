"""Where the engine keeps what sensors read, now and in past physics steps."""

from __future__ import annotations

import mujoco
import numpy as np
import torch
from numpy.typing import NDArray

from .scene import LEGS
from .simulation import Simulation

__all__ = ["RobotSensors", "past_readings", "sensor_slice"]

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
        self.foot_vel_z_history = past_readings(simulation, f"{LEGS[0]}_foot_vel", feet)[..., 2]
        """Vertical velocity of each foot at the last physics steps, the oldest first, m/s.
        Shape: (foot_samples, num_envs, 4)."""
        self.foot_contact_history = past_readings(simulation, f"{LEGS[0]}_foot_contact", feet)[
            ..., 0
        ]
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


def past_readings(simulation: Simulation, first_name: str, count: int) -> torch.Tensor:
    """Return what `count` sensors, from `first_name` on, read at the last physics steps.

    The oldest reading comes first after every whole round of steps, of as many as are kept. It is a
    view of the engine's own buffer, which follows every step.

    Returns:
        Shape: (samples, num_envs, count, dimension of a sensor).

    Raises:
        ValueError: There are no such sensors, they keep nothing, or this version of MuJoCo keeps it
            in another order.
    """
    model = simulation.model
    columns = sensor_slice(model, first_name, count)  # checks that they are there and of a kind
    size = (columns.stop - columns.start) // count
    first = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SENSOR, first_name)
    samples = int(model.sensor_history[first, 0])
    if samples < 1:
        raise ValueError(f"first_name is {first_name!r}: the sensor keeps no past readings")
    width = samples * size
    places = np.stack([_history_places(model, first + i, samples, size) for i in range(count)])
    start, stride = int(places[0, 0]), int(places[1, 0] - places[0, 0]) if count > 1 else width
    regular = start + stride * np.arange(count)[:, np.newaxis] + np.arange(width)
    if not np.array_equal(places, regular):
        raise ValueError(_ANOTHER_ORDER)
    rows = simulation.history[:, start:].unfold(1, width, stride)[:, :count]
    return rows.unflatten(2, (samples, size)).permute(2, 0, 1, 3)


_ANOTHER_ORDER = (
    f"MuJoCo {mujoco.__version__} keeps past readings in another order than the versions that are"
    " known here: install one of those that pyproject.toml names"
)


def _history_places(
    model: mujoco.MjModel, sensor: int, samples: int, size: int
) -> NDArray[np.integer]:
    """Return where a sensor's past readings lie in MuJoCo's `history`, the oldest first.

    MuJoCo documents how to write them there but not where that is, so marks are written and found.

    Returns:
        Places of all numbers of all readings. Shape: (samples * size,).

    Raises:
        ValueError: The marks are not found.
    """
    data = mujoco.MjData(model)
    times = np.arange(-samples, 0.0)[:, np.newaxis]
    marks = np.arange(samples * size) + 0.5  # no time and no count
    mujoco.mj_initSensorHistory(model, data, sensor, times, marks.reshape(samples, size), 0.0)
    mark, place = np.nonzero(data.history == marks[:, np.newaxis])
    if not np.array_equal(mark, np.arange(len(marks))):
        raise ValueError(_ANOTHER_ORDER)
    return place
