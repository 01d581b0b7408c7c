"""What quiet terms cost a landing is measured for each task, and weighs alike."""

import json

import pytest

from benchmarks.quiet_terms import main
from mute.support.errors import MuteError


def test_the_tasks_quiet_terms_cost_about_as_much_a_landing(tmp_path, capsys):
    out = tmp_path / "costs.json"
    assert main(["--robots", "8", "--seconds", "4", "--out", str(out)]) == 0
    rows = json.loads(out.read_text())["rows"]
    assert [row["task"] for row in rows] == [
        "go1_quiet_phase",
        "go1_quiet_landing_speed",
        "go1_quiet_landing_load",
        "go1_quiet_speed_change",
    ]
    assert "landing_load -57" in capsys.readouterr().out
    # The square of the landing speed is measured, and scaled to one speed: exact but for rounding.
    assert rows[1]["cost of a landing"] == pytest.approx(5.0, rel=1e-3)
    # Eight robots for four seconds know the others' to a third.
    assert all(row["cost of a landing"] == pytest.approx(5.0, rel=0.4) for row in rows)


@pytest.mark.parametrize(
    ("words", "message"),
    [(["--robots", "0"], "--robots must be"), (["--seconds", "0"], "--seconds must be")],
)
def test_a_bad_argument_is_told_by_name(words, message):
    with pytest.raises(MuteError, match=message):
        main(words)
