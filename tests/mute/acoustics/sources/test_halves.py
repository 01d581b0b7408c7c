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
SAMPLES = RATE


def _blows(rate, pulse, floor, ahead=0.0):
    """Return forces of blows, and the sample at which each begins, some time ahead of itself."""
    generator = np.random.default_rng(0)
    mass, speed = generator.uniform(0.3, 3.0, BLOWS), generator.uniform(0.05, 1.0, BLOWS)
    time = generator.uniform(0.010, 0.012, BLOWS) - ahead
    begin = np.floor(time * rate).astype(int) + 1
    samples = round(pulse * rate)
    return sampled_force(floor, mass, speed, begin / rate - time, rate, samples), begin


def _where():
    generator = np.random.default_rng(1)
    return generator.uniform(0.25, 0.6, BLOWS), generator.integers(0, 4, BLOWS)


def _laid(sounds, begin):
    line = np.zeros((BLOWS, SAMPLES))
    for row, sound, start in zip(line, sounds, begin, strict=True):
        row[start:][: len(sound)] = sound[: SAMPLES - start]
    return line


def _whole(response, floor):
    force, begin = _blows(RATE, 0.15, floor)
    spectrum = np.fft.rfft(force, response.length) * response.transfer(*_where())
    return _laid(np.fft.irfft(spectrum, response.length), begin)


def _of_halves(response, floor):
    low, high = halves(response, RATE)
    size = np.ones(BLOWS)
    force, begin = _blows(high.rate, 0.15, floor)
    heard = _laid(high.heard(force, *_where(), size), begin)
    pending = LowPending(BLOWS, low.divisor)
    pending.begin(0)
    force, begin = _blows(low.rate, 0.15, floor, low.late)
    for robot, sound in enumerate(low.heard(force, *_where(), size)):
        pending.add(robot, int(begin[robot]), sound)
    return heard + pending.take(0, SAMPLES)


@pytest.mark.parametrize("rate_of", ["shell", *FLOORS])
def test_both_halves_are_the_whole(rate_of):
    floor = FLOORS.get(rate_of, FLOORS["wood"])
    shell = rate_of == "shell"
    response = shell_response(RATE) if shell else floor_response(floor.plate, RATE)
    ear = AWeighting(RATE)
    whole, both = _whole(response, floor), _of_halves(response, floor)
    expected, found = ear.filter(whole), AWeighting(RATE).filter(both)
    missed = np.square(found - expected).sum() / np.square(expected).sum()
    # What the beginnings of low tones hold far above their octaves is left out.
    assert 10.0 * np.log10(missed) < -25.0
    levels = 10.0 * np.log10(np.square(found).sum(axis=1) / np.square(expected).sum(axis=1))
    assert np.abs(levels).max() < 0.05


@pytest.mark.parametrize("rate", [8000, 22050, 44100])
def test_both_halves_are_the_whole_at_other_sample_rates(rate):
    response = floor_response(FLOORS["wood"].plate, rate)
    for half in halves(response, rate):
        assert half.rate * half.divisor == pytest.approx(rate)
        assert half.rate >= min(6000, rate)


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
