"""Landings: force, filters, pressure."""

import dataclasses
import math
from itertools import combinations

import numpy as np
import pytest
from sound_helpers import FEET, RATE, a_weighted_level, level, make_block

from mute.acoustics.floors import FLOORS
from mute.acoustics.metering.weighting import AWeighting
from mute.acoustics.microphone import Microphone
from mute.acoustics.physics import contact
from mute.acoustics.sources.landings import LandingSound, place_struck, sampled_force
from mute.acoustics.sources.response import PLACES, floor_response
from mute.acoustics.sources.shell import SIDES

WOOD, TILE = FLOORS["wood"], FLOORS["tile"]

# Boards that do not ring: what is heard of them comes at once.
DEAD = dataclasses.replace(
    WOOD, name="dead", layers=tuple(dataclasses.replace(each, loss=1e9) for each in WOOD.layers)
)


def _force(lead, mass=0.5, speed=0.4, samples=RATE // 10, floor=WOOD):
    m, v, begin = (np.array([value]) for value in (mass, speed, lead))
    return sampled_force(floor, m, v, begin, RATE, samples)[0]


def _hear(block, floor=DEAD, microphone=None, share=None):
    """Hear the floor alone, or the shell alone where it has a share of the force."""
    sound = LandingSound(block.num_robots, (floor,), RATE, share is None, share or 0.0)
    where = (microphone or Microphone()).position(block)
    return sound.render(block, where, np.arange(block.steps + 1) * RATE // 1000)


def _landing(speed=0.4, mass=0.5, foot=0, steps=500, ahead=0.0, **how):
    """Hear one blow; `ahead` moves all of the scene but the floor, in m."""
    block = make_block(steps, landings=[(0, 0, foot, speed, mass)])
    way = np.array([ahead, 0.0, 0.0])
    block.impacts.position = block.impacts.position + way
    block.trunk_pos = block.trunk_pos + way
    return _hear(block, **how)[0]


def _weighted(sound):
    """Return a sound as an ear hears it."""
    return AWeighting(RATE).filter(sound[None])[0]


def _energy(sound):
    return np.square(_weighted(sound)).sum()


def _alike(*sounds):
    """Return the correlation of each pair of sounds, as an ear hears them."""
    return np.corrcoef([_weighted(each) for each in sounds])


def _above_front_right(height):
    return Microphone((FEET[0, 0], FEET[0, 1], height), "world")


def _ahead_of_the_trunk(apart):
    return Microphone((apart, 0.0, 0.3), "world")


@pytest.mark.parametrize("speed", [0.05, 0.4, 3.0])
@pytest.mark.parametrize("lead", [0.0, 0.3 / RATE, 0.999 / RATE])
def test_a_forces_sum_is_the_impulse_wherever_between_samples_it_begins(speed, lead):
    blow = WOOD.contact.blow(0.5, speed)
    assert _force(lead, speed=speed).sum() / RATE == pytest.approx(float(blow.impulse), rel=1e-9)


def test_a_force_begins_when_the_blow_does():
    # Its middle in time moves as its beginning does; a lead is time that has passed already.
    time = np.arange(RATE // 10) / RATE
    middles = [np.average(time, weights=_force(lead)) for lead in (0.0, 0.25 / RATE, 0.75 / RATE)]
    np.testing.assert_allclose(np.diff(middles) * RATE, [-0.25, -0.5], atol=1e-3)


def test_a_force_has_the_spectrum_of_its_contact():
    force = _force(0.0)
    blow = WOOD.contact.blow(np.array([0.5]), np.array([0.4]))
    frequency = np.arange(0.0, 1000.0, 10.0)
    expected = WOOD.contact.spectrum(blow.give, blow.duration[:, None] * frequency)[0]
    heard = np.abs(np.fft.rfft(force)[: len(frequency)]) / RATE
    expected = np.abs(expected) * blow.impulse * np.sinc(frequency / RATE)  # means of intervals
    np.testing.assert_allclose(heard, expected, atol=1e-3 * expected[0])


def test_a_force_has_no_steps_that_are_heard(monkeypatch):
    # What a soft blow on a carpet has at high frequencies is little: coarse steps would be more.
    def heard():
        force = [_force(0.0, mass, 0.15, floor=FLOORS["carpet"]) for mass in (0.5, 1.0, 2.0)]
        return [a_weighted_level(np.diff(each)) for each in force]

    usual = heard()
    monkeypatch.setattr(contact, "_STEPS", 2 * contact._STEPS)
    contact.blow_table.cache_clear()
    try:
        np.testing.assert_allclose(usual, heard(), atol=0.3)
    finally:
        contact.blow_table.cache_clear()


def test_a_harder_blow_is_shorter_as_hertz_says():
    lasting = [np.count_nonzero(_force(0.0, speed=v, floor=FLOORS["concrete"])) for v in (0.2, 0.8)]
    assert lasting[1] / lasting[0] == pytest.approx(4.0**-0.2, rel=0.01)


def test_a_harder_blow_is_brighter_and_not_only_louder():
    # The impulse goes with the speed: 12.04 dB at low frequencies. What is shorter has more above.
    soft, hard = _landing(speed=0.2), _landing(speed=0.8)
    frequency = np.fft.rfftfreq(len(soft), 1.0 / RATE)
    spectra = [np.square(np.abs(np.fft.rfft(each))) for each in (soft, hard)]

    def gain(low, high):
        band = (frequency > low) & (frequency < high)
        return 10.0 * math.log10(spectra[1][band].sum() / spectra[0][band].sum())

    assert gain(0.0, 10.0) == pytest.approx(12.04, abs=0.2)
    assert gain(200.0, 1000.0) > gain(0.0, 10.0) + 3.0
    # For the speed's 20 lg 4 the A-weighting would say 12; rubber under Hertz' law goes with 28.
    assert a_weighted_level(hard) - a_weighted_level(soft) == pytest.approx(16.9, abs=2.0)


def test_twice_the_distance_takes_6_02_db_off_direct_sound():
    near, far = (_landing(microphone=_above_front_right(r)) for r in (0.5, 1.0))
    assert level(near) - level(far) == pytest.approx(6.0206, abs=1e-3)


def test_sound_of_a_floor_comes_r_over_c_late_and_weaker_by_r():
    near = 0.5
    far = near + 100.0 * 343.0 / RATE  # whole samples, so that both are heard at the same instants
    first, second = (_landing(microphone=_above_front_right(r)) for r in (near, far))
    np.testing.assert_allclose(
        second[100:] * far, first[:-100] * near, atol=1e-6 * np.abs(first).max()
    )
    # A filter between samples begins a moment before, with next to nothing.
    early = second[: round(far / 343.0 * RATE)]
    assert np.abs(early).max() < 1e-4 * np.abs(second).max()
    assert np.abs(second[: len(early) + 48]).max() > 1e-2 * np.abs(second).max()


def test_sound_of_the_shell_comes_r_over_c_late_and_weaker_by_r():
    near = 0.5
    far = near + 100.0 * 343.0 / RATE
    first, second = (_landing(microphone=_ahead_of_the_trunk(r), share=0.1) for r in (near, far))
    # Half of it is worked out at other instants of the blow: 100 samples are 12.5 of its own.
    np.testing.assert_allclose(
        second[100:] * far, first[:-100] * near, atol=2e-3 * np.abs(first).max()
    )


@pytest.mark.parametrize("apart", [0.06, 0.19])
def test_from_near_a_blow_is_as_loud_as_by_the_whole_filter(apart):
    # Nearer than the way that the lower half is late by, and still both halves come together.
    floor = FLOORS["concrete"]
    sound = _landing(floor=floor, microphone=_above_front_right(apart))
    response = floor_response(floor.plate, RATE)
    foot = FEET[:1] - (0.0, 0.0, FEET[0, 2])
    transfer = response.transfer(np.array([apart]), place_struck(foot))[0]
    force = np.fft.rfft(_force(0.0, floor=floor), response.length)
    whole = np.fft.irfft(force * transfer, response.length)[: len(sound)]
    assert a_weighted_level(sound) == pytest.approx(a_weighted_level(whole), abs=0.05)


def test_ten_times_the_share_of_the_force_is_20_db_more_of_the_shell():
    little, much = (_landing(share=share) for share in (0.01, 0.1))
    assert level(much) - level(little) == pytest.approx(20.0, abs=1e-6)


def test_the_shell_sounds_as_the_foot_strikes_it():
    sounds = [_landing(foot=foot, share=0.1) for foot in range(4)]
    assert np.abs(_alike(*sounds) - np.eye(4)).max() < 0.95
    levels = [a_weighted_level(each) for each in sounds]
    assert max(levels) - min(levels) < 4.0


def test_feet_of_both_sides_that_land_at_once_shake_the_shell_as_energies_do():
    opposite = [pair for pair in combinations(range(4), 2) if SIDES[pair[0]] != SIDES[pair[1]]]
    assert (0, 3) in opposite  # the diagonals of a trot
    assert (1, 2) in opposite
    alone = {foot: _landing(foot=foot, share=0.1, floor=TILE) for foot in range(4)}
    same = [(0, 2), (1, 3)]
    louder = []
    for pairs in (opposite, same):
        together = sum(_energy(alone[a] + alone[b]) for a, b in pairs)
        apart = sum(_energy(alone[a]) + _energy(alone[b]) for a, b in pairs)
        louder.append(10.0 * math.log10(together / apart))
    assert louder[0] == pytest.approx(0.0, abs=1.0)  # what comes at once is in phase in part
    assert louder[0] < louder[1]


def test_over_a_stride_floor_and_shell_add_up_as_energies_do():
    floor, shell = (
        [_landing(foot=foot, floor=WOOD, share=share) for foot in range(4)] for share in (None, 0.1)
    )
    energies = [sum(_energy(each) for each in part) for part in (floor, shell)]
    size = math.sqrt(energies[0] / energies[1])  # as loud as each other, which is the worst case
    together = sum(_energy(a + size * b) for a, b in zip(floor, shell, strict=True))
    apart = 2.0 * energies[0]
    assert 10.0 * math.log10(together / apart) == pytest.approx(0.0, abs=1.0)


def test_a_step_ahead_a_floor_sounds_otherwise_and_on_the_same_spot_alike():
    here, beside, ahead = (_landing(floor=TILE, ahead=x) for x in (0.0, 0.005, 0.2))
    np.testing.assert_allclose(beside, here, atol=1e-6 * np.abs(here).max())
    assert abs(_alike(ahead, here)[0, 1]) < 0.8


def test_all_places_of_a_floor_are_struck_about_as_often():
    grid = np.stack(np.meshgrid(*[np.arange(-5.0, 5.0, 0.1) + 0.05] * 2), axis=-1).reshape(-1, 2)
    places = place_struck(np.pad(grid, ((0, 0), (0, 1))))
    counts = np.bincount(places, minlength=PLACES)
    assert len(counts) == PLACES
    # 2500 squares, 208 a place.
    np.testing.assert_allclose(counts / counts.mean(), 1.0, atol=0.35)


def test_which_place_is_struck_does_not_go_with_the_height():
    position = np.array([[0.3, 0.7, 0.0], [0.3, 0.7, 0.4]])
    assert len(set(place_struck(position))) == 1


def test_a_landing_at_no_speed_is_silent():
    assert not _landing(speed=0.0).any()
    assert not _landing(speed=0.0, share=0.1).any()


def test_feet_that_land_at_once_are_heard_together():
    landings = [(0, 0, 0, 0.4, 0.5), (0, 0, 2, 0.3, 1.0)]
    together, *alone = (
        _hear(make_block(300, landings=some)) for some in (landings, landings[:1], landings[1:])
    )
    np.testing.assert_allclose(together, alone[0] + alone[1], atol=1e-12)


def test_more_blows_than_are_worked_out_at_a_time_are_all_heard():
    landings = [(7 * k, 0, k % 4, 0.4, 0.5) for k in range(70)]
    sound = _hear(make_block(1000, landings=landings))
    alone = [_hear(make_block(1000, landings=[each])) for each in landings]
    np.testing.assert_allclose(sound, np.sum(alone, axis=0), atol=1e-12)


def test_each_robot_hears_its_own_feet():
    pressure = _hear(make_block(300, robots=3, landings=[(10, 1, 0, 0.4, 1.5)]))
    assert pressure[1].any()
    assert not pressure[[0, 2]].any()


def test_each_blow_is_on_the_floor_that_it_hits():
    block = make_block(400, landings=[(0, 0, 0, 0.4, 0.5), (200, 0, 0, 0.4, 0.5)])
    block.impacts.floor = np.array([0, 1])
    sound = LandingSound(1, (DEAD, TILE), RATE)
    where = Microphone().position(block)
    pressure = sound.render(block, where, np.arange(401) * RATE // 1000)[0]
    first, second = (_landing(floor=floor, steps=200) for floor in (DEAD, TILE))
    np.testing.assert_allclose(pressure[:9600], first, atol=1e-9)
    np.testing.assert_allclose(pressure[9600:], second, atol=1e-9)
