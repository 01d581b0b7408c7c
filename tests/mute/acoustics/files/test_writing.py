"""Tests of WAV files that grow as their sound is made."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import wavfile

from mute.acoustics.files import writing
from mute.acoustics.files.reading import read_wav
from mute.acoustics.files.writing import WavWriter, has_samples
from mute.support.errors import MuteError


def test_samples_beyond_full_scale_are_cut_off_and_counted(tmp_path):
    file = WavWriter(tmp_path / "loud.wav", 48000, 4.0)
    file.write(np.array([0.0, 2.0, 5.0, -5.0]))
    file.close()
    assert file.clipped == 2
    samples = read_wav(file.path)[0][0]
    assert samples == pytest.approx([0.0, 0.5, 1.0, -1.0], abs=1e-4)


def test_a_file_ends_at_its_greatest_length(tmp_path, monkeypatch):
    monkeypatch.setattr(writing, "_MOST_SAMPLES", 5)
    file = WavWriter(tmp_path / "long.wav", 48000, 4.0)
    for _ in range(3):
        file.write(np.zeros(3))
    file.close()
    assert read_wav(file.path)[0].shape == (1, 5)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a full device")
def test_a_full_disk_is_told_in_one_line():
    file = WavWriter(Path("/dev/full"), 48000, 4.0)
    with pytest.raises(MuteError, match="cannot write /dev/full: No space left on device"):
        file.write(np.zeros(100_000))
        file.close()


def test_other_programs_read_what_was_written(tmp_path):
    file = WavWriter(tmp_path / "made" / "walk.wav", 44100, 4.0)
    for block in np.split(np.linspace(-4.0, 4.0, 999), 3):
        file.write(block)
    file.close()
    rate, samples = wavfile.read(file.path)
    assert rate == 44100
    np.testing.assert_allclose(samples / 32767.0, np.linspace(-1.0, 1.0, 999), atol=2.0**-16)


@pytest.mark.parametrize("count", [0, 1])
def test_a_file_without_samples_is_known(tmp_path, count):
    file = WavWriter(tmp_path / "walk.wav", 48000, 4.0)
    file.write(np.zeros(count))
    file.close()
    assert has_samples(file.path) is bool(count)
