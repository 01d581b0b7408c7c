"""A film that is whole gets its sound, and stays whole where that fails."""

from __future__ import annotations

from pathlib import Path

import imageio.v3 as imageio
import numpy as np
import pytest
from film_helpers import sound_of
from wav_helpers import write_sound

from mute.rendering.sound_track import add_sound
from mute.support.errors import MuteError


@pytest.fixture
def film(tmp_path: Path) -> Path:
    """Return a silent film of half a second, as small as can be."""
    pictures = np.linspace(0, 255, 25)[:, None, None, None] * np.ones((1, 32, 32, 3))
    path = tmp_path / "film.mp4"
    imageio.imwrite(path, pictures.astype(np.uint8), fps=50)
    return path


def test_a_film_gets_the_sound_and_keeps_its_pictures(film):
    before = imageio.imread(film)
    wav = film.with_name("tone.wav")
    tone = 0.5 * np.sin(2.0 * np.pi * 1000.0 * np.arange(24000) / 48000.0)
    write_sound(wav, tone, 48000)
    add_sound(film, wav)
    np.testing.assert_array_equal(imageio.imread(film), before)
    sound = sound_of(film)
    assert len(sound) == pytest.approx(24000, abs=1024)  # a frame of AAC
    assert np.sqrt(np.mean(sound[2400:21600] ** 2)) == pytest.approx(0.5 / np.sqrt(2.0), rel=0.02)
    assert sorted(film.parent.iterdir()) == [film, wav]


def test_a_sound_that_cannot_be_read_leaves_the_film_as_it_was(film):
    before = film.read_bytes()
    wav = film.with_name("broken.wav")
    wav.write_bytes(b"no sound at all")
    with pytest.raises(MuteError, match="Invalid data"):
        add_sound(film, wav)
    assert film.read_bytes() == before
    assert sorted(film.parent.iterdir()) == [wav, film]
