"""Tests of WAV files that grow as their sound is made."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mute.acoustics.files import wav_file
from mute.acoustics.files.wav import read_wav
from mute.acoustics.files.wav_file import WavFile
from mute.support.errors import MuteError


def test_samples_beyond_full_scale_are_cut_off_and_counted(tmp_path):
    file = WavFile(tmp_path / "loud.wav", 48000, 4.0)
    file.write(np.array([0.0, 2.0, 5.0, -5.0]))
    file.close()
    assert file.clipped == 2
    samples = read_wav(file.path)[0][0]
    assert samples == pytest.approx([0.0, 0.5, 1.0, -1.0], abs=1e-4)


def test_a_file_ends_at_its_greatest_length(tmp_path, monkeypatch):
    monkeypatch.setattr(wav_file, "_MOST_SAMPLES", 5)
    file = WavFile(tmp_path / "long.wav", 48000, 4.0)
    for _ in range(3):
        file.write(np.zeros(3))
    file.close()
    assert read_wav(file.path)[0].shape == (1, 5)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a full device")
def test_a_full_disk_is_told_in_one_line():
    file = WavFile(Path("/dev/full"), 48000, 4.0)
    with pytest.raises(MuteError, match="cannot write /dev/full: No space left on device"):
        file.write(np.zeros(100_000))
        file.close()
