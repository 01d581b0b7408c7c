"""What a loudspeaker is given: as loud as on the web, rounded off, and never beyond full scale."""

from __future__ import annotations

import numpy as np
import pytest

from mute.live.loudness import FULL_SCALE, LOWEST, Loudness

RATE = 48000


def _tone(frequency: float, peak: float, seconds: float = 1.0) -> np.ndarray:
    """Return a tone of a peak in Pa."""
    return peak * np.sin(2.0 * np.pi * frequency * np.arange(round(RATE * seconds)) / RATE)


def _gain(frequency: float, peak: float) -> float:
    """Return the peak of a tone that has been played over that of its pressure."""
    return np.abs(Loudness(RATE).play(_tone(frequency, peak))[RATE // 2 :]).max() / peak


def test_a_tone_is_played_at_its_share_of_full_scale():
    assert FULL_SCALE == 2.5
    assert _gain(1000.0, 1.2) == pytest.approx(1.0 / 2.5, rel=3e-3)


def test_what_loudspeakers_cannot_give_is_left_out():
    assert _gain(LOWEST, 0.1) * FULL_SCALE == pytest.approx(10.0 ** (-3.0 / 20.0), rel=0.01)
    assert _gain(LOWEST / 4.0, 0.1) * FULL_SCALE < 0.07


def test_loud_sound_is_rounded_off_and_stays_within_full_scale():
    played = Loudness(RATE).play(_tone(500.0, 50.0))
    assert played.dtype == np.float32
    assert 0.999 < np.abs(played).max() <= 1.0
    assert _gain(500.0, 2.5) * FULL_SCALE == pytest.approx(0.5 + 0.5 * np.tanh(1.0), rel=0.01)


def test_blocks_add_up_to_the_whole():
    pressure = np.random.default_rng(0).standard_normal(RATE)
    whole, loudness = Loudness(RATE).play(pressure), Loudness(RATE)
    parts = [loudness.play(part) for part in np.split(pressure, [1, 7, 960, 961, 20000])]
    np.testing.assert_allclose(np.concatenate(parts), whole, atol=1e-7)
