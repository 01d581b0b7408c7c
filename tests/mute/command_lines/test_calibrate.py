"""Gains are fitted to the paper's levels, and say by what they were made."""

from __future__ import annotations

import hashlib
import json
import math
import shlex

import pytest
from places import REPOSITORY, SHIPPED_POLICY

from mute.acoustics.gains import load_gains
from mute.command_lines import calibrate as calibration
from mute.command_lines.calibrate import fit_gain
from mute.controllers import load_policy
from mute.evaluation.paper_levels import PAPER_LEVELS
from mute.support.errors import MuteError


def test_the_gain_is_the_one_that_reaches_the_target():
    assert fit_gain(lambda gain: 60.0 + 20.0 * math.log10(gain), 66.0206) == pytest.approx(
        2.0, rel=1e-3
    )


def test_a_level_that_other_sources_exceed_cannot_be_fitted():
    with pytest.raises(ValueError, match="no gain gives 50 dB"):
        fit_gain(lambda gain: 10.0 * math.log10(10.0**5.5 + gain**2), 50.0)


def test_a_calibration_reaches_the_papers_levels_and_is_near_the_one_that_ships(tmp_path):
    out = tmp_path / "gains.json"
    assert calibration.main(["--trials", "1", "--seconds", "2", "--out", str(out)]) == 0
    content, shipped = json.loads(out.read_text()), load_gains()
    for name, (mnl, _) in PAPER_LEVELS["mute beta 0"].items():
        row = content["floors"][name]
        assert row["target_mnl"] == mnl == pytest.approx(row["mnl"], abs=0.02)
        assert row["mnl"] < row["pnl"] < row["mnl"] + 8.0
    for name, gain in load_gains(out).items():  # one robot for 2 s is not five for 10 s
        assert 20.0 * math.log10(gain / shipped[name]) == pytest.approx(0.0, abs=1.0)
    assert "--trials 1 --seconds 2 " in content["command"]
    assert content["policy"]["iteration"] == load_policy(SHIPPED_POLICY).iteration


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--seed", "-1"], "--seed"),
        (["--seed", "2147483648"], "--seed"),
        (["--seconds", "inf"], "--seconds"),
        (["--out", "resources"], "--out resources: must name a file"),
    ],
)
def test_a_bad_argument_of_the_calibration_is_refused_in_one_line(arguments, word, monkeypatch):
    monkeypatch.chdir(REPOSITORY)
    with pytest.raises(MuteError, match=word):
        calibration.main(arguments)


def test_gains_say_by_which_command_and_policy_file_they_were_made():
    args = calibration.CalibrationArgs(seconds=3.0, out=REPOSITORY / "some where" / "gains.json")
    origin = calibration.provenance(args, load_policy(SHIPPED_POLICY))
    assert shlex.split(origin["command"]) == [
        "python", "-m", "mute.acoustics.calibration", "--policy", "resources/go1/go1_mute.pt",
        "--reference", "mute", "--speed", "0.5", "--trials", "5", "--seconds", "3", "--seed", "1",
        "--out", "some where/gains.json",
    ]  # fmt: skip
    assert origin["policy"]["sha256"] == hashlib.sha256(SHIPPED_POLICY.read_bytes()).hexdigest()
    assert origin["commit"]
