"""Whether what the paper found comes out, from rows that can be reckoned with by hand."""

from __future__ import annotations

from typing import Any

import pytest
from comparison_rows import floors, make_row

from mute.evaluation.comparison.verdicts import Verdict, verdicts


def test_verdicts_say_what_holds_and_what_does_not():
    rows = [
        *floors("MPC", 80.0, 76.0, 78.0),
        *floors("DreamWaQ", 74.0, 72.0, 79.0),
        *floors("MUTE, beta 0", 69.0, 68.0, 70.0),
        *floors("MUTE, beta 1", 66.0, 63.0, 67.5),
    ]
    sweep = [
        make_row("MUTE", mnl, beta=beta, command=0.8)
        for beta, mnl in ((0.0, 70.0), (0.5, 67.0), (1.0, 67.5))
    ]
    found = {one.claim: one for one in verdicts(rows, sweep, _walk(70.5))}
    order = "MPC > DreamWaQ > MUTE, beta 0 > MUTE, beta 1 on"
    assert found[f"{order} wood"].holds
    assert not found[f"{order} tile"].holds
    # Means of both baselines 77, 74 and 78.5, less 66, 63 and 67.5: 11 on each floor.
    headline = "beta 1 is 8 dBA under the mean of both baselines, asked for 0.5 m/s"
    assert found[headline].figure == "11.0 dBA, mean of the floors"
    assert found[headline].holds
    quieter = found["quieter at every step of beta, 0.8 m/s on wood"]
    assert quieter.figure == "1 of 2 steps, 70.0 to 67.5 dBA"
    assert not quieter.holds
    assert not found[_WALK].holds


_WALK = "the long walk ends, and is under 70 dBA"


def _walk(mnl: float | None, arrived: int = 16) -> dict[str, Any]:
    return {"mnl_mean": mnl, "arrived": arrived, "trials": 16}


@pytest.mark.parametrize(("mnl", "arrived", "holds"), [(69.0, 16, True), (69.0, 15, False)])
def test_a_walk_that_not_all_finish_is_no_quiet_walk(mnl, arrived, holds):
    (found,) = verdicts([], [], _walk(mnl, arrived))
    assert (found.claim, found.holds) == (_WALK, holds)
    assert found.figure == f"69.0 dBA, {arrived} of 16 arrived"


def test_nothing_is_said_of_what_was_not_measured():
    rows = [*floors("MUTE, beta 0", 69.0, 68.0, 70.0)]
    assert verdicts(rows, [], None) == []
    assert verdicts([], [], _walk(None)) == []


def _obedience(errors: tuple[float, float], falls: tuple[float, float]) -> Verdict:
    rows = [
        make_row(name, 70.0, surface, speed, velocity_error_sq=error + off, fall_rate=fell)
        for name, error, fell in zip(("DreamWaQ", "MUTE, beta 0"), errors, falls, strict=True)
        for surface, speed, off in (("wood", 0.5, -0.01), ("tile", 0.8, 0.01))
    ]
    rows.append(make_row("DreamWaQ", 70.0, "wood", 1.0, velocity_error_sq=9.0, fall_rate=1.0))
    claim = "DreamWaQ follows commands as MUTE, beta 0 does, error and falls within 10 %"
    return {one.claim: one for one in verdicts(rows, [], None)}[claim]


@pytest.mark.parametrize(
    ("errors", "falls", "holds"),
    [
        ((0.0218, 0.02), (0.021, 0.02), True),
        ((0.01, 0.02), (0.0, 0.0), True),
        ((0.0222, 0.02), (0.02, 0.02), False),
        ((0.02, 0.02), (0.0222, 0.02), False),
    ],
)
def test_dreamwaq_must_follow_commands_that_both_were_given_as_well_as_mute(errors, falls, holds):
    assert _obedience(errors, falls).holds == holds


def test_how_both_follow_commands_is_told_in_figures():
    found = _obedience((0.02, 0.03), (0.0125, 0.0))
    assert found.figure == "0.0200 against 0.0300 (m/s)², 1.2 against 0.0 % fell"


def test_who_falls_often_is_named_beside_its_level():
    rows = [*floors("MPC", 80.0, 76.0, 78.0), *floors("DreamWaQ", 74.0, 72.0, 70.0)]
    rows += floors("MUTE, beta 1", 66.0, 63.0, 67.5)
    rows[2]["fall_rate"], rows[4]["fall_rate"] = 0.15, 0.05
    found = {one.claim: one.figure for one in verdicts(rows, [], None)}
    order = "MPC > DreamWaQ > MUTE, beta 1 on"
    assert found[f"{order} tile"] == "78.0 > 70.0 > 67.5 dBA; 15 % of MPC's robots fell"
    assert found[f"{order} wood"] == "80.0 > 74.0 > 66.0 dBA"
    headline = found["beta 1 is 8 dBA under the mean of both baselines, asked for 0.5 m/s"]
    assert headline.endswith("mean of the floors; 15 % of MPC's robots fell")


def test_a_level_that_is_fitted_is_left_out_of_what_is_predicted():
    rows = [*floors("MPC", 80.0, 76.0, 78.0), *floors("DreamWaQ", 74.0, 72.0, 70.0)]
    rows += floors("MUTE, beta 0", 75.0, 68.0, 69.0)
    rows += floors("MUTE, beta 1", 66.0, 63.0, 67.5)
    fitted = ("MUTE, beta 0", "wood")
    found = {one.claim: one for one in verdicts(rows, [], None, fitted)}
    order = "MPC > DreamWaQ > MUTE, beta 1 on wood, without MUTE, beta 0, which is fitted there"
    assert found[order].holds
    assert found[order].figure == "80.0 > 74.0 > 66.0 dBA"
    assert "MPC > DreamWaQ > MUTE, beta 0 > MUTE, beta 1 on tile" in found
    headline = "beta 1 is 8 dBA under the mean of both baselines, asked for 0.5 m/s"
    assert found[headline].figure.endswith("mean of the floors")
    # Means of both baselines 74 and 74, less 63 and 67.5.
    (found,) = [
        one for one in verdicts(rows, [], None, ("DreamWaQ", "wood")) if one.claim == headline
    ]
    assert found.figure == "8.8 dBA, mean of carpet and tile"
