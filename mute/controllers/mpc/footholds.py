"""Where feet are to land: below the hips, as far ahead as the robot comes while they stand."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mute.envs.base_state import GRAVITY

from .body import Body
from .legs import HIPS, SIDES
from .senses import Moment
from .settings import MpcCfg
from .turning import about_vertical, along_curve, cross, packed, turned

__all__ = ["footholds", "ground_height"]

Array = NDArray[np.floating]


def footholds(now: Moment, body: Body, cfg: MpcCfg, ahead: Array, ground: Array) -> Array:
    """Return where the feet should land that do so some time ahead.

    That is below where the hip will be in the middle of the stance that follows, corrected by what
    the robot is too fast, and by what it is flung outwards in a curve (Di Carlo et al., 2018).

    Args:
        now: What is known of n robots.
        body: The robot.
        cfg: Its settings.
        ahead: Time to the landing of each, s. Shape: (n,).
        ground: Height of the centres of feet on the ground, m. Shape: (n,).

    Returns:
        Places in the world, m. Shape: (n, 4, 3).
    """
    stance_time = 0.5 * cfg.gait_period
    rate = now.command[:, 2]
    turn = about_vertical(now.yaw + rate * (ahead + 0.5 * stance_time))
    below = HIPS + cfg.stance_width * SIDES[:, None] * (0.0, 1.0, 0.0) + body.com * (1.0, 1.0, 0.0)
    level = now.velocity * (1.0, 1.0, 0.0)
    middle = (ahead + 0.5 * stance_time)[:, None]
    way, velocity = along_curve(level, rate, np.concatenate((ahead[:, None], middle), axis=1))
    velocity = velocity[:, 1]
    asked = along_curve(now.asked, rate, middle)[1][:, 0]
    flung = cross(velocity, packed(0.0 * rate, 0.0 * rate, rate))
    shift = (
        0.5 * stance_time * velocity
        + cfg.foothold_gain * (velocity - asked)
        + 0.5 * cfg.base_height / GRAVITY * flung
    )
    shift = np.clip(shift, -cfg.max_foothold, cfg.max_foothold)
    trunk = now.place + way[:, 0] + shift
    trunk[:, 2] = ground
    return trunk[:, None] + turned(turn, np.broadcast_to(below, (len(ahead), 4, 3)))


def ground_height(feet: Array, stance: NDArray[np.bool_]) -> Array:
    """Return the mean height of the feet that stand, m; of all where none does. Shape: (n,).

    Args:
        feet: Places, m. Shape: (n, 4, 3).
        stance: Which stand. Shape: (n, 4).
    """
    counts = np.where(stance.any(axis=1, keepdims=True), stance, True).astype(float)
    return (feet[..., 2] * counts).sum(axis=1) / counts.sum(axis=1)
