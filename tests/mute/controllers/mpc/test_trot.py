"""A trot begins, goes on and ends by what is asked for, and its swings meet their ends."""

from __future__ import annotations

import numpy as np
import pytest

from mute.controllers.mpc.gait import TrotClock
from mute.controllers.mpc.settings import MpcCfg
from mute.controllers.mpc.swing import swing_curve

NOW = np.zeros(1)


def _stances(clock: TrotClock, wanted: list[bool], step: float = 0.02) -> np.ndarray:
    """Return which feet of the first robot stand after each step. Shape: (steps, 4)."""
    stances = []
    for walk in wanted:
        clock.advance(step, np.array([walk]))
        stances.append(clock.stance(NOW)[0, 0])
    return np.array(stances)


def test_diagonals_take_turns_each_half_of_the_cycle():
    stances = _stances(TrotClock(1, 0.4), [True] * 60)
    front_right, front_left, rear_right, rear_left = stances.T
    assert (front_right == rear_left).all()
    assert (front_left == rear_right).all()
    assert (front_right != front_left).all()
    changes = np.flatnonzero(np.diff(front_right.astype(int)))
    np.testing.assert_array_equal(np.diff(changes), 10)


def test_a_robot_that_stands_does_so_with_all_feet_and_begins_at_once():
    clock = TrotClock(1, 0.4)
    assert _stances(clock, [False] * 5).all()
    assert not _stances(clock, [True]).all()


def test_steps_do_not_drift_from_the_cycle_however_many_there_are():
    clock = TrotClock(1, MpcCfg().gait_period)
    clock.advance(0.02, np.array([True]))  # begins
    for step in range(1, 2000):
        clock.advance(0.02, np.array([True]))
        place = clock.place[0] * 45.0
        assert place == pytest.approx(2 * step % 45, abs=1e-6)
        assert clock.progress(NOW)[0, 0] < 1.0
        assert float(clock.remaining()[0]) > 1e-6


def test_feet_in_the_air_land_before_a_robot_stands():
    clock = TrotClock(1, 0.4)
    stances = _stances(clock, [True] * 4 + [False] * 20)
    stands = np.asarray(stances.all(axis=1))
    assert not stands[:10].any()
    assert stands[10:].all()


def test_stances_ahead_are_those_that_come():
    clock = TrotClock(1, 0.4)
    _stances(clock, [True] * 7)
    ahead = clock.stance(0.02 * np.arange(1, 31))[0]
    np.testing.assert_array_equal(ahead, _stances(clock, [True] * 30))


def test_a_swing_is_over_when_its_time_is():
    clock = TrotClock(1, 0.45)
    _stances(clock, [True] * 5)
    left = clock.remaining()
    assert clock.progress(left)[0, 0] == pytest.approx(1.0)
    assert 0.0 < float(left[0]) <= clock.swing_time


def test_each_robot_has_its_own_place():
    clock = TrotClock(2, 0.4)
    clock.advance(0.02, np.array([True, False]))
    assert clock.walks.tolist() == [True, False]
    clock.reset(np.array([True, False]))
    assert not clock.walks.any()


def test_a_swing_begins_and_ends_at_rest_where_it_should():
    start, end = np.array([0.1, 0.0, 0.02]), np.array([0.3, -0.05, 0.06])
    for progress, place in ((0.0, start), (1.0, end), (1.3, end)):
        where, velocity = swing_curve(start, end, 0.08, np.array(progress), 0.2)
        np.testing.assert_allclose(where, place, atol=1e-12)
        np.testing.assert_allclose(velocity, 0.0, atol=1e-12)
    where, velocity = swing_curve(start, end, 0.08, np.array(0.5), 0.2)
    np.testing.assert_allclose(where, 0.5 * (start + end) + (0, 0, 0.08), atol=1e-12)
    np.testing.assert_allclose(velocity[2], 2.0 * (end - start)[2] / 0.2, atol=1e-12)


def test_velocities_of_a_swing_are_the_places_change():
    start, end = np.zeros(3), np.array([0.2, 0.1, 0.03])
    progress = np.linspace(0.0, 1.0, 2001)
    where, velocity = swing_curve(start, end, 0.08, progress, 0.2)
    slope = np.gradient(where, 0.2 / 2000, axis=0)
    np.testing.assert_allclose(velocity[1:-1], slope[1:-1], atol=1e-3)
