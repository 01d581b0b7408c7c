"""Attitude, place and velocity follow a known motion from what is measured of it."""

from __future__ import annotations

import numpy as np
import pytest

from mute.controllers.mpc.odometry import Attitude, LegOdometry
from mute.controllers.mpc.turning import about_vertical

STEP = 0.02
FEET = np.array([[0.2, -0.1, 0.0], [0.2, 0.1, 0.0], [-0.2, -0.1, 0.0], [-0.2, 0.1, 0.0]])


def test_an_attitude_follows_a_turn_and_forgets_what_it_was_wrong_about():
    attitude = Attitude(1)
    tilted = about_vertical(np.zeros(1))
    angle = 0.2
    pitched = np.array(
        [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    )
    for _ in range(50):
        attitude.update(np.array([[0.0, 0.0, 0.5]]), np.array([[0.0, 0.0, -1.0]]), STEP)
    assert attitude.yaw[0] == pytest.approx(49 * STEP * 0.5, abs=1e-6)
    np.testing.assert_allclose(attitude.turn[0, 2], tilted[0, 2], atol=1e-9)
    gravity = pitched.T @ (0.0, 0.0, -1.0)
    for _ in range(200):
        attitude.update(np.zeros((1, 3)), gravity[None], STEP)
    np.testing.assert_allclose(-attitude.turn[0, 2], gravity, atol=1e-3)
    np.testing.assert_allclose(attitude.turn[0] @ attitude.turn[0].T, np.eye(3), atol=1e-9)


def test_a_fresh_attitude_takes_gravity_as_it_is_measured():
    attitude = Attitude(1)
    gravity = np.array([[0.3, -0.2, -0.9]])
    gravity /= np.linalg.norm(gravity)
    attitude.update(np.zeros((1, 3)), gravity, STEP)
    np.testing.assert_allclose(-attitude.turn[:, 2], gravity, atol=1e-9)
    assert attitude.yaw[0] == pytest.approx(0.0, abs=1e-9)


def _follow(noise: float, robots: int = 50, steps: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """Walk along x with a speed that swings, and return true and estimated velocities at last."""
    generator = np.random.default_rng(0)
    odometry = LegOdometry(robots)
    true = np.zeros((robots, 3))
    place = np.tile((0.0, 0.0, 0.3), (robots, 1))
    feet = np.tile(FEET, (robots, 1, 1))
    stance = np.ones((robots, 4), dtype=bool)
    for step in range(steps):
        acceleration = np.zeros((robots, 3))
        acceleration[:, 0] = 0.5 * np.cos(2.0 * step * STEP)
        place = place + STEP * true + 0.5 * STEP**2 * acceleration
        true = true + STEP * acceleration
        swings = (step // 12) % 2
        stance[:] = [swings == 0, swings == 1, swings == 1, swings == 0]
        # A foot in the air is wherever it likes.
        feet[~stance] += 0.02 * generator.standard_normal((int((~stance).sum()), 3))
        moving = np.where(
            stance[..., None], -true[:, None], generator.standard_normal((robots, 4, 3))
        )
        odometry.update(
            acceleration + noise * generator.uniform(-0.2, 0.2, (robots, 3)),
            feet - place[:, None] + noise * generator.uniform(-0.005, 0.005, (robots, 4, 3)),
            moving + noise * generator.uniform(-0.3, 0.3, (robots, 4, 3)),
            np.zeros((robots, 4, 3)),
            stance,
            STEP,
        )
    return true, odometry.velocity


def test_velocity_is_exact_where_measurements_are():
    true, estimated = _follow(noise=0.0)
    np.testing.assert_allclose(estimated, true, atol=5e-3)


def test_velocity_is_better_known_than_any_measurement_of_it():
    true, estimated = _follow(noise=1.0)
    assert np.abs(estimated - true).mean() < 0.04  # legs are off by 0.15 m/s on average
    np.testing.assert_allclose((estimated - true).mean(axis=0), 0.0, atol=0.02)


def test_feet_that_roll_do_not_deceive_it():
    odometry, speed = LegOdometry(1), np.array([0.4, 0.0, 0.0])
    rolling = 0.07 * speed  # as a ball at the end of a leg does
    feet, place = FEET[None].copy(), np.array([[0.0, 0.0, 0.3]])
    for _ in range(100):
        feet, place = feet + STEP * rolling, place + STEP * speed
        past = np.broadcast_to(-speed, (1, 4, 3))
        carried = np.broadcast_to(rolling, (1, 4, 3))
        everyone = np.ones((1, 4), dtype=bool)
        odometry.update(np.zeros((1, 3)), feet - place[:, None], past, carried, everyone, STEP)
    np.testing.assert_allclose(odometry.velocity[0], speed, atol=5e-3)


def test_one_robot_begins_anew_and_no_other():
    odometry = LegOdometry(2)
    legs, nothing = np.tile(FEET, (2, 1, 1)), np.zeros((2, 4, 3))
    everyone = np.ones((2, 4), dtype=bool)
    moving = np.tile((-0.5, 0.0, 0.0), (2, 4, 1))
    for _ in range(30):
        legs = legs + STEP * moving
        odometry.update(np.zeros((2, 3)), legs, moving, nothing, everyone, STEP)
    assert odometry.place[1, 0] == pytest.approx(0.3, abs=0.02)
    odometry.reset(np.array([True, False]))
    moving[0] = 0.0
    legs = legs + STEP * moving
    odometry.update(np.zeros((2, 3)), legs, moving, nothing, everyone, STEP)
    np.testing.assert_allclose(odometry.velocity[:, 0], [0.0, 0.5], atol=0.02)
    np.testing.assert_allclose(odometry.place[:, 0], [0.0, 0.31], atol=0.02)
