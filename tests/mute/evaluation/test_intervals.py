"""Tests of the intervals of a mean and of a median."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import binom

from mute.evaluation.intervals import mean_with_interval, median_interval


@pytest.mark.parametrize(
    ("number", "rank"),
    # From tables of the sign test, two-sided, 5 %: the largest k with 2 P(Bin(n, 1/2) < k) <= 0.05.
    [(6, 1), (8, 1), (9, 2), (10, 2), (12, 3), (20, 6), (25, 8), (40, 14)],
)
def test_the_bounds_are_the_order_statistics_of_the_tables(number: int, rank: int):
    values = np.random.default_rng(0).permutation(np.arange(1.0, number + 1.0)).tolist()
    interval = median_interval(values)
    assert interval.median == (number + 1) / 2
    assert (interval.low, interval.high) == (rank, number + 1 - rank)
    assert interval.half_width == pytest.approx((number + 1 - 2 * rank) / (number + 1))


@pytest.mark.parametrize("number", range(6, 60))
def test_the_level_is_reached_in_closed_form_and_by_no_wider_an_interval_than_needed(number: int):
    interval = median_interval([float(value) for value in range(1, number + 1)])
    assert interval.low is not None
    rank = int(interval.low)
    assert 2.0 * binom.cdf(rank - 1, number, 0.5) <= 0.05 < 2.0 * binom.cdf(rank, number, 0.5)


@pytest.mark.parametrize("number", [1, 3, 5])
def test_fewer_than_six_values_have_no_interval(number: int):
    interval = median_interval([2.0] * number)
    assert (interval.median, interval.low, interval.high) == (2.0, None, None)
    assert interval.half_width == math.inf


@pytest.mark.parametrize("number", [10, 25])
def test_intervals_of_skewed_times_hold_the_true_median_as_often_as_they_say(number: int):
    generator = np.random.default_rng(0)
    # Times with rare long ones, as a shared machine has them; the median of the log-normal is 2.
    draws = 2.0 * np.exp(0.5 * generator.standard_normal((2000, number)))
    held = 0
    for values in draws:
        interval = median_interval(values.tolist())
        assert interval.low is not None
        assert interval.high is not None
        held += interval.low <= 2.0 <= interval.high
    rank = {10: 2, 25: 8}[number]
    expected = 1.0 - 2.0 * binom.cdf(rank - 1, number, 0.5)
    assert held / len(draws) == pytest.approx(expected, abs=0.015)
    assert expected >= 0.95


def test_a_mean_has_students_interval_and_a_single_value_none():
    mean, deviation, half_width = mean_with_interval([1.0, 2.0, 3.0])
    assert (mean, deviation) == (2.0, 1.0)
    assert half_width == pytest.approx(4.303 / 3**0.5, rel=1e-3)  # t of 2 degrees of freedom
    assert mean_with_interval([1.5])[0] == 1.5
    assert all(map(math.isnan, (*mean_with_interval([1.5])[1:], *mean_with_interval([]))))
    assert all(map(math.isnan, mean_with_interval([1.5, math.nan])))
