"""Tests of spans: a part of a recording has the figures that it has within the whole."""

from __future__ import annotations

import math

import numpy as np
import pytest
from wav_helpers import RATE, tone, write_sound

from mute.acoustics.metering.levels import LevelDetector, TimeWeighting
from mute.acoustics.metering.spans import Span, find_span
from mute.acoustics.metering.wav_levels import doubts, measure_span, open_wav
from mute.acoustics.metering.weighting import AWeighting
from mute.support.errors import MuteError


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    """Six seconds of noise that grows louder, as a file, and its samples."""
    path = tmp_path_factory.mktemp("sound") / "walk.wav"
    noise = np.random.default_rng(5).standard_normal(6 * 8000) * np.geomspace(0.001, 0.1, 6 * 8000)
    write_sound(path, noise, 8000, "DOUBLE")
    return path, noise


def measured(path, begin=None, end=None, time_weighting: TimeWeighting = "fast"):
    with open_wav(path) as wav:
        span = find_span(wav, begin, end)
        result = measure_span(wav, [0], np.ones(1), span, time_weighting, 1.0)
        return result, doubts(wav, [0], span, result.levels, time_weighting)


def test_a_span_is_the_samples_between_its_times(walk):
    with open_wav(walk[0]) as wav:
        assert find_span(wav, 1.0, 2.5) == Span(8000, 20000, 8000)
        assert find_span(wav, None, None) == Span(0, 48000, 8000)
        assert find_span(wav, 5.99, None) == Span(47920, 48000, 8000)
        assert find_span(wav, 0.0, 6.0) == Span(0, 48000, 8000)


@pytest.mark.parametrize(
    ("begin", "end", "reason"),
    [
        (6.0, None, r"--from must be below 6\.000 s, where the recording ends, got 6\.0"),
        (1e300, None, r"--from must be below .*, got 1e\+300"),
        (None, 6.001, r"--to must be at most 6\.000 s, where the recording ends, got 6\.001"),
        (2.0, 2.00001, r"--to must be 0\.000125 s, a sample, or more after --from, got 2\.00001"),
    ],
)
def test_a_span_that_the_recording_lacks_is_refused(walk, begin, end, reason):
    with open_wav(walk[0]) as wav, pytest.raises(MuteError, match=rf"walk\.wav: {reason}"):
        find_span(wav, begin, end)


def test_the_readings_of_a_span_are_those_of_the_whole_recording(walk):
    whole, _ = measured(walk[0])
    part, _ = measured(walk[0], 4.51, 5.5)
    within = (whole.reading_times > 4.51) & (whole.reading_times <= 5.5)
    np.testing.assert_allclose(part.reading_times, whole.reading_times[within], atol=1e-9)
    assert part.reading_times[0] == pytest.approx(4.55)
    np.testing.assert_allclose(part.readings, whole.readings[within], rtol=0.0, atol=1e-5)
    assert part.levels.mnl == pytest.approx(whole.readings[within].mean(), abs=1e-5)
    assert part.levels.pnl == pytest.approx(whole.readings[within].max(), abs=1e-5)


def test_a_span_has_the_level_of_its_samples_and_loses_no_time_to_settle(walk):
    path, noise = walk
    weighted = AWeighting(8000).filter(noise[None])[0]
    part, told = measured(path, 3.0, 3.4)
    expected = 10.0 * math.log10(np.mean(weighted[24000:27200] ** 2))
    assert part.levels.laeq == pytest.approx(expected, abs=1e-6)
    assert (part.levels.readings, part.levels.seconds) == (8, 0.4)
    # Cut out, it would be too short for a reading.
    assert not any("readings" in line for line in told)
    assert not any(math.isnan(band.level) for band in part.third_octaves)


def test_a_span_is_measured_as_the_recording_cut_to_it(walk, tmp_path):
    path, noise = walk
    write_sound(tmp_path / "cut.wav", noise[16000:], 8000, "DOUBLE")
    part, _ = measured(path, 2.0)
    cut, _ = measured(tmp_path / "cut.wav")
    for name in ("laeq", "pnl", "lafmax"):
        left, right = getattr(part.levels, name), getattr(cut.levels, name)
        assert left == pytest.approx(right, abs=0.001)
    # The cut recording must settle again: it has no readings in its first half second, and those
    # that follow still lack something.
    assert part.levels.readings == cut.levels.readings + 9
    np.testing.assert_allclose(part.readings[-40:], cut.readings[-40:], rtol=0.0, atol=1e-4)
    for band, other in zip(part.third_octaves, cut.third_octaves, strict=True):
        assert band.level == pytest.approx(other.level, abs=0.6)


def test_what_is_before_the_span_is_not_in_its_spectrum(tmp_path):
    path = tmp_path / "walk.wav"
    loud, quiet = tone(0.5, 100.0, 3.0), tone(0.05, 1000.0, 3.0)
    write_sound(path, np.concatenate([loud, quiet]), RATE)
    part, _ = measured(path, 5.0)
    levels = {band.frequency: band.level for band in part.third_octaves}
    assert levels[1000.0] == pytest.approx(-26.02, abs=0.01)
    assert levels[100.0] < -60.0


def test_slow_settles_for_longer_before_a_span(tmp_path):
    path = tmp_path / "walk.wav"
    write_sound(path, tone(0.1, 1000.0, 9.0, 8000), 8000)
    part, _ = measured(path, 8.0, None, "slow")
    assert Span(64000, 72000, 8000).lead_in("slow") == 0
    assert Span(20 * 8000 + 1, 21 * 8000, 8000).lead_in("slow") == 4
    assert Span(20 * 8000 + 1, 21 * 8000, 8000).lead_in("fast") == 18
    assert part.levels.readings == 20
    assert part.levels.mnl == pytest.approx(-20.0, abs=0.01)


def test_a_span_between_two_readings_is_told(walk):
    part, told = measured(walk[0], 3.01, 3.04)
    assert math.isnan(part.levels.mnl)
    expected = "no readings from 3.010 to 3.040 s; there are 20 a second, from 0.5 s of"
    assert any(expected in line for line in told)


def test_samples_at_full_scale_count_where_they_are_measured(tmp_path):
    path = tmp_path / "loud.wav"
    samples = np.concatenate([np.ones(8000), tone(0.1, 1000.0, 1.0, 8000)])
    write_sound(path, samples, 8000, "PCM_16")
    assert any("8000 samples at full scale" in line for line in measured(path)[1])
    assert not any("full scale" in line for line in measured(path, 1.0)[1])


def test_a_detector_that_heard_all_shows_the_same(walk):
    path, noise = walk
    detector = LevelDetector(8000, 1, "slow", reference=1.0)
    detector.update(np.square(AWeighting(8000).filter(noise[None])))
    part, _ = measured(path, 5.0, None, "slow")
    np.testing.assert_allclose(part.readings, detector.readings[0, -20:], rtol=0.0, atol=1e-9)
