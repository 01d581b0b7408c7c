"""Ranges: what lies within, and in which words they are told."""

from __future__ import annotations

import math
from dataclasses import dataclass

import pytest

from mute.support.ranges import Range, check_number, check_ordered, check_ranges


@pytest.mark.parametrize(
    ("allowed", "inside", "outside"),
    [
        (Range(0.0), (0.0, 1, 1e300), (-1e-9,)),
        (Range(0.0, above=True), (1e-300,), (0.0, -1.0)),
        (Range(-2.0, 2.0), (-2.0, 2.0), (-2.1, 2.1)),
        (Range(1, 5, whole=True), (1, 5), (0, 6, 10**40, 2.0, True)),
    ],
)
def test_a_range_holds_its_ends_and_neither_infinity_nor_nan(allowed, inside, outside):
    assert all(map(allowed.holds, inside))
    for value in (*outside, math.inf, -math.inf, math.nan):
        assert not allowed.holds(value), value


@pytest.mark.parametrize(
    ("allowed", "words"),
    [
        (Range(0.0), ">= 0 and finite"),
        (Range(0.0, above=True), "> 0 and finite"),
        (Range(-0.5, 2.0), ">= -0.5 and <= 2"),
        (Range(1, 10**9, whole=True), "an integer >= 1 and <= 1000000000"),
    ],
)
def test_a_range_says_what_it_allows(allowed, words):
    assert str(allowed) == words


@dataclass
class _Cfg:
    bounds: tuple[float, float] = (0.0, 1.0)


@pytest.mark.parametrize("bounds", [(1.0, 0.5), (1.0,), (0.0, 0.5, 1.0)])
def test_two_numbers_that_are_not_in_order_or_not_two_are_refused(bounds):
    check_ordered(_Cfg((0.5, 0.5)), "cfg", "bounds")
    with pytest.raises(ValueError) as caught:
        check_ordered(_Cfg(bounds), "cfg", "bounds")
    expected = f"cfg.bounds must be (low, high) with low <= high, got {bounds}"
    assert str(caught.value) == expected


def test_one_number_is_refused_under_its_whole_name():
    check_number("cfg.sizes[1]", 1.0, Range(0.0, 1.0))
    with pytest.raises(ValueError) as caught:
        check_number("cfg.sizes[1]", 2.0, Range(0.0, 1.0))
    assert str(caught.value) == "cfg.sizes[1] must be >= 0 and <= 1, got 2.0"


def test_of_a_field_with_several_numbers_each_is_checked_and_all_are_told():
    check_ranges(_Cfg(), "cfg", {"bounds": Range(0.0, 1.0)})
    with pytest.raises(ValueError) as caught:
        check_ranges(_Cfg((0.0, math.nan)), "cfg", {"bounds": Range(0.0, 1.0)})
    assert str(caught.value) == "cfg.bounds must be >= 0 and <= 1, got (0.0, nan)"
