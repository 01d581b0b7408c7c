"""What the displays of a training say."""

from __future__ import annotations

import pytest

from mute.learning.displays import PlainDisplay


@pytest.mark.parametrize(("unstable", "invalid"), [(0.0, 0.0), (0.25, 0.0), (0.0, 3.0)])
def test_unstable_simulations_and_invalid_actions_are_shown_where_there_are_some(
    unstable, invalid, capsys
):
    curves = {"Episode/unstable": unstable, "Episode/invalid_actions": invalid}
    with PlainDisplay() as display:
        display.update(0, 2, {"Train/mean_reward": 1.0, **curves})
    line = capsys.readouterr().out
    assert "reward 1.00" in line
    assert ("unstable simulations a step 0.25" in line) == (unstable > 0.0)
    assert ("NaN or infinity for an action 3" in line) == (invalid > 0.0)
