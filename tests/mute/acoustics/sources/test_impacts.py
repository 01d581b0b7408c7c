"""Landings: force, modes, pressure."""

import numpy as np
import pytest
from scipy import signal
from sound_helpers import FEET, FLOORS, RATE, a_weighted_level, level, make_block

from mute.acoustics.floors import FLOORS as FLOOR_TABLE
from mute.acoustics.floors import Mode
from mute.acoustics.microphone import Microphone
from mute.acoustics.soundscape import Soundscape
from mute.acoustics.sources.impacts import (
    contact_time,
    floor_modes,
    mode_filter,
    pulse_force,
    pulse_spectrum,
)

TIME = np.arange(RATE) / RATE
WOOD = FLOOR_TABLE["wood"]  # e = 0.4


def _pulse(onset, duration, restitution=0.4):
    onset, duration, restitution = (np.array(x) for x in (onset, duration, restitution))
    return pulse_force(TIME, onset, duration, restitution, RATE)


def _landing_sound(speed=0.4, floor="wood", microphone=None, steps=600, mass=1.5):
    block = make_block(steps, landings=[(0, 0, 0, speed, mass)])
    return Soundscape(1, (floor,), microphone, sources=("impacts",)).render(block)[0]


def _ring(filters, force):
    return np.sum([np.asarray(signal.lfilter(b, a, force)) for b, a in filters], axis=0)


def _above_front_right(height):
    return Microphone((FEET[0, 0], FEET[0, 1], height), "world")


@pytest.mark.parametrize("duration", [0.016, 0.0123456, 3e-5])
def test_the_integral_of_a_pulse_is_its_impulse_wherever_it_begins(duration):
    for onset in (0.0, 0.01, 0.010007):
        assert _pulse(onset, duration).sum() / RATE == pytest.approx(1.0, abs=1e-12)


def test_the_impulse_of_a_landing_is_one_plus_e_times_m_v():
    force = 1.4 * 1.5 * 0.4 * _pulse(0.3 / 343.0, contact_time(1.5, WOOD))
    expected = _ring(floor_modes(WOOD, RATE), force)
    heard = _landing_sound(speed=0.4, mass=1.5, microphone=_above_front_right(0.3))
    np.testing.assert_allclose(heard, expected[: len(heard)] / 0.3, atol=1e-6)


def test_a_pulse_is_a_damped_half_sine():
    duration, restitution = 0.016, 0.4
    force = _pulse(0.0, duration, restitution)
    middle = TIME - 0.5 / RATE  # a sample is the mean over the interval before it
    inside = (middle > 0.0) & (middle < duration)
    shape = restitution ** (middle / duration) * np.sin(np.pi * middle / duration) * inside
    expected = shape * (RATE / shape.sum())
    np.testing.assert_allclose(force, expected, atol=2e-3 * expected.max())


def test_the_spectrum_of_a_pulse_is_that_of_its_samples():
    force = _pulse(0.0, 0.016)
    sampled = np.fft.rfft(force)[:1000] / RATE
    # The mean over an interval takes sinc(f / rate), and half a sample's delay, which moduli lack.
    expected = pulse_spectrum(np.arange(1000.0), np.array(0.016), 0.4)
    expected = np.abs(expected) * np.sinc(np.arange(1000.0) / RATE)
    np.testing.assert_allclose(np.abs(sampled), expected, rtol=1e-3, atol=1e-6)


def test_a_mode_rings_at_its_frequency_with_its_decay_time():
    mode = Mode(frequency=480.0, decay_time=0.2, gain=1.0)
    response = _ring([mode_filter(mode, RATE)], np.eye(1, RATE)[0])
    # 480 Hz has a period of 100 samples; 60 dB in 0.2 s are 0.3 dB a millisecond.
    period = response[4800:4900], response[9600:9700]
    assert np.argmax(np.abs(np.fft.rfft(response[:9600]))) == 480 * 9600 // RATE
    assert level(period[0]) - level(period[1]) == pytest.approx(30.0, abs=0.01)


def test_a_mode_answers_its_frequency_as_the_analogue_mode_does():
    mode = Mode(frequency=480.0, decay_time=0.2, gain=3.0)
    b, a = mode_filter(mode, RATE)
    z = np.exp(2j * np.pi * 480.0 / RATE)
    response = np.polyval(b, z) / np.polyval(a, z)
    s, d, w = 2j * np.pi * 480.0, np.log(1000.0) / 0.2, 2.0 * np.pi * 480.0
    assert abs(response) == pytest.approx(abs(3.0 * s / ((s + d) ** 2 + w**2)))


