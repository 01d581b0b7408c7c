"""Scuffing, the fan, and the noise that they are made of."""

import math

import numpy as np
import pytest
from scipy import signal
from sound_helpers import FEET, RATE, a_weighted_level, level, make_block

from mute.acoustics.air import AIR_IMPEDANCE
from mute.acoustics.microphone import TRUNK_OFFSET, Microphone
from mute.acoustics.soundscape import Soundscape
from mute.acoustics.sources.band_noise import BandNoise, band_a_weight, band_filter, filter_response
from mute.acoustics.sources.scuffing import (
    SCUFF_BAND,
    SCUFF_EFFICIENCY,
    scuffing_power,
    scuffing_squares,
)


def _hear(source, block, microphone=None):
    return Soundscape(block.num_robots, ("concrete",), microphone, sources=(source,)).render(block)


def _one_foot(power, foot=0):
    powers = np.zeros(4)
    powers[foot] = power
    return powers


def _above_front_right(height):
    return Microphone((FEET[0, 0], FEET[0, 1], height), "world")


def test_the_fan_alone_gives_55_dba_at_the_trunk():
    assert a_weighted_level(_hear("fan", make_block(10000))[0]) == pytest.approx(55.0, abs=0.1)


def test_twice_as_far_from_the_trunk_the_fan_is_6_02_db_quieter():
    block = make_block(200)
    near, far = (_hear("fan", block, Microphone((r, 0.0, 0.3), "world")) for r in (1.0, 2.0))
    np.testing.assert_allclose(near, 2.0 * far, rtol=1e-5, atol=1e-9)


def test_at_1_m_the_fan_has_the_level_that_the_distance_leaves_of_55_dba():
    pressure = _hear("fan", make_block(5000), Microphone((0.0, 1.0, 0.3), "world"))[0]
    expected = 55.0 + 20.0 * math.log10(np.linalg.norm(TRUNK_OFFSET))
    assert a_weighted_level(pressure) == pytest.approx(expected, abs=0.15)


def test_a_robot_at_rest_does_not_scuff():
    assert not _hear("scuffing", make_block(50)).any()


def test_the_sound_power_of_scuffing_is_its_share_of_the_friction_power():
    block = make_block(3, robots=2, friction_power=[1.0, 0.5, 0.0, 0.25])
    np.testing.assert_allclose(scuffing_power(block), 1.75 * SCUFF_EFFICIENCY)


def test_over_the_half_space_around_a_foot_its_intensity_adds_up_to_its_sound_power():
    block = make_block(1, friction_power=_one_foot(2.0))
    angle = (np.arange(200) + 0.5) * 0.5 * np.pi / 200  # from the vertical
    ring = FEET[0] + 0.7 * np.stack((np.sin(angle), 0.0 * angle, np.cos(angle)), axis=1)
    squares = np.array([scuffing_squares(block, at[None, None])[0, 0] for at in ring])
    area = 2.0 * np.pi * 0.7**2 * np.sin(angle) * 0.5 * np.pi / 200
    power = (squares / AIR_IMPEDANCE * area).sum()
    assert power == pytest.approx(2.0 * SCUFF_EFFICIENCY, rel=1e-4)


def test_scuffing_has_the_mean_square_of_the_power_that_it_radiates():
    block = make_block(5000, friction_power=_one_foot(2.0))
    pressure = _hear("scuffing", block, _above_front_right(0.5))
    expected = AIR_IMPEDANCE * SCUFF_EFFICIENCY * 2.0 / (2.0 * np.pi * 0.5**2)
    assert np.mean(np.square(pressure)) == pytest.approx(expected, rel=0.03)


def test_four_times_the_friction_power_is_twice_the_amplitude():
    weak, strong = (_hear("scuffing", make_block(100, friction_power=p)) for p in (0.5, 2.0))
    assert weak.any()
    np.testing.assert_allclose(strong, 2.0 * weak, rtol=1e-5, atol=1e-9)


def test_two_equal_feet_are_3_01_db_louder_than_one():
    above = Microphone((0.19, 0.0, 0.5), "world")
    one, two = (
        _hear("scuffing", make_block(100, friction_power=power), above)
        for power in (_one_foot(1.0, 0), _one_foot(1.0, 0) + _one_foot(1.0, 1))
    )
    assert level(two)[0] - level(one)[0] == pytest.approx(3.0103, abs=1e-4)


def test_equal_robots_make_noise_that_adds_by_energy():
    pressure = _hear("fan", make_block(10000, robots=2))
    assert level(pressure.sum(axis=0)) - level(pressure[0]) == pytest.approx(3.01, abs=0.1)


def test_fan_and_scuffing_are_independent_of_each_other():
    block = make_block(10000, friction_power=1.0)
    fan, scuffing = _hear("fan", block)[0], _hear("scuffing", block)[0]
    assert abs(np.corrcoef(fan, scuffing)[0, 1]) < 0.02


def test_scuffing_begins_and_ends_with_the_slide_and_without_a_click():
    power = np.zeros((300, 1, 4))
    power[100:200] = 1.0
    pressure = _hear("scuffing", make_block(300, friction_power=power))[0]
    before, during, after = np.split(pressure, 3)
    assert not before.any()
    assert level(after[480:]) < level(during) - 40.0
    assert np.abs(after).max() < np.abs(during).max()


def test_band_noise_has_the_variance_that_it_is_asked_for_in_its_band():
    noise = BandNoise(((500.0, 2000.0),), 1, RATE, (1,))
    pressure = noise.render([np.array([[9.0]])], np.array([0, 10 * RATE]))[0]
    assert pressure.std() == pytest.approx(3.0, rel=0.02)
    frequency, density = signal.welch(pressure, RATE, nperseg=4096)
    share = density[(frequency > 400.0) & (frequency < 2500.0)].sum() / density.sum()
    assert share > 0.6


def test_a_band_is_3_db_down_at_its_edges():
    b, a = band_filter(SCUFF_BAND, RATE)
    edges = np.array([*SCUFF_BAND, math.sqrt(SCUFF_BAND[0] * SCUFF_BAND[1])]) * 2.0 * np.pi / RATE
    low, high, middle = np.abs(filter_response(b, a, edges))
    assert 20.0 * math.log10(low / middle) == pytest.approx(-3.0, abs=0.1)
    assert 20.0 * math.log10(high / middle) == pytest.approx(-3.0, abs=0.1)


def test_the_a_weighting_leaves_of_a_band_what_it_leaves_of_its_noise():
    noise = BandNoise(((60.0, 120.0),), 1, RATE, (1,))
    pressure = noise.render([np.ones((1, 1))], np.array([0, 60 * RATE]))[0]
    left = a_weighted_level(pressure) - level(pressure)
    assert 10.0 * math.log10(band_a_weight((60.0, 120.0), RATE)) == pytest.approx(left, abs=0.3)
    assert left < -5.0


def test_a_band_filter_lets_nothing_through_at_0_hz():
    b, a = band_filter((500.0, 2000.0), RATE)
    assert abs(b.sum() / a.sum()) < 1e-12
