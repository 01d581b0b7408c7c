"""Where the robot is and how fast, from what it can measure: gyroscope, accelerometer and legs.

The attitude follows the gyroscope, and slowly the direction of gravity (a complementary filter).
Place and velocity are a Kalman filter's, whose state is the trunk's place, its velocity and the
places of the feet (Bloesch et al., "State estimation for legged robots", RSS 2012; in this linear
form that of the Cheetah 3, Bledt et al., IROS 2018). Its noise is the same along all three axes, so
that one covariance of six numbers squared does for all; a measurement at a time, no matrix has to
be inverted.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .turning import cross, packed

__all__ = ["Attitude", "LegOdometry"]

Array = NDArray[np.floating]

_GRAVITY_TIME = 0.5
"""Time constant with which an attitude follows what is measured of gravity, s: steps shake it more
than gyroscopes drift."""


class Attitude:
    """How each robot's trunk is turned in the world, and where it heads since it began."""

    def __init__(self, num_envs: int) -> None:
        """Begin level, each heading along x."""
        self.turn = np.tile(np.eye(3), (num_envs, 1, 1))
        """From the trunk's frame to the world's. Shape: (num_envs, 3, 3)."""
        self._fresh = np.ones(num_envs, dtype=bool)

    def reset(self, robots: NDArray[np.bool_]) -> None:
        """Begin anew with what is measured next. Shape: (num_envs,)."""
        self._fresh |= robots
        self.turn[robots] = np.eye(3)

    def update(self, ang_vel: Array, gravity: Array, time: float) -> None:
        """Take in a measurement.

        Args:
            ang_vel: In the trunk's frame, rad/s. Shape: (num_envs, 3).
            gravity: Its direction in the trunk's frame. Shape: (num_envs, 3).
            time: Since the last one, s.
        """
        turned = self.turn @ _rotations(ang_vel * time)
        seen = -turned[:, 2]
        share = np.where(self._fresh, 1.0, time / _GRAVITY_TIME)[:, None]
        down = _unit(seen + share * (_unit(gravity) - seen))
        # What is ahead stays ahead, as far as what is down allows.
        ahead = np.where(self._fresh[:, None], (1.0, 0.0, 0.0), turned[:, 0])
        x = _unit(ahead - (ahead * down).sum(axis=1, keepdims=True) * down)
        self.turn = np.stack((x, cross(-down, x), -down), axis=1)
        self._fresh[:] = False

    @property
    def yaw(self) -> Array:
        """Angle between the heading and the world's x axis, rad. Shape: (num_envs,)."""
        return np.arctan2(self.turn[:, 1, 0], self.turn[:, 0, 0])


