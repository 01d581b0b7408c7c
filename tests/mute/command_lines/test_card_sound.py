"""What the model predicts is held to what the paper measured, row by row."""

from __future__ import annotations

import math

import pytest

from mute.command_lines.card_sound import predicted_and_measured
from mute.command_lines.card_tables import with_part
from mute.evaluation.paper_levels import PAPER_AT_08, PAPER_LEVELS
from mute.support.errors import MuteError


def _row(surface, beta, mnl_off, pnl_off, robots="different"):
    mnl, pnl = PAPER_LEVELS[f"mute beta {beta:g}"][surface]
    levels = {"mnl_mean": mnl + mnl_off, "pnl_mean": pnl + pnl_off}
    intervals = {"mnl_ci95": 0.1, "pnl_ci95": None}
    sources = {"laeq_impacts": mnl, "laeq_body": mnl - 10.0, "laeq_drive": mnl - 3.0}
    sources |= {"laeq_scuffing": None, "laeq_fan": mnl - 10.0}
    row = {"surface": surface, "beta": beta, "robots": robots, "trials": 64}
    return row | levels | intervals | sources


NOISE = [
    _row("wood", 0.0, 0.0, -2.0),
    _row("wood", 1.0, 3.0, 2.0),
    _row("tile", 0.0, -4.0, 2.0),
    _row("tile", 1.0, 5.0, -2.0),
    _row("tile", 1.0, 50.0, 50.0, "nominal"),
]
FAST = [
    {"beta": beta, "robots": "different", "mnl_mean": 70.0 + beta, "pnl_mean": 77.0 + beta}
    for beta in (0.0, 1.0)
]
WALK = {
    "beta": 0.0,
    "arrived": 7,
    "mnl_mean": 68.04,
    "mnl_ci95": 0.13,
    "pnl_mean": 75.0,
    "pnl_ci95": 0.4,
}


def _part(noise=NOISE, fast=FAST, walk=WALK, fitted=("mute beta 0", "wood")):
    return predicted_and_measured(noise, fast, walk, fitted)


def test_the_error_is_over_the_rows_that_were_not_fitted():
    assert f"over the 3 MNL that were not fitted: **{math.sqrt(50.0 / 3.0):.1f} dBA**" in _part()
    assert "over the 4 PNL: 2.0 dBA" in _part()
    # Of what is fitted to a method that there is no policy for, every row is predicted.
    assert f"over the 4 MNL that were not fitted: **{math.sqrt(50.0 / 4.0):.1f} dBA**" in _part(
        fitted=("dreamwaq", "wood")
    )
    assert "over the 4 MNL" in _part(fitted=None)


def test_every_row_of_the_paper_is_there_with_or_without_a_level():
    rows = [line for line in _part().splitlines() if line.startswith("| ")][1:]
    assert len(rows) == 1 + sum(map(len, PAPER_LEVELS.values()))  # a line below the captions
    assert sum("fitted" in row for row in rows) == 1
    part = _part(fitted=("mute beta 0", "tile"))
    assert "| tile |" in next(line for line in part.splitlines() if "fitted |" in line)
    (carpet,) = (row for row in rows if "mute beta 0 | carpet" in row)
    assert carpet == "| mute beta 0 | carpet | - | 67.4 | - | - | 74.4 | - |"
    (tile,) = (row for row in rows if "mute beta 0 | tile" in row)
    assert tile == "| mute beta 0 | tile | 66.7 ± 0.1 | 70.7 | -4.0 | 81.3 | 79.3 | +2.0 |"


def test_what_another_row_would_have_given_is_told():
    # All four rows have half of their sound from the robot: 3 dB less of all is 6 dB or so of it.
    part = _part()
    assert "tile at beta 0, +" in part
    assert "wood at beta 0, " not in part.split("had another row")[1]
    # Of a floor that alone is louder than what was measured no share is left.
    loud = [_row("wood", 0.0, 0.0, 0.0), _row("wood", 1.0, 0.0, 0.0), _row("tile", 0.0, 9.0, 0.0)]
    assert "tile at beta 0, which no share reaches" in _part(loud)
    # All rows off by as much are mended by one share: the rest is right, then.
    same = [_row(surface, beta, 1.0, 0.0) for surface in ("wood", "tile") for beta in (0.0, 1.0)]
    assert "wood at beta 1, -4 dB of share: 0.0 dBA" in _part(same)


def test_the_figures_at_0_8_are_told_as_means_and_as_peaks():
    loud, quiet = PAPER_AT_08[0.0], PAPER_AT_08[1.0]
    part = _part()
    means, peaks = (f"{a - loud:+.1f} and {b - quiet:+.1f}" for a, b in ((70, 71), (77, 78)))
    assert f"as means, the model's 70.0 and 71.0 are {means} dB from them" in part
    assert f"as peaks, the model's 77.0 and 78.0 are {peaks} dB from them" in part


def test_the_long_walk_is_told_with_its_interval_and_its_robots():
    assert "MNL of 68.0 ± 0.1 and a PNL of 75.0 ± 0.4 dBA over 7 robots" in _part()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"noise": [_row("wood", 0.0, 0.0, 0.0, "nominal")]}, "no row to predict"),
        ({"fast": FAST[:1]}, "must hold beta 0 and beta 1"),
    ],
)
def test_levels_that_lack_what_is_compared_are_refused(given, words):
    with pytest.raises(MuteError, match=words):
        _part(**given)


def test_a_part_takes_the_place_of_the_one_before():
    page = "# Sound\n\n<!-- levels -->\n\nold\n\n<!-- /levels -->\n\nafter\n"
    once = with_part(page, "levels", "new")
    assert once == "# Sound\n\n<!-- levels -->\n\nnew\n\n<!-- /levels -->\n\nafter\n"
    assert with_part(once, "levels", "new") == once
    with pytest.raises(MuteError, match="has no <!-- levels -->"):
        with_part("# Sound\n", "levels", "new")