@pytest.mark.parametrize("name", FLOORS)
def test_a_floor_radiates_nothing_at_0_hz(name):
    for b, a in floor_modes(FLOOR_TABLE[name], RATE):
        assert abs(b.sum() / a.sum()) < 1e-12


@pytest.mark.parametrize("name", FLOORS)
def test_the_energy_of_a_response_dies_away(name):
    floor = FLOOR_TABLE[name]
    longest = max(mode.decay_time for mode in floor.modes)
    impulse = np.eye(1, round(3.0 * longest * RATE))[0]
    response = _ring(floor_modes(floor, RATE), impulse)
    energy = np.square(response)
    assert energy[round(longest * RATE) :].sum() < 1e-6 * energy.sum()


@pytest.mark.parametrize("name", FLOORS)
def test_a_bounded_force_gives_a_bounded_pressure(name):
    force = np.sign(np.random.default_rng(0).standard_normal(RATE))
    filters = floor_modes(FLOOR_TABLE[name], RATE)
    assert max(np.abs(np.roots(a)).max() for _, a in filters) < 1.0
    assert np.abs(_ring(filters, force)).max() <= np.abs(_ring(filters, np.eye(1, RATE)[0])).sum()


def test_twice_the_landing_speed_is_6_02_db_more():
    slow, fast = _landing_sound(0.2), _landing_sound(0.4)
    assert level(fast) - level(slow) == pytest.approx(6.0206, abs=1e-4)


def test_twice_the_distance_is_6_02_db_less():
    near = _landing_sound(microphone=_above_front_right(0.5))
    far = _landing_sound(microphone=_above_front_right(1.0))
    # Over half a second from a pulse of 16 ms the delay of 1.5 ms does not matter.
    assert level(far) - level(near) == pytest.approx(-6.0206, abs=1e-3)


def test_sound_arrives_when_it_has_come_the_way():
    silent = round(1.7 / 343.0 * RATE)
    pressure = _landing_sound(microphone=_above_front_right(1.7))
    assert not pressure[:silent].any()
    assert pressure[silent + 2] != 0.0


def test_a_landing_at_no_speed_is_silent():
    assert not _landing_sound(0.0).any()


def test_feet_that_land_at_once_are_heard_together():
    landings = [(0, 0, 0, 0.4, 1.5), (0, 0, 2, 0.3, 1.0)]
    together, *alone = (
        Soundscape(1, ("tile",), sources=("impacts",)).render(make_block(300, landings=some))
        for some in (landings, landings[:1], landings[1:])
    )
    np.testing.assert_allclose(together, alone[0] + alone[1], atol=1e-6)


def test_each_robot_hears_its_own_feet():
    block = make_block(300, robots=3, landings=[(10, 1, 0, 0.4, 1.5)])
    pressure = Soundscape(3, FLOORS, sources=("impacts",)).render(block)
    assert pressure[1].any()
    assert not pressure[[0, 2]].any()


def test_the_gain_of_a_floor_is_an_amplitude():
    block = make_block(300, landings=[(0, 0, 0, 0.4, 1.5)])
    plain = Soundscape(1, ("wood",), sources=("impacts",)).render(block)
    louder = Soundscape(1, ("wood",), sources=("impacts",), gains={"wood": 2.5}).render(block)
    np.testing.assert_allclose(louder, 2.5 * plain, rtol=1e-5, atol=1e-9)


def test_floors_sound_where_their_character_says():
    medians = []
    for name in ("carpet", "wood", "concrete", "tile"):
        pressure = _landing_sound(floor=name)
        edges = np.fft.rfftfreq(len(pressure), 1.0 / RATE)
        spectrum = np.fft.rfft(pressure)
        below = [
            a_weighted_level(np.fft.irfft(spectrum * (edges < edge), n=len(pressure)))
            for edge in (100.0, 283.0, 490.0, 849.0, 12000.0)
        ]
        medians.append(sum(value < below[-1] - 3.0103 for value in below))
    assert medians == [1, 2, 3, 4]


@pytest.mark.parametrize("name", FLOORS)
def test_ten_landings_a_second_at_0_4_m_s_are_plausibly_loud(name):
    landings = [(100 * k, 0, k % 4, 0.4, 1.5) for k in range(10)]
    pressure = Soundscape(1, (name,), sources=("impacts",)).render(
        make_block(1000, landings=landings)
    )
    assert 60.0 < a_weighted_level(pressure)[0] < 75.0


@pytest.mark.parametrize("name", FLOORS)
def test_no_mass_is_quiet_by_accident(name):
    levels = [a_weighted_level(_landing_sound(mass=m, floor=name)) for m in (0.5, 0.8, 1.2, 2, 3)]
    assert max(levels) - min(levels) < 2.0
