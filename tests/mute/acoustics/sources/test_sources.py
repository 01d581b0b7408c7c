"""Scuffing, drive and fan."""

import numpy as np
import pytest
from scipy import signal
from sound_helpers import FLOORS, RATE, a_weighted_level, level, make_block

from mute.acoustics.floors import FLOORS as FLOOR_TABLE
from mute.acoustics.microphone import Microphone
from mute.acoustics.soundscape import Soundscape
from mute.acoustics.sources.band_noise import BandNoise, band_a_weight, band_filter


def _hear(source, block, microphone=None, **options):
    return Soundscape(1, FLOORS, microphone, sources=(source,), **options).render(block)[0]


def _one_foot(power, foot=0):
    powers = np.zeros(4)
    powers[foot] = power
    return powers


def test_the_fan_alone_gives_55_dba_at_the_trunk():
    pressure = _hear("fan", make_block(20000))
    assert a_weighted_level(pressure) == pytest.approx(55.0, abs=0.1)


def test_twice_as_far_from_the_trunk_the_fan_is_6_02_db_quieter():
    block = make_block(200)
    near = _hear("fan", block, Microphone((1.0, 0.0, 0.3), "world"))
    far = _hear("fan", block, Microphone((2.0, 0.0, 0.3), "world"))
    assert level(far) - level(near) == pytest.approx(-6.0206, abs=1e-4)
    np.testing.assert_allclose(near, 2.0 * far, rtol=1e-5, atol=1e-9)


def test_a_robot_at_rest_makes_no_noise_but_its_fan():
    for source in ("impacts", "scuffing", "drive"):
        assert not _hear(source, make_block(50)).any()


def test_four_times_the_friction_power_is_twice_the_amplitude():
    weak = _hear("scuffing", make_block(100, friction_power=0.5))
    strong = _hear("scuffing", make_block(100, friction_power=2.0))
    assert weak.any()
    np.testing.assert_allclose(strong, 2.0 * weak, rtol=1e-5, atol=1e-9)


def test_two_equal_feet_are_3_01_db_louder_than_one():
    above = Microphone((0.19, 0.0, 0.5), "world")
    one = _hear("scuffing", make_block(100, friction_power=_one_foot(1.0, 0)), above)
    two = _hear(
        "scuffing", make_block(100, friction_power=_one_foot(1.0, 0) + _one_foot(1.0, 1)), above
    )
    assert level(two) - level(one) == pytest.approx(3.0103, abs=1e-4)


def test_two_equal_robots_make_noise_that_adds_by_energy():
    pressure = Soundscape(2, FLOORS, sources=("fan",)).render(make_block(10000, robots=2))
    assert level(pressure.sum(axis=0)) - level(pressure[0]) == pytest.approx(3.01, abs=0.1)


def test_fan_and_drive_are_independent_of_each_other():
    block = make_block(10000, joint_power=3.0, joint_speed=2.0)
    fan, drive = _hear("fan", block), _hear("drive", block)
    assert abs(np.corrcoef(fan, drive)[0, 1]) < 0.02


def test_scuffing_has_the_mean_square_of_the_power_that_it_radiates():
    pressure = _hear(
        "scuffing",
        make_block(5000, friction_power=_one_foot(2.0)),
        Microphone((0.19, -0.13, 0.5), "world"),
    )
    radiated = FLOOR_TABLE["wood"].scuff_efficiency * 2.0
    expected = 413.0 * radiated / (2.0 * np.pi * 0.5**2)
    assert np.mean(np.square(pressure)) == pytest.approx(expected, rel=0.03)


def test_the_drive_has_the_mean_square_of_power_and_speed():
    # 12 joints of 5 W and 2 rad/s radiate 5e-9 * 60 + 2e-9 * 48 W; 1 m from the trunk.
    block = make_block(5000, joint_power=5.0, joint_speed=2.0)
    pressure = _hear("drive", block, Microphone((1.0, 0.0, 0.3), "world"))
    expected = 413.0 * (5e-9 * 60.0 + 2e-9 * 48.0) / (2.0 * np.pi)
    assert np.mean(np.square(pressure)) == pytest.approx(expected, rel=0.03)


def test_calibration_acts_on_scuffing_and_not_on_drive_and_fan():
    block = make_block(100, friction_power=1.0, joint_power=3.0)
    for source, factor in (("scuffing", 3.0), ("drive", 1.0), ("fan", 1.0)):
        louder = _hear(source, block, gains={"wood": 3.0})
        np.testing.assert_allclose(louder, factor * _hear(source, block), rtol=1e-5, atol=1e-9)


def test_feet_scuff_the_floor_that_they_are_on():
    sounds = [_hear("scuffing", make_block(2000, friction_power=1.0, floor=k)) for k in range(4)]
    bright = []
    for sound in sounds:
        power = np.abs(np.fft.rfft(sound)) ** 2
        bright.append(power[np.fft.rfftfreq(len(sound), 1 / RATE) > 2000.0].sum() / power.sum())
    wood, carpet, tile, _ = bright
    assert wood < carpet < tile


def test_band_noise_has_the_variance_that_it_is_asked_for_in_its_band():
    noise = BandNoise(((500.0, 2000.0),), 1, RATE, (1,))
    bounds = np.array([0, 10 * RATE])
    pressure = noise.render([np.array([[9.0]])], bounds)[0]
    assert pressure.std() == pytest.approx(3.0, rel=0.02)
    frequency, density = signal.welch(pressure, RATE, nperseg=4096)
    share = density[(frequency > 400.0) & (frequency < 2500.0)].sum() / density.sum()
    assert share > 0.6


def test_the_a_weighting_leaves_of_a_band_what_it_leaves_of_its_noise():
    pressure = BandNoise(((60.0, 120.0),), 1, RATE, (1,)).render(
        [np.ones((1, 1))], np.array([0, 60 * RATE])
    )
    left = a_weighted_level(pressure)[0] - level(pressure)[0]
    assert 10.0 * np.log10(band_a_weight((60.0, 120.0), RATE)) == pytest.approx(left, abs=0.3)
    assert left < -5.0


def test_a_band_filter_lets_nothing_through_at_0_hz():
    b, a = band_filter((500.0, 2000.0), RATE)
    assert abs(b.sum() / a.sum()) < 1e-12
