"""Tests of the third octaves: bands and filters of IEC 61260-1, and sounds of known spectrum."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from wav_helpers import RATE, tone

from mute.acoustics.metering.sound_level_meter import measure
from mute.acoustics.metering.third_octaves import ThirdOctaveMeter, third_octaves
from mute.acoustics.metering.weighting import a_weighting_db

NOMINAL = [
    *(25, 31.5, 40, 50, 63, 80, 100, 125, 160, 200, 250, 315, 400, 500, 630, 800, 1000, 1250),
    *(1600, 2000, 2500, 3150, 4000, 5000, 6300, 8000, 10000, 12500, 16000, 20000),
]

OCTAVE = 10.0**0.3

# IEC 61260-1:2014, Table 1: frequencies as powers of the octave ratio, for bands of an octave, and
# the class 1 limits of the attenuation relative to that at the mid-band frequency, dB. Compared
# with the public transcriptions in thefirecode/Acoustics.jl (bands.jl) and, by a test below, in
# PyOctaveBand.
CLASS_1 = (
    (0.0, -0.4, 0.4),
    (1 / 8, -0.4, 0.5),
    (1 / 4, -0.4, 0.7),
    (3 / 8, -0.4, 1.4),
    (1 / 2, 1.2, 5.3),  # the edge itself, with the limits of both of its sides
    (1.0, 16.6, math.inf),
    (2.0, 40.5, math.inf),
    (3.0, 60.0, math.inf),
    (4.0, 70.0, math.inf),
)


def for_third_octaves(power):
    """Return the ratio to the mid-band frequency at which a row holds (formula 9)."""
    scale = (OCTAVE ** (1 / 6) - 1.0) / (OCTAVE**0.5 - 1.0)
    return 1.0 + scale * (OCTAVE**power - 1.0)


def levels(samples, rate=RATE, run_in=0):
    """Return the level of each band by its nominal frequency, without that of a run-in."""
    samples = np.atleast_2d(samples)
    meter = ThirdOctaveMeter(rate, reference=1.0)
    meter.update(samples[:, :run_in])
    meter.forget()
    meter.update(samples[:, run_in:])
    return {band.frequency: band.level for band in meter.result()}


def noise(slope, rate=RATE, seconds=4.0, seed=0, lowest=0.0):
    """Return a period of noise whose power density is exactly f^slope up to half the sample rate.

    Twice in a row, it is heard in the second period as if it had lasted for ever.
    """
    count = round(seconds * rate)
    frequencies = np.fft.rfftfreq(count, 1.0 / rate)
    frequencies[0] = 1.0
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, len(frequencies))
    spectrum = np.sqrt(frequencies**slope) * np.exp(1j * phases)
    spectrum[(frequencies < lowest) | (np.arange(len(frequencies)) == 0)] = 0.0
    spectrum[-1] = 0.0
    samples = np.fft.irfft(spectrum, count)
    return samples / np.sqrt(np.mean(samples**2))


def of_noise(period, rate=RATE):
    """Return the levels of a noise that repeats for ever."""
    return levels(np.tile(period, 2), rate, len(period))


def added(decibels):
    """Return the level of energies together."""
    return 10.0 * math.log10(sum(10.0 ** (level / 10.0) for level in decibels))


@pytest.mark.parametrize(
    ("rate", "highest"),
    [
        *((8000, 3150), (11025, 4000), (16000, 6300), (22050, 8000), (32000, 12500)),
        *((44100, 16000), (48000, 20000), (96000, 20000), (768000, 20000)),
    ],
)
def test_the_bands_are_those_that_the_sample_rate_carries(rate, highest):
    found = [band.nominal for band in third_octaves(rate)]
    assert found == NOMINAL[: NOMINAL.index(highest) + 1]


def test_the_bands_meet_and_ten_make_a_decade():
    bands = third_octaves(RATE)
    for band, following in itertools.pairwise(bands):
        assert band.high == pytest.approx(following.low, rel=1e-12)
    (kilohertz,) = [band for band in bands if band.nominal == 1000.0]
    assert math.sqrt(kilohertz.low * kilohertz.high) == pytest.approx(1000.0, rel=1e-12)
    assert kilohertz.high / kilohertz.low == pytest.approx(10.0**0.1, rel=1e-12)
    assert bands[-1].low / bands[-11].low == pytest.approx(10.0, rel=1e-12)


def test_pink_noise_has_the_same_level_in_each_band():
    found = of_noise(noise(slope=-1.0))
    assert list(found) == NOMINAL
    assert max(found.values()) - min(found.values()) < 0.1


def test_white_noise_rises_by_1_db_a_band_and_3_db_an_octave():
    found = list(of_noise(noise(slope=0.0)).values())
    np.testing.assert_allclose(np.diff(found), 1.0, rtol=0.0, atol=0.1)
    np.testing.assert_allclose(np.subtract(found[3:], found[:-3]), 3.0, rtol=0.0, atol=0.1)
    # All of it lies evenly from 0 to 24 kHz.
    (widest,) = [band.width for band in third_octaves(RATE) if band.nominal == 20000.0]
    assert found[-1] == pytest.approx(10.0 * math.log10(widest / 24000.0), abs=0.06)


@pytest.mark.parametrize("rate", [44100, 48000])
def test_the_bands_together_have_the_level_of_the_whole(rate):
    bands = third_octaves(rate)
    period = noise(slope=-1.0, rate=rate)
    spectrum = np.fft.rfft(period)
    frequencies = np.fft.rfftfreq(len(period), 1.0 / rate)
    spectrum[(frequencies < bands[0].low) | (frequencies > bands[-1].high)] = 0.0
    period = np.fft.irfft(spectrum, len(period))
    whole = 10.0 * math.log10(np.mean(period**2))
    assert added(of_noise(period, rate).values()) == pytest.approx(whole, abs=0.1)


@pytest.mark.parametrize("slope", [-1.0, 0.0])
def test_the_bands_a_weighted_together_have_laeq(slope):
    period = noise(slope, seed=1)
    found = of_noise(period)
    weights = [
        float(a_weighting_db(math.sqrt(band.low * band.high))) for band in third_octaves(RATE)
    ]
    (whole,) = measure(np.tile(period, 2), RATE, reference=1.0)
    weighted = added(np.add(list(found.values()), weights))
    assert weighted == pytest.approx(whole.laeq, abs=0.3)


@pytest.mark.parametrize(("number", "seconds"), [(14, 6.0), (20, 2.0), (30, 0.5), (43, 0.2)])
def test_a_sine_in_the_middle_of_a_band_has_its_level_there_and_class_1_beside(number, seconds):
    exact = 10.0 ** (number / 10.0)
    samples = tone(0.1, exact, seconds)
    found = list(levels(samples, run_in=len(samples) // 2).values())
    place = number - 14
    assert found[place] == pytest.approx(-20.0, abs=0.02)
    for beside in {place - 1, place + 1} & set(range(len(found))):
        # At a third of an octave from the middle, between two rows of the table (formula 11).
        ratios = [math.log(for_third_octaves(power)) for power, *_ in CLASS_1]
        least = np.interp(math.log(10.0**0.1), ratios, [low for _, low, _ in CLASS_1])
        assert found[place] - found[beside] > least > 13.0


@pytest.mark.parametrize(
    ("number", "rate", "seconds"),
    [
        (14, 8000, 6.0),
        (35, 8000, 0.1),
        (43, 48000, 0.05),
    ],
)
def test_a_band_has_the_attenuation_of_class_1(number, rate, seconds):
    middle, place = 10.0 ** (number / 10.0), number - 14

    def level(ratio):
        samples = tone(1.0, ratio * middle, seconds, rate)
        return list(levels(samples, rate, 2 * len(samples) // 3).values())[place]

    reference = level(1.0)
    for power, least, most in CLASS_1:
        ratio = for_third_octaves(power)
        for at in (1.0 / ratio, ratio):
            if at * middle < 0.499 * rate:
                attenuation = reference - level(at)
                assert least <= attenuation <= most, at


@pytest.mark.parametrize("frequency", [23000.0, 11000.0, 13000.0, 5000.0, 7000.0, 2000.0, 4000.0])
def test_nothing_folds_into_a_band_where_the_rate_is_halved(frequency):
    samples = tone(1.0, frequency, 0.3)
    assert levels(samples, run_in=len(samples) // 2)[1000.0] < -70.0


def test_a_sound_heard_in_blocks_is_the_sound_heard_whole():
    samples = np.random.default_rng(1).standard_normal((2, RATE))
    whole, streamed = ThirdOctaveMeter(RATE), ThirdOctaveMeter(RATE)
    whole.update(samples)
    for part in np.split(samples, [1, 1, 2, 9, 500, 501, 20001], axis=1):
        streamed.update(part)
    for left, right in zip(streamed.result(), whole.result(), strict=True):
        assert left.level == pytest.approx(right.level, abs=1e-9)


def test_channels_are_heard_as_their_energy_mean():
    found = levels(np.stack([tone(0.1), tone(0.3)]))
    assert found[1000.0] == pytest.approx(10.0 * math.log10((0.01 + 0.09) / 2.0), abs=0.02)


def test_what_was_forgotten_is_in_no_level():
    samples = np.concatenate([tone(1.0, 1000.0), tone(0.01, 1000.0, 4.0)])
    assert levels(samples, run_in=3 * RATE)[1000.0] == pytest.approx(-40.0, abs=0.01)


def test_a_band_has_a_level_as_soon_as_its_filter_answers():
    found = levels(noise(0.0)[: RATE // 10])
    # 3 / bandwidth: 0.13 s at 100 Hz, 0.1 s between it and 125 Hz.
    assert math.isnan(found[100.0]) and not math.isnan(found[160.0])
    assert not math.isnan(levels(noise(0.0)[: round(0.53 * RATE)])[25.0])


def test_from_there_on_it_lacks_next_to_nothing_of_a_steady_noise():
    # What of an impulse's answer comes after that time is what then lacks of a steady noise.
    clicks = np.zeros((2, 4 * RATE))
    clicks[0, 1] = clicks[1, 2 * RATE] = 1.0
    late, whole = (np.array(list(levels(click).values())) for click in clicks)
    lacking = 10.0 * np.log10(1.0 - 10.0 ** ((late - whole) / 10.0))
    assert lacking[:-1].min() > -0.1
    assert lacking.min() > -0.31


def test_an_offset_is_in_no_band_and_silence_is_minus_infinity():
    assert max(levels(np.full(RATE, 0.5)).values()) < -200.0
    assert set(levels(np.zeros(RATE)).values()) == {-math.inf}


def test_the_reference_is_20_micropascals():
    meter = ThirdOctaveMeter(RATE)
    meter.update(tone(1.0)[None])
    assert {band.frequency: band.level for band in meter.result()}[1000.0] == pytest.approx(
        93.98, abs=0.02
    )


def test_another_filter_bank_has_the_same_levels():
    bank = pytest.importorskip("pyoctaveband", reason="needs PyOctaveBand, of mute[dev]")
    samples = noise(slope=-0.5, seconds=8.0, seed=3)
    found = levels(samples)
    theirs, _ = bank.octavefilter(samples, RATE, 3, 6, limits=[25, 20000], dbfs=True)
    differences = np.subtract(list(found.values()), theirs)
    assert np.abs(differences[NOMINAL.index(100) :]).max() < 0.1
    # Theirs counts the time in which the filters rise from rest: 0.2 of 8 s at 25 Hz.
    assert np.abs(differences).max() < 0.3


def test_the_table_of_class_1_is_that_of_another_transcription():
    compliance = pytest.importorskip(
        "pyoctaveband.compliance", reason="needs PyOctaveBand, of mute[dev]"
    )
    for power, least, most in CLASS_1:
        inside, outside = for_third_octaves(power) * np.array([1.0 - 1e-9, 1.0 + 1e-9])
        _, theirs_most = compliance.class_limits(3, 1, np.array([inside]))
        theirs_least, _ = compliance.class_limits(3, 1, np.array([outside]))
        assert theirs_least[0] == pytest.approx(least, abs=1e-5)
        assert theirs_most[0] == pytest.approx(most, abs=1e-5)
