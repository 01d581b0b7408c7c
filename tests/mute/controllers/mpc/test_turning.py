"""A curve is where one gets who turns as one goes."""

from __future__ import annotations

import numpy as np
import pytest

from mute.controllers.mpc.turning import about_vertical, along_curve, into, turned


@pytest.mark.parametrize("rate", [0.0, 1e-9, 1.3, -0.7])
def test_a_curve_is_the_sum_of_small_steps(rate):
    velocity = np.array([[0.8, -0.3, 0.0]])
    way, last = along_curve(velocity, np.array([rate]), np.array([[0.25, 0.5]]))
    place, steps = np.zeros(3), 5000
    for step in range(steps):
        turn = about_vertical(np.array([rate * 0.5 * (step + 0.5) / steps]))
        place = place + 0.5 / steps * turned(turn, velocity)[0]
    np.testing.assert_allclose(way[0, 1], place, atol=1e-6)
    np.testing.assert_allclose(
        last[0, 1], turned(about_vertical(np.array([0.5 * rate])), velocity)[0], atol=1e-9
    )


def test_what_is_turned_and_turned_back_is_what_it_was():
    turn = about_vertical(np.array([0.4, -2.0]))
    vectors = np.random.default_rng(0).normal(size=(2, 5, 4, 3))
    np.testing.assert_allclose(into(turn, turned(turn, vectors)), vectors, atol=1e-12)
    np.testing.assert_allclose(turned(turn, vectors[:, 0])[0, 0], turn[0] @ vectors[0, 0, 0])
