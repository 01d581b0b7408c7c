"""One share is fitted to a level of the paper's, and says by what it was made."""

from __future__ import annotations

import hashlib
import json
import math
import shlex

import pytest
from places import FLAT_POLICY, REPOSITORY

from mute.acoustics.body import load_transmissibility
from mute.command_lines import calibrate as calibration
from mute.command_lines.calibrate import fit_share
from mute.controllers import load_policy
from mute.evaluation.paper_levels import PAPER_LEVELS
from mute.support.errors import MuteError


def test_the_share_is_the_one_that_reaches_the_target():
    share = fit_share(lambda share: 90.0 + 20.0 * math.log10(share), 63.9794)
    assert share == pytest.approx(0.05, rel=1e-3)


def test_a_level_that_other_sources_exceed_or_all_of_the_force_does_not_reach_is_refused():
    with pytest.raises(ValueError, match=r"gives 50 dB: it is 55\.0 without"):
        fit_share(lambda share: 10.0 * math.log10(10.0**5.5 + share**2), 50.0)
    with pytest.raises(ValueError, match=r"gives 70 dB: .* 60\.0 with all of the force"):
        fit_share(lambda share: 60.0 + 20.0 * math.log10(share), 70.0)


def test_a_calibration_reaches_the_papers_level_and_is_near_the_one_that_ships(tmp_path):
    out = tmp_path / "calibration.json"
    assert calibration.main(["--trials", "4", "--seconds", "2", "--out", str(out)]) == 0
    content = json.loads(out.read_text())
    mnl, _ = PAPER_LEVELS["mute beta 0"]["wood"]
    assert content["floor"] == "wood"
    assert content["target_mnl"] == mnl == pytest.approx(content["mnl"], abs=0.02)
    assert content["mnl"] < content["pnl"] < content["mnl"] + 8.0
    assert 0.0 < content["mnl_ci95"] < 2.0
    # Four robots for 2 s are not those that it was made of.
    ratio = load_transmissibility(out) / load_transmissibility()
    assert 20.0 * math.log10(ratio) == pytest.approx(0.0, abs=4.0)
    assert "--trials 4 --seconds 2 " in content["command"]
    assert content["policy"]["iteration"] == load_policy(FLAT_POLICY).iteration


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--seed", "-1"], "--seed"),
        (["--seed", "2147483648"], "--seed"),
        (["--seconds", "inf"], "--seconds"),
        (["--floor", "ice"], "--floor"),
        (["--trials", "200", "--seconds", "60"], "--trials 200 of --seconds 60"),
        (["--out", "resources"], "--out resources: must name a file"),
    ],
)
def test_a_bad_argument_of_the_calibration_is_refused_in_one_line(arguments, word, monkeypatch):
    monkeypatch.chdir(REPOSITORY)
    with pytest.raises(MuteError, match=word):
        calibration.main(arguments)


def test_a_calibration_says_by_which_command_and_policy_file_they_were_made():
    out = REPOSITORY / "some where" / "calibration.json"
    args = calibration.CalibrationArgs(out=out)
    origin = calibration.provenance(args, load_policy(FLAT_POLICY))
    assert shlex.split(origin["command"]) == [
        "python", "-m", "mute.acoustics.calibration", "--policy", "resources/go1/go1_mute_flat.pt",
        "--reference", "mute", "--floor", "wood", "--speed", "0.5", "--trials", "64",
        "--seconds", "3", "--seed", "1", "--out", "some where/calibration.json",
    ]  # fmt: skip
    assert origin["policy"]["sha256"] == hashlib.sha256(FLAT_POLICY.read_bytes()).hexdigest()
    assert origin["commit"]
