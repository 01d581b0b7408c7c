"""A training walks from the first checkpoint on that tracks and does not fall."""

from __future__ import annotations

import pytest

from mute.evaluation.progress import walks


@pytest.mark.parametrize(
    ("error", "falls", "walking"), [(0.049, 0.009, True), (0.05, 0.0, False), (0.0, 0.01, False)]
)
def test_a_walk_tracks_and_does_not_fall(error, falls, walking):
    assert walks(error, falls) is walking
