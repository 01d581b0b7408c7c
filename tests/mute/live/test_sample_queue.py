"""Samples come out as they went in; gaps and what is left out make no click, and are counted."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from mute.live.sample_queue import LONGEST_WAIT, SampleQueue

RATE = 48000
STEP = RATE // 50
"""Samples of a control step."""
STEEPEST = 0.5 / (0.003 * RATE)
"""Largest difference between neighbours of what decays from 0.5 with a time constant of 3 ms."""


def _pull(queue: SampleQueue, count: int) -> np.ndarray:
    out = np.full(count, np.nan, dtype=np.float32)
    queue.play(out)
    return out


def _ramp(begin: int, count: int) -> np.ndarray:
    """Return samples that tell their place, from 0 on."""
    return np.arange(begin, begin + count, dtype=np.float32) / 2**20


def _constant(count: int = STEP) -> np.ndarray:
    return np.full(count, 0.5, dtype=np.float32)


def _begun() -> SampleQueue:
    """Return a queue that plays a constant of 0.5, of which two control steps wait."""
    queue = SampleQueue(RATE)
    for _ in range(3):
        queue.feed(_constant())
    _pull(queue, STEP)
    return queue


def test_playing_begins_with_two_control_steps_in_hand():
    queue = SampleQueue(RATE)
    queue.feed(_ramp(0, STEP))
    np.testing.assert_array_equal(_pull(queue, 256), np.zeros(256))
    assert not queue.plays
    queue.feed(_ramp(STEP, STEP))
    np.testing.assert_array_equal(_pull(queue, 256), _ramp(0, 256))
    assert queue.plays
    assert queue.gaps == 0
    assert queue.silence == 0.0


@pytest.mark.parametrize("frames", [1, 64, 441, 960, 1024])
def test_samples_come_out_as_they_went_in(frames):
    queue = SampleQueue(RATE)
    got: list[np.ndarray] = []
    fed = 0
    while fed < 20 * STEP:
        queue.feed(_ramp(fed, STEP))
        fed += STEP
        while queue.waiting > 2 * STEP:
            got.append(_pull(queue, frames))
    heard = np.concatenate(got)
    assert len(heard) > 10 * STEP
    np.testing.assert_array_equal(heard, _ramp(0, len(heard)))
    assert queue.gaps == 0
    assert queue.left_out == 0.0


def test_a_gap_fades_is_counted_once_and_makes_the_supply_longer():
    queue = _begun()
    heard = [_pull(queue, 480) for _ in range(8)]
    assert queue.gaps == 1
    assert queue.silence == pytest.approx((8 * 480 - 2 * STEP) / RATE)
    assert abs(heard[-1]).max() < 1e-3
    queue.feed(_constant(2 * STEP))  # was enough at first
    heard.append(_pull(queue, 480))
    assert not queue.plays
    queue.feed(_constant(STEP))
    heard += [_pull(queue, 480) for _ in range(3)]
    assert queue.plays
    assert queue.gaps == 1
    whole = np.concatenate(heard)
    assert np.abs(np.diff(whole)).max() < 1.05 * STEEPEST
    np.testing.assert_allclose(whole[:STEP], 0.5, atol=1e-3)
    np.testing.assert_allclose(whole[-480:], 0.5, atol=1e-3)


def test_what_waits_too_long_is_left_out_without_a_click():
    queue = _begun()
    _pull(queue, STEP)
    before = _pull(queue, 100)
    for _ in range(10):
        queue.feed(-_constant())
        assert queue.waiting <= LONGEST_WAIT * RATE
    after = _pull(queue, STEP)
    assert queue.left_out > 0.0
    assert queue.gaps == 0
    joint = np.diff(np.concatenate((before[-1:], after)))
    assert np.abs(joint).max() < 2.1 * STEEPEST  # from 0.5 to -0.5
    assert after[-1] == pytest.approx(-0.5, abs=2e-3)


def test_a_stall_that_is_caught_up_with_leaves_no_lasting_delay():
    queue = _begun()
    for _ in range(10):
        _pull(queue, STEP)
    for _ in range(10):
        queue.feed(_constant())
    for _ in range(20):
        _pull(queue, STEP)
        queue.feed(_constant())
    assert queue.waiting <= LONGEST_WAIT * RATE
    assert queue.mean_wait < LONGEST_WAIT


def test_what_is_left_at_the_end_is_played_and_is_no_gap():
    queue = SampleQueue(RATE)
    queue.feed(_ramp(0, STEP))
    queue.end()
    np.testing.assert_array_equal(_pull(queue, 2 * STEP)[:STEP], _ramp(0, STEP))
    np.testing.assert_allclose(_pull(queue, STEP), 0.0, atol=1e-3)
    assert queue.gaps == 0
    assert queue.silence == 0.0


def test_the_mean_wait_is_that_of_what_was_played():
    queue = SampleQueue(RATE)
    assert queue.mean_wait == 0.0
    for _ in range(50):
        queue.feed(_constant())
        _pull(queue, STEP)
    # Two steps wait when a step is fed, one once it is played.
    assert queue.mean_wait == pytest.approx(0.04, abs=0.001)


def test_one_thread_feeds_and_another_plays():
    queue, total = SampleQueue(RATE), 400 * STEP
    got: list[np.ndarray] = []

    def feed() -> None:
        fed = 0
        while fed < total:
            if queue.waiting <= 2 * STEP:
                queue.feed(_ramp(fed, STEP))
                fed += STEP

    thread = threading.Thread(target=feed)
    thread.start()
    while thread.is_alive():
        if queue.waiting >= 2 * STEP:
            got.append(_pull(queue, 240))
    thread.join()
    heard = np.concatenate(got)
    np.testing.assert_array_equal(heard, _ramp(0, len(heard)))
    assert len(heard) + queue.waiting == total
