"""A plate's filter, from force to pressure."""

import dataclasses
import math
from itertools import pairwise

import numpy as np
import pytest
from sound_helpers import RATE

from mute.acoustics.air import AIR_DENSITY, AIR_IMPEDANCE
from mute.acoustics.body import SHELL
from mute.acoustics.floors import FLOORS
from mute.acoustics.physics.ringing import BANDS, OCTAVES, band_edges
from mute.acoustics.sources.response import PLACES, PlateResponse, floor_response
from mute.acoustics.sources.shell import NUM_FEET, SIDES, shell_response

TILE = FLOORS["tile"].plate
ALL_PLACES = np.arange(PLACES)


def _transfer(response, apart, place=ALL_PLACES):
    return response.transfer(np.full(place.shape, apart), place)


def _impulses(response, apart):
    return np.fft.irfft(_transfer(response, apart), response.length, axis=1)


def _in_bands(response, squares, bands=BANDS):
    """Return the means of the last axis over third octaves."""
    index = [np.searchsorted(response.frequency, edges) for edges in band_edges(bands)]
    means = [squares[..., a:b].mean(axis=-1) for a, b in zip(*index, strict=True)]
    return np.stack(means, axis=-1)


# Below 700 Hz a laminate on its foam hardly rings; what comes at once is 17 dB above.
@pytest.mark.parametrize(
    ("name", "lowest"), [("wood", 90.0), ("tile", 90.0), ("concrete", 90.0), ("laminate", 700.0)]
)
def test_in_the_mean_of_its_places_a_floor_rings_with_the_power_of_its_law(name, lowest):
    plate = FLOORS[name].plate
    response = floor_response(plate, RATE)
    bands = BANDS[(lowest < BANDS) & (BANDS < 11e3)]
    squares = np.square(np.abs(response.ringing.sum(axis=1))).mean(axis=0)
    wanted = AIR_IMPEDANCE * plate.ringing_power(bands)
    deviation = 10.0 * np.log10(_in_bands(response, squares, bands) / wanted)
    # Few modes in a band, of few places: 3 dB of chance. Over all bands it is less.
    assert np.abs(deviation).max() < 3.0
    assert abs(deviation.mean()) < 1.0


def test_no_two_places_of_a_floor_sound_alike():
    impulses = _impulses(floor_response(TILE, RATE), 0.45)
    alike = np.corrcoef(impulses) - np.eye(PLACES)
    assert np.abs(alike).max() < 0.8


def test_a_plate_rings_the_same_each_time_and_another_one_otherwise():
    heavier = dataclasses.replace(TILE, surface_mass=1.01 * TILE.surface_mass)
    first, again, other = (PlateResponse(p, RATE, "floor") for p in (TILE, TILE, heavier))
    np.testing.assert_array_equal(first.ringing, again.ringing)
    at = min(first.ringing.shape[2], other.ringing.shape[2])
    differ = np.abs(first.ringing[..., :at] - other.ringing[..., :at])
    assert differ.max() > 0.1 * np.abs(first.ringing).max()


def test_what_comes_at_once_is_a_monopole_of_the_force():
    # p r / F = rho / (2 pi m''): above the floating frequency, below the critical one.
    plate = FLOORS["wood"].plate
    response = floor_response(plate, RATE)
    low = (response.frequency > 20.0) & (response.frequency < 0.1 * plate.critical_frequency)
    expected = AIR_DENSITY / (2.0 * math.pi * plate.surface_mass)
    np.testing.assert_allclose(np.abs(response.direct[low]), expected, rtol=1e-3)


def test_twice_as_far_what_comes_at_once_is_half():
    response = floor_response(TILE, RATE)
    apart = np.array([0.5, 1.0])
    parts = [
        response.transfer(apart, np.array([place, place]))
        - np.einsum(
            "no,of->nf", np.sqrt(TILE.spread(OCTAVES, apart[:, None])), response.ringing[place]
        )
        for place in (0, 7)
    ]
    for near, far in parts:
        np.testing.assert_allclose(near, 2.0 * far, atol=1e-5 * np.abs(near).max())


