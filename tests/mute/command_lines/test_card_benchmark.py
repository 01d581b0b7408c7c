"""Tests of the page of speed: what it says of a file that the benchmark wrote."""

from __future__ import annotations

import json

import pytest
from places import REPOSITORY

from benchmarks.physics import VARIANTS
from mute.command_lines.benchmark_figures import PARTS, comparison, figures_of
from mute.command_lines.card_benchmark import BenchmarkFiles, benchmark_page

_SOUND = {
    "trials": 1,
    "seconds": 1.0,
    "floor": "wood",
    "machine": "a machine for sound",
    "parts": [{"name": "whole", "robots": 1, "wall": 1.0, "real_time": 1.0}],
    "table": 0.25,
    "memory_mb": 1.0,
    "memory_growth_mb": 0.0,
}
_PHYSICS = {
    "options": " --turns 6",
    "num_envs": 1024,
    "turns": 6,
    "machine": "a machine of physics",
    "mujoco": "4.0.0",
    "rates": [
        {"variant": "as it is", "speed": 1.0, "speed_low": 1.0, "speed_high": 1.0},
        {"variant": "with more", "speed": 0.5, "speed_low": 0.25, "speed_high": 0.75},
    ],
    "fidelity": [
        {"variant": "as it is", "beta": beta, "landing_speed": 0.01, "force_rms": beta / 10.0,
         "peak_force": 0.0, "work": -0.5}
        for beta in (0.0, 1.0)
    ],
    "touching": [{"shape": "foot", "policy": 1.0, "beginning": 0.25}],
}  # fmt: skip
_WALKING = {
    "machine": "a machine that learns",
    "stopped": None,
    "load_before": 0.75,
    "options": " --seeds 3 5",
    "definition": "minutes until it walks",
    "commits": {"new": "a" * 40, "old": "b" * 40 + "-dirty"},
    "walking": [
        {"seed": 3, "version": "new", "minutes": 2.0, "iteration": 60},
        {"seed": 3, "version": "old", "minutes": 3.0, "iteration": 65},
        {"seed": 5, "version": "old", "minutes": None, "iteration": None},
        {"seed": 5, "version": "new", "minutes": 4.0, "iteration": 80},
    ],
    "median_old_over_new": 1.5,
    "neither_walks": 0,
}
_PEER_WALKS = {
    "machine": "a machine where peers learn",
    "limit_minutes": 9.0,
    "tried_every_minutes": 3.0,
    "peers": [
        {
            "name": "unilab",
            "task": "a task",
            "num_envs": 1024,
            "trials": [
                {"minutes": 3.04, "steps": 5000, "velocity_error_sq": 0.3, "fall_rate": 0.5,
                 "walks": False},
                {"minutes": 6.0, "steps": 10000, "velocity_error_sq": 0.04, "fall_rate": 0.0,
                 "walks": True},
            ],
        }
    ],
}  # fmt: skip
_PEER = {"version": "1.0", "num_envs": 8, "environment": 6000.0, "note": "steps something"}


def _version(commit: str, engine: str) -> dict[str, str]:
    return {"commit": commit, "engine": engine, "torch": "2.0", "python": "3.11"}


def _measured() -> dict:
    """Return what the benchmark writes of ten blocks in which the old one took twice as long."""
    new = {part: [[1.0]] * 5 + [[2.0]] * 5 for part in PARTS}
    old = {part: [[2.0]] * 5 + [[4.0]] * 5 for part in PARTS}
    memory = {"new": 500.0, "old": 1000.0}
    ready = {name: {"control_steps": 24000, "peak_memory_mb": memory[name]} for name in memory}
    row = {"num_envs": 1024, "blocks": 10, "turns": 30, "not_precise": None}
    row |= figures_of(new, ready["new"])
    row["old"] = figures_of(old, ready["old"])
    row["new_over_old"] = comparison({"new": new, "old": old}, memory)
    return {
        "machine": "a machine",
        "load_before": 0.25,
        "options": " --max-turns 18",
        "stopped": None,
        "parts": PARTS,
        "versions": {"new": _version("a" * 40, "one 2"), "old": _version("b" * 40, "two 1")},
        "rates": [row],
        "peers": [],
    }


def _page(measured: dict, walking: dict = _WALKING) -> str:
    peers = {
        "machine": "a machine of peers",
        "options": " --rollouts 6",
        "peers": [_PEER | {"name": "mjlab"}],
    }
    files = BenchmarkFiles(
        training=measured,
        peers=peers,
        sound=_SOUND,
        physics=_PHYSICS,
        walking=walking,
        peer_walks=_PEER_WALKS,
    )
    return benchmark_page(files)


def _lines(page: str) -> list[list[str]]:
    rows = (line for line in page.splitlines() if line.startswith("| 1024 |"))
    return [[cell.strip() for cell in row.strip("|").split("|")] for row in rows]


def test_there_is_a_line_for_each_version_and_one_that_compares_them():
    new, old, compared = _lines(_page(_measured()))
    assert new[:5] == ["1024", "new", "10", "30", "18,000 [12,000, 24,000]"]
    assert old[:5] == ["1024", "old", "10", "30", "9,000 [6,000, 12,000]"]
    assert compared[:5] == ["1024", "new / old", "10", "30", "2.00 [2.00, 2.00]"]
    assert new[-4:] == ["100% [100%, 100%]"] * 3 + ["500"]
    assert compared[-4:] == ["-", "-", "-", "0.50"]


