"""Tests of calibration: the right level from a tone that is disturbed, and no level from noise."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from wav_helpers import RATE, tone, write_sound

from mute.acoustics.metering.calibrator import Calibration, Calibrator, calibrate
from mute.acoustics.metering.levels import P_REF
from mute.acoustics.metering.wav_levels import open_wav
from mute.support.errors import MuteError

LEVEL = 94.0
RMS = 0.2
# What full scale is, where the calibrator's tone has this root mean square.
RIGHT = P_REF * 10.0 ** (LEVEL / 20.0) / RMS


def calibration_of(tmp_path, samples, frequency=1000.0, level=LEVEL, rate=RATE) -> Calibration:
    path = tmp_path / "cal.wav"
    write_sound(path, samples, rate)
    with open_wav(path) as wav:
        return calibrate(wav, Calibrator(level, frequency), list(range(wav.channels)))


def error_db(calibration, right=RIGHT):
    return 20.0 * np.log10(calibration.gains / right)


def noise(rms, seconds, seed=0) -> NDArray[np.float64]:
    return rms * np.random.default_rng(seed).standard_normal(round(seconds * RATE))


@pytest.mark.parametrize("seconds", [0.5, 0.6, 2.0])
@pytest.mark.parametrize("rate", [8000, 44100, 48000, 192000])
def test_a_steady_tone_gives_the_gain_without_a_word(tmp_path, seconds, rate):
    calibration = calibration_of(tmp_path, tone(RMS, seconds=seconds, rate=rate), rate=rate)
    assert abs(error_db(calibration)[0]) < 0.01
    assert calibration.warnings == ()


@pytest.mark.parametrize("frequency", [980.0, 1020.0])
def test_a_calibrator_may_be_off_its_frequency_as_its_class_allows(tmp_path, frequency):
    calibration = calibration_of(tmp_path, tone(RMS, frequency))
    assert abs(error_db(calibration)[0]) < 0.1


def test_a_bump_at_the_end_changes_nothing_and_is_told(tmp_path):
    samples = tone(RMS, seconds=10.0)
    last = round(0.2 * RATE)
    samples[-last:] += noise(2.0, 0.2)
    # The mean square of the whole, which it must not be taken for, is some 5 dB too high.
    assert 20.0 * math.log10(np.std(samples) / RMS) > 4.0
    calibration = calibration_of(tmp_path, samples)
    assert abs(error_db(calibration)[0]) < 0.01
    (warning,) = calibration.warnings
    assert "cal.wav: not a steady tone, its readings spread by" in warning


def test_silence_at_the_beginning_changes_nothing_and_is_told(tmp_path):
    samples = np.concatenate((np.zeros(RATE // 2), tone(RMS, seconds=4.5)))
    calibration = calibration_of(tmp_path, samples)
    assert abs(error_db(calibration)[0]) < 0.01
    assert "its readings hold silence too" in calibration.warnings[0]


def test_a_tone_that_is_switched_on_in_a_quiet_room_is_told(tmp_path):
    samples = noise(1e-4, 5.0)
    samples[RATE // 2 :] += tone(RMS, seconds=4.5)
    calibration = calibration_of(tmp_path, samples)
    assert abs(error_db(calibration)[0]) < 0.01
    assert "not a steady tone" in calibration.warnings[0]


@pytest.mark.parametrize(("change", "told"), [(0.15, False), (0.25, True)])
def test_readings_may_spread_by_a_fifth_of_a_decibel(tmp_path, change, told):
    samples = tone(RMS, seconds=4.0)
    samples[2 * RATE :] *= 10.0 ** (change / 20.0)
    assert bool(calibration_of(tmp_path, samples).warnings) is told


TONE = tone(RMS, seconds=10.0)


@pytest.mark.parametrize(
    "samples",
    [
        TONE * np.linspace(1.0, 0.5, len(TONE)),
        TONE * (1.0 + 0.5 * tone(0.7, 3.0, seconds=10.0)),
        np.where(np.arange(len(TONE)) < 5.1 * RATE, TONE, noise(1e-3, 10.0)),
    ],
    ids=["fading", "trembling", "hardly longer than the noise behind it"],
)
def test_a_tone_that_is_not_steady_half_of_the_time_is_refused(tmp_path, samples):
    with pytest.raises(MuteError, match=r"cal\.wav: not a steady tone: \d+ % .* within 0\.2 dB"):
        calibration_of(tmp_path, samples)


@pytest.mark.parametrize("tone_first", [True, False])
def test_a_tone_for_most_of_the_time_gives_its_level(tmp_path, tone_first):
    parts = [TONE[: 6 * RATE], noise(1e-3, 4.0)]
    samples = np.concatenate(parts if tone_first else parts[::-1])
    calibration = calibration_of(tmp_path, samples)
    assert abs(error_db(calibration)[0]) < 0.2
    assert "not a steady tone" in calibration.warnings[0]


def test_noise_of_a_room_is_no_calibration(tmp_path):
    with pytest.raises(MuteError, match=r"cal\.wav: not the tone of a calibrator at 1000 Hz: \d %"):
        calibration_of(tmp_path, noise(1e-3, 5.0))


@pytest.mark.parametrize(("signal_to_noise", "taken"), [(20.0, True), (10.0, False)])
def test_a_tone_must_hold_nearly_all_of_the_energy(tmp_path, signal_to_noise, taken):
    samples = tone(RMS, seconds=3.0) + noise(RMS * 10.0 ** (-signal_to_noise / 20.0), 3.0)
    if taken:
        assert abs(error_db(calibration_of(tmp_path, samples))[0]) < 0.2
        return
    with pytest.raises(MuteError, match="not the tone of a calibrator"):
        calibration_of(tmp_path, samples)


def test_hum_wind_and_an_offset_do_not_matter(tmp_path):
    samples = tone(RMS) + tone(0.5 * RMS, 50.0) + np.full(2 * RATE, 0.3)
    calibration = calibration_of(tmp_path, samples)
    assert abs(error_db(calibration)[0]) < 0.02
    assert calibration.warnings == ()


def test_a_calibrator_of_250_hz_gives_its_unweighted_level(tmp_path):
    calibration = calibration_of(tmp_path, tone(RMS, 250.0), 250.0, 124.0)
    right = P_REF * 10.0 ** (124.0 / 20.0) / RMS
    assert abs(error_db(calibration, right)[0]) < 0.02
    assert calibration.warnings == ()


@pytest.mark.parametrize(("is_at", "named"), [(250.0, 1000.0), (1000.0, 250.0), (1050.0, 1000.0)])
def test_a_tone_at_another_frequency_is_refused_with_its_own(tmp_path, is_at, named):
    with pytest.raises(MuteError, match=rf"at {named:g} Hz: .*, and {is_at:g} Hz is strongest"):
        calibration_of(tmp_path, tone(RMS, is_at), named)


def test_a_frequency_that_the_sample_rate_cannot_hold_is_refused(tmp_path):
    with pytest.raises(MuteError, match="a tone of 4000 Hz is not in a recording at 8000 Hz"):
        calibration_of(tmp_path, tone(RMS, rate=8000), 4000.0, rate=8000)


def test_each_channel_has_its_own_gain(tmp_path):
    calibration = calibration_of(tmp_path, np.stack((tone(RMS), tone(0.3))))
    np.testing.assert_allclose(calibration.gains, [RIGHT, RIGHT * RMS / 0.3], rtol=1e-3)


def test_one_channel_of_noise_is_refused_though_the_other_has_the_tone(tmp_path):
    with pytest.raises(MuteError, match="not the tone of a calibrator"):
        calibration_of(tmp_path, np.stack((tone(RMS), noise(RMS, 2.0))))


def test_a_clipped_calibration_is_told(tmp_path):
    calibration = calibration_of(tmp_path, np.clip(tone(0.75), -1.0, 1.0))
    assert "the calibration is clipped" in calibration.warnings[0]