class LegOdometry:
    """Place and velocity of each robot's trunk, and places of its feet, in the world."""

    _ACCELERATION_NOISE = 0.5
    """Standard deviation of the acceleration measured over a control step, m/s^2."""
    _SLIP = 0.05
    """Of a standing foot's velocity, m/s."""
    _PLACE_NOISE = 0.005
    """Of a foot's place from the trunk, m: encoders, and a sole that rolls."""
    _VELOCITY_NOISE = 0.15
    """Of the trunk's velocity by a standing leg's joints, m/s."""
    _START = 0.2
    """Of the velocity at the beginning, m/s: robots hardly move then."""
    _UNKNOWN = 1.0
    """Of what is not known at all: m, m/s."""

    def __init__(self, num_envs: int) -> None:
        """Begin at the origin, at rest."""
        self._state = np.zeros((num_envs, 6, 3))
        self._covariance = np.zeros((num_envs, 6, 6))
        self._fresh = np.ones(num_envs, dtype=bool)

    @property
    def place(self) -> Array:
        """Of the trunk, m. Shape: (num_envs, 3)."""
        return self._state[:, 0]

    @property
    def velocity(self) -> Array:
        """Of the trunk, m/s. Shape: (num_envs, 3)."""
        return self._state[:, 1]

    def reset(self, robots: NDArray[np.bool_]) -> None:
        """Begin anew with what is measured next. Shape: (num_envs,)."""
        self._fresh |= robots

    def update(
        self,
        acceleration: Array,
        legs: Array,
        leg_velocities: Array,
        rolling: Array,
        stance: NDArray[np.bool_],
        time: float,
    ) -> None:
        """Take in what is measured at the end of a control step. All in the world's directions.

        Args:
            acceleration: Of the trunk, mean over the step, m/s^2. Shape: (num_envs, 3).
            legs: From the trunk to the feet, m. Shape: (num_envs, 4, 3).
            leg_velocities: How fast the points that touch the ground move past the trunk, m/s.
                Shape: (num_envs, 4, 3).
            rolling: How fast the centres of feet move that roll on the ground, m/s.
                Shape: (num_envs, 4, 3).
            stance: Which feet are on the ground. Shape: (num_envs, 4).
            time: Length of the step, s.
        """
        self._begin(legs)
        self._predict(acceleration, stance, time)
        self._state[:, 2:] += time * rolling
        foot_noise = np.full(len(legs), self._PLACE_NOISE**2)
        for foot in range(4):
            self._correct(((2 + foot, 1.0), (0, -1.0)), legs[:, foot], foot_noise)
            sigma = np.where(stance[:, foot], self._VELOCITY_NOISE, 1e3 * self._UNKNOWN)
            self._correct(((1, 1.0),), -leg_velocities[:, foot], sigma**2)

    def _begin(self, legs: Array) -> None:
        fresh = self._fresh
        self._state[fresh] = 0.0
        self._state[fresh, 2:] = legs[fresh]
        start = (0.0, self._START, *[self._PLACE_NOISE] * 4)
        self._covariance[fresh] = np.diag(np.square(start))
        self._fresh = np.zeros_like(fresh)

    def _predict(self, acceleration: Array, stance: NDArray[np.bool_], time: float) -> None:
        state, covariance = self._state, self._covariance
        state[:, 0] += time * state[:, 1] + 0.5 * time**2 * acceleration
        state[:, 1] += time * acceleration
        # A = 1 + time e_0 e_1': rows, then columns.
        covariance[:, 0] += time * covariance[:, 1]
        covariance[:, :, 0] += time * covariance[:, :, 1]
        moved = np.zeros(6)
        moved[:2] = 0.5 * time**2, time
        covariance += self._ACCELERATION_NOISE**2 * np.outer(moved, moved)
        feet = np.arange(2, 6)
        sigma = np.where(stance, self._SLIP * time, self._UNKNOWN)
        covariance[:, feet, feet] += sigma**2

    def _correct(self, row: tuple[tuple[int, float], ...], measured: Array, noise: Array) -> None:
        """Take in one number for each axis, the sum of parts of the state by factors.

        Args:
            row: Parts and factors.
            measured: Shape: (num_envs, 3).
            noise: Variance. Shape: (num_envs,).
        """
        parts, factors = [part for part, _ in row], np.array([factor for _, factor in row])
        seen = factors @ self._state[:, parts]
        spread = self._covariance[:, :, parts] @ factors
        variance = spread[:, parts] @ factors + noise
        gain = spread / variance[:, None]
        self._state += gain[:, :, None] * (measured - seen)[:, None]
        self._covariance -= gain[:, :, None] * spread[:, None]


def _unit(vectors: Array) -> Array:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)


def _rotations(angles: Array) -> Array:
    """Return rotations about axes by their lengths, rad. Shape: (n, 3) -> (n, 3, 3)."""
    size = np.linalg.norm(angles, axis=-1)[:, None, None]
    x, y, z = angles.T
    zero = np.zeros_like(x)
    across = packed(zero, -z, y, z, zero, -x, -y, x, zero).reshape(-1, 3, 3)
    sine = np.sinc(size / np.pi)
    cosine = 0.5 * np.sinc(0.5 * size / np.pi) ** 2
    return np.eye(3) + sine * across + cosine * (across @ across)
