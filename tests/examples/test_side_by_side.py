"""The picture on the front page can be made: two robots, their levels, one film."""

from __future__ import annotations

import os
import re
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image
from places import REPOSITORY
from side_by_side import Clip, main, panel

from mute.rendering import backend
from mute.support.errors import MuteError

_BLACK = np.zeros((264, 416, 3), dtype=np.uint8)


def _drawn(level: float) -> np.ndarray:
    """Return a panel whose level has been the same for as long as the trace shows."""
    clip = Clip(beta=1.0, pictures=[_BLACK], levels=[level] * 75, speed=0.4)
    return np.asarray(panel(clip, 0, "#ff0000"), dtype=int)


def test_the_film_shows_both_robots_and_the_louder_one_is_told_as_louder(tmp_path):
    try:
        environ = {**os.environ, "MUJOCO_GL": backend.find_backend(os.environ)}
    except MuteError as error:
        pytest.skip(str(error))
    path = tmp_path / "film.webp"
    words = ["examples/side_by_side.py", "--seconds", "0.12", "--out", str(path)]
    run = subprocess.run(
        [sys.executable, *words],
        cwd=REPOSITORY,
        env={**environ, "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    loud, quiet = (float(level) for level in re.findall(r"([\d.]+) dBA", run.stdout))
    assert 64.0 < loud < 72.0 and 58.0 < quiet < loud - 3.0
    with Image.open(path) as film:
        assert getattr(film, "n_frames", 1) == 3
        assert film.size == (840, 386)
        film.seek(2)
        last = np.asarray(film.convert("RGB"), dtype=int)
    left, right = last[:264, :416], last[:264, 424:]
    assert left.std() > 20.0  # there is something to see, and not the same twice
    assert np.abs(left - right).mean() > 2.0


@pytest.mark.parametrize(("level", "height"), [(50.0, 0.0), (65.0, 0.5), (80.0, 1.0), (95.0, 1.0)])
def test_a_trace_stands_at_the_height_of_its_level(level, height):
    column = _drawn(level)[264:, 300]  # within the trace: red on light grey
    redness = column[:, 0] - column[:, 1]
    line = int(np.argmax(redness))
    assert line == pytest.approx(108 - height * 96, abs=1.5)


def test_a_figure_stays_for_a_fifth_of_a_second():
    levels = [60.0 + index for index in range(10)]
    clip = Clip(beta=0.0, pictures=[_BLACK] * 10, levels=levels, speed=0.5)
    figures = [np.asarray(panel(clip, index, "#ff0000"))[264:, :180] for index in range(10)]
    assert all((figure == figures[0]).all() for figure in figures[:5])
    assert (figures[5] != figures[4]).any()


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--out", "film.gif"], "--out must name a .webp file"),
        (["--out", "nowhere/film.webp"], "--out must name a .webp file in a folder that is there"),
        (["--seconds", "nan"], "--seconds must be from 0.04 to 60, got nan"),
    ],
)
def test_bad_arguments_are_told_in_one_line(words, complaint):
    with pytest.raises(MuteError, match=complaint):
        main(words)
