"""Tests of the detector, its readings, and the figures made of them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mute.acoustics.metering.levels import P_REF, LevelDetector, TimeWeighting, settling_time

RATE = 1000


def detect(squares, sample_rate=RATE, time_weighting: TimeWeighting = "fast", reference=1.0):
    squares = np.atleast_2d(np.asarray(squares, dtype=float))
    detector = LevelDetector(sample_rate, len(squares), time_weighting, reference)
    detector.update(squares)
    return detector


def test_a_steady_signal_has_its_mean_square_in_every_figure():
    (levels,) = detect(np.full(5 * RATE, 100.0)).result()
    assert levels.laeq == pytest.approx(20.0, abs=1e-9)
    assert levels.lafmax == pytest.approx(20.0, abs=1e-9)
    assert levels.pnl == pytest.approx(20.0, abs=1e-9)
    assert levels.l10 == pytest.approx(20.0, abs=1e-6)
    assert levels.mnl == pytest.approx(20.0, abs=0.01)
    assert levels.l90 == pytest.approx(20.0, abs=0.05)


def test_the_reference_is_20_micropascals():
    (levels,) = detect(np.full(RATE, 1.0), reference=P_REF).result()
    assert levels.laeq == pytest.approx(93.979, abs=0.001)


@pytest.mark.parametrize(("time_weighting", "constant"), [("fast", 0.125), ("slow", 1.0)])
def test_the_detector_falls_with_its_time_constant(time_weighting, constant):
    squares = np.zeros(11 * RATE)
    squares[: 5 * RATE] = 1.0
    detector = detect(squares, time_weighting=time_weighting)
    at = dict(zip(detector.reading_times.round(2), detector.readings[0], strict=True))
    # exp(-t / constant) in decibels
    assert at[9.0] - at[10.0] == pytest.approx(10.0 * math.log10(math.e) / constant, rel=1e-9)


@pytest.mark.parametrize(("time_weighting", "constant"), [("fast", 0.125), ("slow", 1.0)])
def test_the_detector_rises_with_its_time_constant(time_weighting, constant):
    detector = detect(np.ones(round(constant * RATE)), time_weighting=time_weighting)
    risen = 10.0 * math.log10(1.0 - math.exp(-1.0))
    assert detector.level[0] == pytest.approx(risen, abs=1e-9)


@pytest.mark.parametrize(("time_weighting", "settling"), [("fast", 0.5), ("slow", 4.0)])
def test_readings_begin_when_the_detector_has_settled(time_weighting, settling):
    detector = detect(np.ones(10 * RATE), time_weighting=time_weighting)
    assert settling_time(time_weighting) == settling
    np.testing.assert_allclose(detector.reading_times, np.arange(settling, 10.01, 0.05))
    assert detector.readings[0, 0] == pytest.approx(0.0, abs=0.081)
    assert detector.result()[0].readings == len(detector.reading_times)


def test_the_mean_and_the_peak_are_those_of_the_readings_in_decibels():
    squares = np.random.default_rng(1).exponential(size=3 * RATE)
    detector = detect(squares)
    (levels,) = detector.result()
    assert levels.mnl == pytest.approx(np.mean(detector.readings[0]))
    assert levels.pnl == np.max(detector.readings[0])
    assert levels.laeq == pytest.approx(10.0 * math.log10(np.mean(squares)))


def test_readings_are_taken_at_the_nearest_sample_of_an_odd_rate():
    # At 30 Hz, reading k comes after round(1.5 k) samples, half up: from k = 10 on, 15, 17, 18, 20.
    squares = np.arange(1.0, 21.0)
    detector = detect(squares, sample_rate=30)
    decay = math.exp(-1.0 / (30 * 0.125))
    state, after = 0.0, {}
    for sample, square in enumerate(squares, start=1):
        state = decay * state + (1.0 - decay) * square
        after[sample] = 10.0 * math.log10(state)
    expected = [after[15], after[17], after[18], after[20]]
    np.testing.assert_allclose(detector.readings[0], expected)
    one_by_one = LevelDetector(30, reference=1.0)
    for square in squares:
        one_by_one.update(np.array([[square]]))
    np.testing.assert_allclose(one_by_one.readings, detector.readings, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("loud_share", "l10", "l90"), [(0.05, 0.0, 0.0), (0.15, 20.0, 0.0), (0.95, 20.0, 20.0)]
)
def test_the_exceeded_levels_count_the_time(loud_share, l10, l90):
    squares = np.ones(100 * RATE)
    squares[round((1.0 - loud_share) * len(squares)) :] = 100.0
    (levels,) = detect(squares).result()
    assert levels.l10 == pytest.approx(l10, abs=0.01)
    assert levels.l90 == pytest.approx(l90, abs=0.01)


def test_the_maximum_is_that_of_the_detector_between_two_readings():
    squares = np.zeros(2 * RATE)
    squares[1010] = RATE  # 10 ms after a reading, 40 ms before the next
    (levels,) = detect(squares).result()
    top = 10.0 * math.log10(RATE * (1.0 - math.exp(-0.008)))
    assert levels.lafmax == pytest.approx(top)
    assert levels.pnl == pytest.approx(top + 10.0 * math.log10(math.exp(-39.0 / 125.0)))


def test_blocks_of_any_length_give_the_same_figures():
    squares = np.random.default_rng(2).exponential(size=(3, 2205))
    whole = LevelDetector(441, 3)
    whole.update(squares)
    streamed = LevelDetector(441, 3)
    for part in np.split(squares, [1, 1, 22, 23, 400, 2000], axis=1):
        streamed.update(part)
    np.testing.assert_allclose(streamed.readings, whole.readings, rtol=0.0, atol=1e-9)
    for left, right in zip(streamed.result(), whole.result(), strict=True):
        assert left.lafmax == pytest.approx(right.lafmax, abs=1e-9)
        assert left.laeq == pytest.approx(right.laeq, abs=1e-9)


def test_what_was_forgotten_is_in_no_figure_and_settles_the_detector():
    squares = np.random.default_rng(4).exponential(size=4 * RATE)
    squares[: 2 * RATE] *= 100.0
    whole = detect(squares)
    part = LevelDetector(RATE, reference=1.0)
    part.update(squares[None, : 3 * RATE])
    part.forget()
    part.update(squares[None, 3 * RATE :])
    later = whole.reading_times > 3.0
    np.testing.assert_array_equal(part.reading_times, whole.reading_times[later])
    np.testing.assert_allclose(part.readings[0], whole.readings[0, later], rtol=0.0, atol=1e-9)
    (levels,) = part.result()
    assert (levels.readings, levels.seconds) == (20, 1.0)
    assert levels.laeq == pytest.approx(10.0 * math.log10(np.mean(squares[3 * RATE :])))
    assert levels.mnl == pytest.approx(whole.readings[0, later].mean())
    assert levels.pnl <= levels.lafmax < whole.result()[0].lafmax - 10.0


def test_what_was_forgotten_before_the_detector_settled_leaves_it_to_settle():
    detector = LevelDetector(RATE, reference=1.0)
    detector.update(np.ones((1, 300)))
    detector.forget()
    detector.update(np.ones((1, 400)))
    np.testing.assert_allclose(detector.reading_times, [0.5, 0.55, 0.6, 0.65, 0.7])


def test_of_what_was_all_forgotten_there_are_no_levels():
    detector = detect(np.ones(RATE))
    detector.forget()
    with pytest.raises(ValueError, match="empty"):
        detector.result()


def test_channels_are_measured_apart():
    squares = np.stack([np.full(RATE, 1.0), np.full(RATE, 100.0)])
    first, second = detect(squares).result()
    assert (first.laeq, second.laeq) == pytest.approx((0.0, 20.0))


def test_silence_is_minus_infinity():
    (levels,) = detect(np.zeros(RATE)).result()
    figures = (levels.mnl, levels.pnl, levels.laeq, levels.lafmax, levels.l10, levels.l90)
    assert figures == (-math.inf,) * 6


def test_what_is_too_short_for_a_reading_still_has_a_level():
    (levels,) = detect(np.ones(RATE // 4)).result()
    assert levels.readings == 0
    assert all(math.isnan(value) for value in (levels.mnl, levels.pnl, levels.l10, levels.l90))
    assert levels.laeq == pytest.approx(0.0)


def test_an_empty_signal_has_no_levels():
    with pytest.raises(ValueError, match="empty"):
        LevelDetector(RATE).result()


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        ({"sample_rate": 10}, "sample_rate"),
        ({"channels": 0}, "channels"),
        ({"time_weighting": "impulse"}, "time_weighting must be fast or slow"),
        ({"reference": 0.0}, "reference"),
    ],
)
def test_bad_arguments_are_refused_by_name(arguments, names):
    with pytest.raises(ValueError, match=names):
        LevelDetector(**{"sample_rate": RATE, **arguments})


def test_a_block_of_other_channels_is_refused():
    with pytest.raises(ValueError, match=r"squares must be \(2, samples\), got \(3, 5\)"):
        LevelDetector(RATE, 2).update(np.zeros((3, 5)))
