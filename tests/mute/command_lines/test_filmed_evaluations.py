"""Evaluations film what they measure, with its sound."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import imageio.v3 as imageio
import numpy as np
import pytest
from film_helpers import dark_pixels, rendering_environment, sound_of
from places import REPOSITORY

from mute.acoustics.files.reading import read_wav
from mute.acoustics.listener import SAMPLE_RATE

_SMALL = """
import runpy, sys
from mute.rendering import video
video._WIDTH, video._HEIGHT = 320, 180
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name="__main__")
"""
"""Runs a program with small pictures, each of which costs the processor a tenth of a second."""


@pytest.fixture(scope="module")
def environ() -> dict[str, str]:
    return rendering_environment()


def _evaluate(environ: dict[str, str], *words: str | Path) -> str:
    """Return what `evaluate.py` prints on standard output, its pictures being small."""
    run = subprocess.run(
        [sys.executable, "-c", _SMALL, "evaluate.py", *map(str, words)],
        cwd=REPOSITORY,
        env=environ,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    return run.stdout


def test_evaluate_films_the_first_trial_of_each_setting_with_its_sound(tmp_path, environ):
    words = ("noise", "--surface", "wood", "--beta", "0,1", "--trials", "1", "--seconds", "1.2")
    _evaluate(environ, *words, "--video", tmp_path / "walk.mp4", "--out", tmp_path / "out")
    paths = [tmp_path / f"walk-wood-beta{beta}.mp4" for beta in (0, 1)]
    assert sorted(tmp_path.iterdir()) == [tmp_path / "out", *paths]
    levels = []
    for path in paths:
        rate = imageio.immeta(path)["fps"]
        frames = imageio.imread(path)
        # It begins when the robot has settled, and the view is from where the robot begins.
        assert len(frames) / rate == pytest.approx(1.2, abs=1.5 / rate)
        assert len(dark_pixels(frames[0])) > 60
        sound = sound_of(path)
        assert len(sound) / SAMPLE_RATE == pytest.approx(1.2, abs=0.03)
        levels.append(float(np.sqrt(np.mean(sound**2))))
    assert levels[0] > 1.4 * levels[1] > 0.0


def test_a_sweep_keeps_the_sound_that_it_puts_into_a_film(tmp_path, environ):
    words = ("sweep-speed", "--speed", "0.5", "--beta", "1", "--trials", "1", "--seconds", "1.04")
    wav, film, out = tmp_path / "walk.wav", tmp_path / "walk.mp4", tmp_path / "out"
    shown = _evaluate(environ, *words, "--wav", wav, "--video", film, "--out", out)
    assert f"kept: {wav}, {film}\n" in shown
    assert sorted(tmp_path.iterdir()) == [out, film, wav]
    kept, rate = read_wav(wav)
    assert kept.shape[1] == round(1.04 * rate)
    heard = sound_of(film)[: kept.shape[1]]
    assert np.std(heard) == pytest.approx(np.std(kept), rel=0.05)  # AAC is lossy


def test_a_walk_over_a_course_is_filmed_with_its_sound(tmp_path, environ):
    course, film, out = tmp_path / "course.yaml", tmp_path / "walk.mp4", tmp_path / "out"
    course.write_text(
        "speed: 0.5\npath: [[0, 0], [0.6, 0]]\n"
        "floors: [{floor: tile, low: [-1, -1], high: [2, 1]}]\n"
    )
    words = ("walk", "--course", course, "--trials", "2")
    shown = _evaluate(environ, *words, "--video", film, "--out", out)
    assert f"kept: {film}\n" in shown
    assert sorted(tmp_path.iterdir()) == [course, out, film]
    walk = json.loads((out / "walk.json").read_text())
    # It begins when the robots have settled, and ends when the last of them has arrived.
    filmed = max(one["seconds"] for one in (walk, *walk["others"])) - 1.0
    rate = imageio.immeta(film)["fps"]
    assert len(imageio.imread(film)) / rate == pytest.approx(filmed, abs=1.5 / rate)
    sound = sound_of(film)
    assert len(sound) / SAMPLE_RATE == pytest.approx(filmed, abs=0.03)
    assert np.std(sound) > 0.0
