"""Where the engine keeps what sensors read, now and in past physics steps."""

from __future__ import annotations

import mujoco

__all__ = ["sensor_history", "sensor_slice"]


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
