"""Tests of levels without the background: the arithmetic of energies, and where it ends."""

from __future__ import annotations

import math

import pytest

from mute.acoustics.metering.background import (
    CORRECTED,
    levels_without,
    third_octaves_without,
    without_background,
)
from mute.acoustics.metering.levels import Levels
from mute.acoustics.metering.third_octaves import ThirdOctaveLevel


@pytest.mark.parametrize("level", [53.0, 56.0, 60.0, 65.0, 120.0])
def test_a_level_without_the_background_is_that_of_the_energy_that_is_left(level):
    left = without_background(level, 50.0)
    assert left == pytest.approx(10.0 * math.log10(10.0 ** (level / 10.0) - 1e5), abs=1e-9)
    together = 10.0 * math.log10(10.0 ** (left / 10.0) + 1e5)
    assert together == pytest.approx(level, abs=1e-9)


@pytest.mark.parametrize(
    ("difference", "correction"), [(3.0, 3.02), (6.0, 1.26), (10.0, 0.46), (15.0, 0.14)]
)
def test_the_corrections_are_those_of_the_standards(difference, correction):
    # ISO 3744:2010 and 3746:2010 tell them as K1: 1.3 dB at 6 dB, 0.5 dB at 10 dB.
    assert without_background(difference, 0.0) == pytest.approx(difference - correction, abs=0.005)


@pytest.mark.parametrize("level", [52.99, 50.0, 40.0, -math.inf, math.nan])
def test_what_is_within_3_db_of_the_background_has_no_level(level):
    assert math.isnan(without_background(level, 50.0))


@pytest.mark.parametrize("level", [-100.0, 50.0, -math.inf])
def test_a_silent_background_takes_nothing_away(level):
    assert without_background(level, -math.inf) == level


def test_a_background_without_a_level_leaves_none():
    assert math.isnan(without_background(60.0, math.nan))


def test_each_figure_is_corrected_by_the_laeq_and_the_rest_stays():
    levels = Levels(60.0, 65.0, 61.0, 66.0, 63.0, 52.0, 10.0, 48000, 190)
    left = levels_without(levels, 50.0)
    for name in CORRECTED[:-1]:
        assert getattr(left, name) == without_background(getattr(levels, name), 50.0)
    assert math.isnan(left.l90)
    assert (left.seconds, left.sample_rate, left.readings) == (10.0, 48000, 190)


def test_each_band_is_corrected_by_its_own_background():
    bands = (ThirdOctaveLevel(25.0, 40.0), ThirdOctaveLevel(31.5, 40.0))
    alone = (ThirdOctaveLevel(25.0, 38.0), ThirdOctaveLevel(31.5, 30.0))
    first, second = third_octaves_without(bands, alone)
    assert math.isnan(first.level)
    assert second == ThirdOctaveLevel(31.5, without_background(40.0, 30.0))
