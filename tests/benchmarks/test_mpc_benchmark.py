"""The benchmark of the model-predictive controller times each number of robots."""

import json

import pytest

from benchmarks.mpc import main
from mute.support.errors import MuteError


def test_every_number_of_robots_is_timed_and_kept(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("benchmarks.mpc._WARM_UP", 2)
    out = tmp_path / "speed.json"
    assert main(["--robots", "1", "3", "--steps", "4", "--out", str(out), "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content == json.loads(out.read_text())
    assert [row["robots"] for row in content["walks"]] == [1, 3]
    for row in content["walks"]:
        assert 0.0 < row["control step, median (ms)"] <= row["control step, 95 % (ms)"]
        # A walk takes longer than the controller in it.
        taken = 20.0 / row["times real time, with physics"]
        assert taken > row["control step, median (ms)"] / 2.0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--robots", "0"], "--robots must be an integer >= 1"),
        (["--steps", "0"], "--steps must be an integer >= 1"),
    ],
)
def test_a_bad_argument_is_told_by_name(words, message):
    with pytest.raises(MuteError, match=message):
        main(words)
