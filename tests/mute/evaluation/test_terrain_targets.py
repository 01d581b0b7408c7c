"""Targets over ground are asked of what was measured, at the worst speed."""

from __future__ import annotations

import math

from mute.evaluation.terrain_targets import terrain_targets


def _crossing(kind, level, success, speed=0.5):
    return {"kind": kind, "level": level, "speed": speed, "success": success}


def _met(tables):
    return {(figure.part, figure.name): figure.met for figure in terrain_targets(tables)}


def test_what_was_not_measured_and_what_has_no_target_is_not_judged():
    assert terrain_targets({}) == []
    assert _met({"crossings": [_crossing("stairs", 4, 0.0), _crossing("slopes", 0, 0.0)]}) == {}
    assert _met({"hardships": [{"hardship": "none", "survived": 0.0}]}) == {}


def test_each_kind_has_its_share():
    rows = [
        _crossing("flat", 2, 0.99),  # whose level does not matter
        _crossing("uneven", 3, 0.96),
        _crossing("blocks", 3, 0.95),
        _crossing("stairs", 1, 0.95),
        _crossing("stairs", 2, 0.89),
        _crossing("stairs_down", 3, 0.7),
    ]
    assert _met({"crossings": rows}) == {
        ("crossings", "flat: get across"): True,
        ("crossings", "uneven, level 3: get across"): False,
        ("crossings", "blocks, level 3: get across"): True,
        ("crossings", "stairs, level 1: get across"): True,
        ("crossings", "stairs, level 2: get across"): False,
        ("crossings", "stairs_down, level 3: get across"): True,
    }


def test_the_worst_speed_counts_and_what_was_not_to_be_had_does_not_do():
    rows = [_crossing("flat", 0, share, speed) for share, speed in ((1.0, 0.3), (0.9, 0.8))]
    [figure] = terrain_targets({"crossings": rows})
    assert (figure.value, figure.met) == (0.9, False)
    [figure] = terrain_targets({"crossings": [*rows, _crossing("flat", 0, math.nan)]})
    assert math.isnan(figure.value) and not figure.met


def test_hardships_pushes_and_the_walk_have_theirs():
    tables = {
        "hardships": [{"hardship": "friction of 0.3", "survived": 0.94}],
        "pushes": [{"largest": 1.0}],
        "walk": [{"minutes": 30.0, "survived": 0.95}],
    }
    assert _met(tables) == {
        ("hardships", "friction of 0.3: do not fall"): False,
        ("pushes", "largest push, mean"): True,
        ("walk", "30 min at random: do not fall"): True,
    }
