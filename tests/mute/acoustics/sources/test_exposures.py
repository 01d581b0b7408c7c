"""Exposures from tables, against the laws and against the sound that they stand for."""

import dataclasses
import math

import numpy as np
import pytest
from numpy.typing import ArrayLike
from sound_helpers import FEET, RATE, a_weighted_level, make_block

from mute.acoustics.air import AIR_IMPEDANCE
from mute.acoustics.floors import FLOORS, Floor
from mute.acoustics.metering.levels import P_REF
from mute.acoustics.metering.weighting import a_weighting_db
from mute.acoustics.microphone import Microphone
from mute.acoustics.sources.exposures import blow_exposures
from mute.acoustics.sources.landings import LandingSound, place_struck
from mute.acoustics.sources.response import PLACES

WOOD = FLOORS["wood"]
EACH_PLACE = np.arange(PLACES)


def _heard(
    mass: ArrayLike = 0.45,
    speed: ArrayLike = 0.4,
    place: ArrayLike = 0,
    foot: ArrayLike = 0,
    floor: Floor = WOOD,
):
    each = np.broadcast_arrays(*(np.atleast_1d(value) for value in (mass, speed, place, foot)))
    return blow_exposures(floor, *each)


def _by_law(floor, mass, speed, power):
    """Return A-weighted exposure of what a law makes of F^2, by frequency."""
    blow = floor.contact.blow(np.array([mass]), np.array([speed]))
    frequency = np.geomspace(22.4, 14e3, 4000)
    spectrum = floor.contact.spectrum(blow.give, blow.duration[:, None] * frequency)[0]
    force = 2.0 * np.square(np.abs(spectrum * blow.impulse))
    return np.trapezoid(
        force * 10.0 ** (a_weighting_db(frequency) / 10.0) * power(frequency), frequency
    )


def _db(ratio):
    return 10.0 * math.log10(ratio)


def _sound(foot, mass, speed, share=None):
    """Return the A-weighted exposure of a blow's sound, and how far it is from the microphone."""
    block = make_block(1000, landings=[(0, 0, foot, speed, mass)])
    sound = LandingSound(1, (WOOD,), RATE, share is None, share or 0.0)
    where = Microphone().position(block)
    pressure = sound.render(block, where, np.arange(1001) * 48)
    apart = np.linalg.norm(FEET[foot] - where[0, 0])
    return P_REF**2 * 10.0 ** (a_weighted_level(pressure)[0] / 10.0), apart  # over 1 s


@pytest.mark.parametrize("speed", [0.1, 0.45, 1.0])
def test_what_a_floor_radiates_at_once_is_its_laws(speed):
    expected = _by_law(WOOD, 0.5, speed, lambda f: np.square(np.abs(WOOD.plate.direct_pressure(f))))
    assert _db(_heard(0.5, speed).direct[0] / expected) == pytest.approx(0.0, abs=0.15)


@pytest.mark.parametrize("speed", [0.1, 0.45, 1.0])
def test_in_the_mean_of_its_places_a_floor_rings_as_its_law_says(speed):
    expected = _by_law(WOOD, 0.5, speed, lambda f: AIR_IMPEDANCE * WOOD.plate.ringing_power(f))
    ringing = _heard(0.5, speed, EACH_PLACE).ringing.sum(axis=1).mean()
    assert _db(ringing / expected) == pytest.approx(0.0, abs=1.5)  # few modes in a band


def test_places_differ_and_hold_their_sound_again():
    ringing = _heard(place=EACH_PLACE).ringing.sum(axis=1)
    assert np.ptp(10.0 * np.log10(ringing)) > 1.0
    assert _heard(place=3).ringing.sum() == pytest.approx(ringing[3])


@pytest.mark.parametrize("foot", range(4))
@pytest.mark.parametrize(("mass", "speed"), [(0.3, 0.2), (0.5, 0.45), (0.9, 0.6)])
def test_the_exposure_of_a_landing_on_wood_is_that_of_its_sound(foot, mass, speed):
    counted = _heard(mass, speed, place_struck(FEET[[foot]]), foot)
    sound, apart = _sound(foot, mass, speed)
    assert _db(counted.floor_at(np.array([apart]))[0] / sound) == pytest.approx(0.0, abs=0.6)


@pytest.mark.parametrize("foot", range(4))
@pytest.mark.parametrize(("mass", "speed"), [(0.3, 0.2), (0.5, 0.45), (0.9, 0.6)])
def test_the_exposure_of_the_shell_is_that_of_its_sound(foot, mass, speed):
    counted = 0.1**2 * _heard(mass, speed, foot=foot).body[0] / 0.3**2
    sound, _ = _sound(foot, mass, speed, share=0.1)
    assert _db(counted / sound) == pytest.approx(0.0, abs=0.6)


def test_between_the_entries_of_a_table_it_goes_as_a_power_of_mass_and_speed():
    # The masses of the table are 40^(1/11) apart: these lie on two entries and between them.
    masses = 0.2 * 40.0 ** (np.array([3.0, 3.5, 4.0]) / 11.0)
    for values in (_heard(masses).direct, _heard(masses).body, _heard(masses).ringing[:, 4]):
        assert values[1] == pytest.approx(math.sqrt(values[0] * values[2]), rel=1e-6)


def test_beyond_the_ends_of_a_table_are_its_ends():
    assert _heard(mass=20.0).direct[0] == pytest.approx(_heard(mass=8.0).direct[0])
    assert _heard(mass=0.05).direct[0] == pytest.approx(_heard(mass=0.2).direct[0])
    assert _heard(speed=9.0).direct[0] == pytest.approx(_heard(speed=5.0).direct[0])
    assert _heard(speed=0.0).direct[0] == pytest.approx(_heard(speed=1e-3).direct[0])


def test_at_no_speed_there_is_next_to_nothing():
    assert _db(_heard(speed=0.0).floor_at(np.array([0.5]))[0] / P_REF**2) < -20.0


def test_louder_with_every_increase_of_speed():
    heard = _heard(speed=np.geomspace(0.05, 2.0, 20)).floor_at(np.full(20, 0.5))
    assert (np.diff(heard) > 0.0).all()


def test_far_off_a_floor_is_heard_as_a_small_source_of_its_power():
    heard = _heard(place=EACH_PLACE)
    apart = dataclasses.replace(heard, alike=np.zeros_like(heard.alike))
    expected = AIR_IMPEDANCE * heard.floor_power / (2.0 * math.pi * 100.0**2)
    np.testing.assert_allclose(apart.floor_at(np.full(PLACES, 100.0)), expected, rtol=0.02)


def test_what_comes_at_once_and_what_rings_are_not_in_phase_in_the_mean():
    heard = _heard(place=EACH_PLACE)
    at = np.full(PLACES, 0.45)
    apart = dataclasses.replace(heard, alike=np.zeros_like(heard.alike))
    assert np.abs(heard.alike).max() <= 1.0
    assert _db(heard.floor_at(at).mean() / apart.floor_at(at).mean()) == pytest.approx(0, abs=1.0)


def test_no_exposure_is_negative_where_both_parts_cancel():
    heard = dataclasses.replace(_heard(place=EACH_PLACE), alike=np.full((PLACES, 10), -1.0))
    assert (heard.floor_at(np.geomspace(0.1, 10.0, PLACES)) >= 0.0).all()