def test_a_version_alone_is_not_compared():
    measured = _measured()
    del measured["versions"]["old"], measured["rates"][0]["old"]
    page = _page(measured)
    assert [line[1] for line in _lines(page)] == ["new"]
    assert "--max-turns 18 --out docs/benchmark.json" in page


def test_the_page_says_what_each_part_is_of_which_versions_and_on_what_machine():
    page = _page(_measured())
    for sentence in PARTS.values():
        assert sentence in page
    assert "New is commit aaaaaaaaaa with one 2" in page
    assert "Old is commit bbbbbbbbbb with two 1" in page
    assert "on a machine, with a load average of 0.2 from other work" in page


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda measured: measured["rates"][0].update(not_precise="10 turns are too few"),
         "At 1024, 10 turns are too few."),
        (lambda measured: measured.update(stopped="interrupted"),
         "The run was cut short: interrupted."),
    ],
)  # fmt: skip
def test_what_is_not_precise_or_not_whole_is_told(change, told):
    measured = _measured()
    assert told not in _page(measured)
    change(measured)
    assert told in _page(measured)


def test_the_page_says_what_an_interval_is_of_and_where_it_is_too_narrow():
    measured = _measured()
    page = _page(measured)
    assert "It is of block medians, as the turns of a block depend on each other" in page
    assert "which makes it slightly optimistic" in page
    del measured["rates"][0]["blocks"]
    earlier = _page(measured)
    assert "block medians" not in earlier
    assert "so it is too narrow" in earlier
    assert _lines(earlier)[0][:4] == ["1024", "new", "-", "30"]


def test_peers_stand_with_the_machine_that_each_was_timed_on():
    measured = _measured()
    assert "On a machine (`docs/benchmark.json`)" not in _page(measured)
    measured["peers"] = [_PEER | {"name": "gymnasium"}]
    page = _page(measured)
    assert "On a machine (`docs/benchmark.json`):\n\n| peer" in page
    assert "On a machine of peers (`docs/peers.json`):\n\n| peer" in page
    assert "| gymnasium | 1.0 | - | - | - | - | 8 | 6,000 | - | steps something |" in page


def test_what_the_physics_costs_stands_beside_what_it_changes():
    page = _page(_measured())
    assert (
        "| as it is | 1.00 | +1.0%, +1.0% | +0.0%, +10.0% | +0.0%, +0.0% | -50.0%, -50.0% |" in page
    )
    assert "| with more | 0.50 [0.25, 0.75] | - | - | - | - |" in page
    assert (
        "under that policy foot 100.0%; under random actions, as a training begins, foot 25.0%."
        in page
    )


def test_a_file_of_the_physics_that_was_cut_short_says_so(monkeypatch):
    assert "cut short" not in _page(_measured())
    monkeypatch.setitem(_PHYSICS, "stopped", "interrupted")
    assert "The run was cut short: interrupted." in _page(_measured())


def test_what_was_aimed_at_stands_beside_what_was_reached():
    section = _page(_measured()).partition("## What was aimed at")[2].partition("\n## ")[0]
    assert "| figure | aimed at | at 1024 robots |" in section
    assert "| engine, new / old | >= 1.2 | 2.00 [2.00, 2.00] |" in section
    assert "| whole loop / engine | >= 65% | 100% [100%, 100%] |" in section
    assert "| memory | < 1200 MB | 500 MB |" in section
    assert "median over seeds | >= 1.23 | 1.50 |" in section
    assert "at 1024 robots the engine takes 100% of an iteration and learning 100%" in section


def test_trials_of_peers_own_policies_stand_in_order():
    page = _page(_measured())
    assert "--peers unilab --peers-from DIR --minutes 9 --every 3" in page
    assert "| unilab | a task | 1024 | 3.0 | 5,000 | 0.300 | 50% | no |" in page
    assert "| unilab | a task | 1024 | 6.0 | 10,000 | 0.040 | 0% | yes |" in page


def test_how_soon_trainings_walk_stands_seed_by_seed_with_both_versions_beside_each_other():
    page = _page(_measured())
    assert "| seed | new: minutes | new: iterations | old: minutes | old: iterations |" in page
    assert "| 3 | 2.00 | 60 | 3.00 | 65 |" in page
    assert "| 5 | 4.00 | 80 | never | never |" in page
    assert "--until-walking --seeds 3 5 --against PYTHON:CHECKOUT" in page
    assert "New is commit aaaaaaaaaa. Old is commit bbbbbbbbbb (changed)." in page
    assert "takes 1.50 times as long" in page
    assert "left out" not in page


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"median_old_over_new": "never"}, "The old one never walks with most seeds"),
        ({"median_old_over_new": 0.0}, "The new one never walks with most seeds"),
        ({"neither_walks": 2}, "neither walks, left out: 2"),
        ({"stopped": "interrupted"}, "cut short: interrupted"),
    ],
)
def test_what_is_missing_of_the_walks_is_told(changes, says):
    assert says in _page(_measured(), _WALKING | changes)


def test_walks_of_one_version_alone_are_compared_with_nothing():
    rows = [row for row in _WALKING["walking"] if row["version"] == "new"]
    alone = {"commits": {"new": "a" * 40}, "walking": rows, "median_old_over_new": None}
    section = _page(_measured(), _WALKING | alone).partition("## From nothing")[2]
    section = section.partition("\n## ")[0]
    assert "| 5 | 4.00 | 80 |" in section
    assert "old" not in section.lower()


def test_the_committed_figures_are_of_the_variants_that_there_are():
    measured = json.loads((REPOSITORY / "docs" / "physics.json").read_text())
    assert [row["variant"] for row in measured["rates"]] == [each.name for each in VARIANTS]
