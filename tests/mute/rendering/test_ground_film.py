"""A film over ground shows the ground, and dots where it is and where it is taken to be."""

from __future__ import annotations

import subprocess
import sys

import imageio.v3 as imageio
import numpy as np
from film_helpers import dark_pixels, rendering_environment
from places import FLAT_POLICY, REPOSITORY


def test_a_film_over_stairs_shows_them_with_true_and_estimated_heights(tmp_path):
    path = tmp_path / "stairs.mp4"
    # It takes the ground to be higher than it is, where dots are not hidden.
    words = ("--policy", str(FLAT_POLICY), "--terrain", "stairs", "--level", "2")
    words += ("--seconds", "0.04", "--video", str(path))
    run = subprocess.run(
        [sys.executable, "play.py", *words],
        cwd=REPOSITORY,
        env=rendering_environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    frames = imageio.imread(path)
    assert len(frames) == 2  # one before the first step, and one after two
    red, green, blue = frames[-1].astype(int).transpose(2, 0, 1)
    assert len(dark_pixels(frames[-1])) > 1000
    # The floor is bluish, and so is the sky: what is not is the stairs.
    assert np.count_nonzero(red > blue + 10) > 30_000
    assert np.count_nonzero((green > red + 40) & (green > blue + 40)) > 300
    assert np.count_nonzero((red > green + 60) & (red > blue + 100)) > 300
