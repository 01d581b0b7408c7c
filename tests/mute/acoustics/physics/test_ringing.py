"""How a plate rings: by chance, but with the power and the decay of the plate's law."""

from __future__ import annotations

import numpy as np
import pytest

from mute.acoustics.air import AIR_IMPEDANCE
from mute.acoustics.floors import FLOORS
from mute.acoustics.metering.weighting import a_weighting_db
from mute.acoustics.physics.plate import Layer, bonded
from mute.acoustics.physics.ringing import BANDS, OCTAVES, band_edges, ringing_responses

RATE, PLACES = 8000, 12
LOW, HIGH = band_edges(BANDS)
SHELL = bonded([Layer(0.003, 1050.0, 2.3e9, 0.35, 0.03)], size=(0.38, 0.11))


def energies(responses, rate):
    """Return the energy that each place radiates by octave, J. Shape: (places, octaves)."""
    return np.square(responses).sum(axis=2) / rate / AIR_IMPEDANCE


def wanted_energies(plate, band):
    """Return what a blow of 1 N s radiates in a band: 2 df of F^2 times the power by F^2, J."""
    return 2.0 * (HIGH[band] - LOW[band]) * plate.ringing_power(BANDS[band])


def alone(plate, band, **options):
    """Return the responses of a band that is alone in its octave, and their sample rate.

    The rate is such that the two bands above it cannot be heard.
    """
    assert band % 3 == 0
    rate = int(1.02 * HIGH[band] / 0.45)
    return ringing_responses(plate, rate, PLACES, seed=3, **options)[:, band // 3], rate


def test_bands_are_those_of_the_meters_and_fill_the_octaves_without_a_gap():
    assert BANDS[0] == pytest.approx(25.1, abs=0.1)
    assert BANDS[16] == pytest.approx(1000.0)
    np.testing.assert_allclose(HIGH[:-1], LOW[1:])
    # The middle one of the three within an octave of 2 differs from it by the third's 10^(1/10).
    middle = BANDS[1::3]
    np.testing.assert_allclose(middle, OCTAVES[: len(middle)], rtol=0.02)


@pytest.mark.parametrize("name", FLOORS)
@pytest.mark.parametrize("band", [6, 15])  # of 100 and 800 Hz
def test_a_third_octave_holds_the_power_of_the_plate_in_the_mean_over_places(name, band):
    plate = FLOORS[name].plate
    responses, rate = alone(plate, band)
    held = energies(responses[:, None], rate)
    assert held.mean() == pytest.approx(wanted_energies(plate, band))
    assert held.std() > 0.05 * held.mean()  # places differ


@pytest.mark.parametrize("name", ["wood", "concrete"])
def test_octaves_hold_the_power_of_their_thirds(name):
    plate = FLOORS[name].plate
    responses = ringing_responses(plate, RATE, PLACES, seed=1)
    held = energies(responses, RATE).mean(axis=0)
    for octave in range(6):
        wanted = wanted_energies(plate, np.arange(3 * octave, 3 * octave + 3)).sum()
        # Tones of neighbouring thirds are heard together for as long as they last.
        assert 10.0 * np.log10(held[octave] / wanted) == pytest.approx(0.0, abs=1.0)


@pytest.mark.parametrize("band", [9, 12, 15])
def test_tones_lie_in_their_band(band):
    responses, rate = alone(FLOORS["tile"].plate, band)
    spectrum = np.square(np.abs(np.fft.rfft(responses, axis=1))).sum(axis=0)
    frequency = np.fft.rfftfreq(responses.shape[1], 1.0 / rate)
    inside = (frequency > LOW[band] / 1.1) & (frequency < HIGH[band] * 1.1)
    assert spectrum[inside].sum() > 0.95 * spectrum.sum()


@pytest.mark.parametrize("name", ["wood", "concrete", "tile"])
@pytest.mark.parametrize("band", [9, 15])
def test_ringing_falls_by_20_db_in_a_third_of_its_decay_time(name, band):
    plate = FLOORS[name].plate
    responses, rate = alone(plate, band)
    third = round(float(plate.decay_time(BANDS[band])) / 3.0 * rate)
    left = np.square(responses[:, third:]).sum() / np.square(responses).sum()
    assert 10.0 * np.log10(left) == pytest.approx(-20.0, abs=1.5)


def test_what_would_ring_for_long_fades_within_0_6_s():
    lively = bonded([Layer(0.01, 7850.0, 210e9, 0.3, 1e-4)])
    assert lively.decay_time(200.0) > 20.0
    responses = ringing_responses(lively, RATE, 2, seed=1)
    assert responses.shape[2] == 0.6 * RATE
    peak = np.abs(responses).max(axis=2)
    assert np.all(np.abs(responses[..., -1]) <= 2e-3 * peak)  # a sample of 800 before the end


def test_the_same_seed_rings_the_same():
    plate = FLOORS["parquet"].plate
    first, again, other = (ringing_responses(plate, RATE, 2, seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 0.1 * np.abs(first).max()


def test_no_two_places_ring_alike():
    responses = ringing_responses(FLOORS["wood"].plate, RATE, PLACES, seed=2).sum(axis=1)
    alike = np.corrcoef(responses)[np.triu_indices(PLACES, 1)]
    assert np.abs(alike).max() < 0.9
    assert abs(alike.mean()) < 0.2


def test_nothing_rings_above_what_the_sample_rate_carries():
    rate = 2000
    responses = ringing_responses(FLOORS["wood"].plate, rate, 2, seed=1)
    carried = LOW[::3] * 10.0**0.1 < 0.45 * rate  # the lowest third of the octave is
    assert [bool(octave.any()) for octave in responses.transpose(1, 0, 2)] == carried.tolist()


def test_a_small_plate_rings_evenly_and_not_below_its_first_mode():
    assert 150.0 < SHELL.first_mode < 250.0
    responses = ringing_responses(SHELL, RATE, PLACES, seed=1, even=True)
    assert not responses[:, OCTAVES < 80.0].any()
    assert responses[:, OCTAVES == 500.0].any()
    for band in (12, 15):
        own, rate = alone(SHELL, band, even=True)
        held = energies(own[:, None], rate)
        np.testing.assert_allclose(held[:, 0], wanted_energies(SHELL, band))


@pytest.mark.parametrize("name", ["wood", "concrete", "laminate"])
def test_a_foot_rings_with_the_power_of_the_law(name):
    floor, rate = FLOORS[name], 24000
    responses = ringing_responses(floor.plate, rate, PLACES, seed=0)
    frequency = np.fft.rfftfreq(responses.shape[2], 1.0 / rate)[1:]
    spectra = np.fft.rfft(responses / rate, axis=2)[..., 1:]
    ringing = np.square(np.abs(spectra)).sum(axis=1).mean(axis=0) / AIR_IMPEDANCE
    blow = floor.contact.blow(np.array([0.5]), np.array([0.45]))
    force = np.abs(floor.contact.spectrum(blow.give, blow.duration[:, None] * frequency))[0]
    heard = np.square(force) * 10.0 ** (a_weighting_db(frequency) / 10.0)
    heard[(frequency < LOW[0]) | (frequency > HIGH[-2])] = 0.0
    more = 10.0 * np.log10(heard @ ringing / (heard @ floor.plate.ringing_power(frequency)))
    # Modes of a floating plate lie above f0, and reach a little down to where the law has nothing.
    assert more == pytest.approx(0.0, abs=3.0 if floor.underlay else 1.0)
