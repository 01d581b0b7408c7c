"""A filter in two halves is the whole one."""

import numpy as np
import pytest
from sound_helpers import RATE

from mute.acoustics.floors import FLOORS
from mute.acoustics.metering.weighting import AWeighting
from mute.acoustics.sources.halves import LowPending, halves
from mute.acoustics.sources.landings import sampled_force
from mute.acoustics.sources.response import floor_response
from mute.acoustics.sources.shell import shell_response

BLOWS = 6


def _blows(rate, floor, ahead=0.0):
    """Return forces of blows, and the sample at which each begins, some time ahead of itself."""
    generator = np.random.default_rng(0)
    mass, speed = generator.uniform(0.3, 3.0, BLOWS), generator.uniform(0.05, 1.0, BLOWS)
    time = generator.uniform(0.010, 0.012, BLOWS) - ahead
    begin = np.floor(time * rate).astype(int) + 1
    samples = round(0.15 * rate)
    return sampled_force(floor, mass, speed, begin / rate - time, rate, samples), begin


def _where():
    generator = np.random.default_rng(1)
    return generator.uniform(0.25, 0.6, BLOWS), generator.integers(0, 4, BLOWS)


def _laid(sounds, begin, samples):
    line = np.zeros((BLOWS, samples))
    for row, sound, start in zip(line, sounds, begin, strict=True):
        row[start:][: len(sound)] = sound[: samples - start]
    return line


def _whole(response, floor, rate, kept=slice(None)):
    """Return what is heard by the whole filter, or of its ringing alone of some octaves."""
    distance, place = _where()
    if kept == slice(None):
        transfer = response.transfer(distance, place)
    else:
        size = np.sqrt(response.spread(distance))[:, kept]
        transfer = np.einsum("no,nof->nf", size, response.ringing[place][:, kept])
    force, begin = _blows(rate, floor)
    spectrum = np.fft.rfft(force, response.length) * transfer
    return _laid(np.fft.irfft(spectrum, response.length), begin, rate)


def _of_low(low, floor, rate):
    pending = LowPending(BLOWS, low.divisor)
    pending.begin(0)
    force, begin = _blows(low.rate, floor, low.late)
    for robot, sound in enumerate(low.heard(force, *_where(), np.ones(BLOWS))):
        pending.add(robot, int(begin[robot]), sound)
    return pending.take(0, rate)


def _response(name, rate):
    floor = FLOORS.get(name, FLOORS["wood"])
    return floor, shell_response(rate) if name == "shell" else floor_response(floor.plate, rate)


def _missed(found, expected):
    """Return the energy of the difference beside all there is, dB."""
    return 10.0 * np.log10(np.square(found - expected).sum() / np.square(expected).sum())


@pytest.mark.parametrize(
    ("name", "rate"),
    [*((name, RATE) for name in ("shell", *FLOORS)), ("wood", 22050), ("carpet", 44100)],
)
def test_both_halves_are_the_whole(name, rate):
    floor, response = _response(name, rate)
    low, high = halves(response, rate)
    force, begin = _blows(high.rate, floor)
    both = _laid(high.heard(force, *_where(), np.ones(BLOWS)), begin, rate)
    both += _of_low(low, floor, rate)
    expected = AWeighting(rate).filter(_whole(response, floor, rate))
    found = AWeighting(rate).filter(both)
    # What the beginnings of low tones hold far above their octaves is left out.
    assert _missed(found, expected) < -27.0
    levels = 10.0 * np.log10(np.square(found).sum(axis=1) / np.square(expected).sum(axis=1))
    assert np.abs(levels).max() < 0.05


@pytest.mark.parametrize("name", ["shell", "wood", "concrete"])
def test_the_lower_half_has_the_size_and_the_time_of_its_octaves(name):
    floor, response = _response(name, RATE)
    low, _ = halves(response, RATE)
    expected = _whole(response, floor, RATE, slice(0, 5))
    found = _of_low(low, floor, RATE)
    # A sample of sound too late or too early would be -36 dB or more.
    assert _missed(found, expected) < -45.0
    gain = (found * expected).sum() / np.square(expected).sum()
    assert gain == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize("length", [1, 7, 8, 500])
def test_the_lower_half_does_not_depend_on_where_it_is_cut(length):
    sounds = np.random.default_rng(2).normal(size=(3, 40))
    begins = (3, 20, 41)
    whole, parts = LowPending(1, 8), LowPending(1, 8)
    whole.begin(0)
    for sound, begin in zip(sounds, begins, strict=True):
        whole.add(0, begin, sound)
    expected = whole.take(0, 800)
    heard = []
    for first in range(0, 800, length):
        stop = min(first + length, 800)
        parts.begin(first)
        for sound, begin in zip(sounds, begins, strict=True):
            if first <= (begin - 1) * 8 < stop:  # it is known when its time comes, no earlier
                parts.add(0, begin, sound)
        heard.append(parts.take(first, stop))
    np.testing.assert_allclose(np.concatenate(heard, axis=1), expected, atol=1e-12)


def test_the_lower_half_is_drawn_smoothly_between_its_samples():
    pending = LowPending(1, 8)
    pending.begin(0)
    time = np.arange(600) / 6000.0
    pending.add(0, 0, np.sin(2.0 * np.pi * 400.0 * time))
    heard = pending.take(0, 4800)[0][480:]
    shown = np.arange(480, 4800)
    late = 23.5  # half of the filter between samples
    expected = np.sin(2.0 * np.pi * 400.0 * (shown - late) / RATE)
    gain = (heard * expected).sum() / np.square(expected).sum()
    assert gain == pytest.approx(1.0, abs=0.02)
    np.testing.assert_allclose(heard, gain * expected, atol=0.01)


def test_the_lower_half_begins_with_a_recording_that_does_not_begin_at_0():
    pending = LowPending(1, 8)
    pending.begin(4003)
    pending.add(0, 501, np.ones(200))
    assert pending.take(4003, 4503)[0, -1] == pytest.approx(1.0, abs=1e-3)


def test_to_take_nothing_of_the_lower_half_leaves_all():
    pending = LowPending(2, 8)
    pending.begin(0)
    pending.add(1, 0, np.ones(200))
    assert pending.take(0, 0).shape == (2, 0)
    assert pending.take(0, 400)[1, -1] == pytest.approx(1.0, abs=1e-3)