def test_a_floor_that_rings_falls_off_more_slowly_than_a_point_and_far_off_as_one():
    response = floor_response(TILE, RATE)
    squares = [np.square(np.abs(_transfer(response, r))).sum() for r in (0.2, 0.4, 20.0, 40.0)]
    near, _, far = (10.0 * math.log10(a / b) for a, b in pairwise(squares))
    assert near < 5.0
    assert far == pytest.approx(6.02, abs=0.1)


@pytest.mark.parametrize("place", [0, 5])
def test_from_a_body_all_sound_goes_as_from_a_point(place):
    response = shell_response(RATE)
    near, far = response.transfer(np.array([0.5, 1.0]), np.array([place, place]))
    np.testing.assert_allclose(near, 2.0 * far, rtol=1e-5)


def test_what_is_heard_of_a_force_at_1_m_is_the_same_in_time_and_frequency():
    response = shell_response(RATE)
    transfer = _transfer(response, 1.0, np.array([3]))[0]
    expected = np.fft.irfft(transfer, response.length)
    np.testing.assert_allclose(response.impulse(3), expected, atol=1e-6 * np.abs(expected).max())
    squares = np.square(np.abs(transfer))
    np.testing.assert_allclose(response.squares[3], squares, rtol=1e-4, atol=1e-9 * squares.max())


def test_below_its_first_mode_a_shell_hardly_radiates():
    response = shell_response(RATE)
    first = SHELL.first_mode
    open_plate = np.abs(SHELL.direct_pressure(response.frequency))
    low = (response.frequency > 10.0) & (response.frequency < 0.2 * first)
    # A spring: 12 dB an octave less than an endless plate.
    expected = np.square(response.frequency[low] / first)
    np.testing.assert_allclose(np.abs(response.direct[low]) / open_plate[low], expected, rtol=0.01)
    ringing = np.square(np.abs(response.ringing.sum(axis=1))).mean(axis=0)
    bands = _in_bands(response, ringing)
    assert bands[0.5 * first > BANDS].max() < 0.01 * bands.max()


def test_each_place_of_a_shell_rings_with_the_power_of_its_law():
    response = shell_response(RATE)
    squares = np.square(np.abs(response.ringing.sum(axis=1)))
    wanted = (AIR_IMPEDANCE * SHELL.ringing_power(BANDS)) * BANDS
    heard = (SHELL.first_mode < BANDS) & (BANDS < 11e3)
    present = (_in_bands(response, squares) * BANDS)[:NUM_FEET, heard].sum(axis=1)
    np.testing.assert_allclose(10.0 * np.log10(present / wanted[heard].sum()), 0.0, atol=1.5)


def test_the_feet_of_each_side_move_the_shell_the_same_way():
    right, left = SIDES[[0, 2]], SIDES[[1, 3]]  # of FR, FL, RR, RL
    np.testing.assert_array_equal(right, -left)
    assert set(np.abs(SIDES)) == {1.0}


@pytest.mark.parametrize("name", ["wood", "tile", "concrete"])
def test_nothing_is_heard_before_the_blow(name):
    response = floor_response(FLOORS[name].plate, RATE)
    energy = np.square(_impulses(response, 0.45))
    # What came before would be at the end: a transform goes round in a circle.
    before = energy[:, -round(0.01 * RATE) :].sum(axis=1)
    assert (before < 1e-4 * energy.sum(axis=1)).all()


def test_a_response_has_room_for_the_longest_force():
    response = floor_response(TILE, RATE)
    ringing = np.fft.irfft(response.ringing, response.length, axis=2)
    tail = ringing[..., response.length - response.longest_pulse :]
    assert np.abs(tail).max() < 0.02 * np.abs(ringing).max()


@pytest.mark.parametrize("rate", [8000, 44100])
def test_at_another_sample_rate_a_floor_has_the_same_level_where_both_hear(rate):
    plate = FLOORS["carpet"].plate
    levels = []
    for each in (RATE, rate):
        response = floor_response(plate, each)
        squares = np.square(np.abs(response.ringing.sum(axis=1))).mean(axis=0)
        heard = BANDS[(BANDS > 90.0) & (BANDS < 2e3)]
        levels.append((10.0 * np.log10(_in_bands(response, squares, heard))).mean())
    assert levels[1] == pytest.approx(levels[0], abs=1.0)
