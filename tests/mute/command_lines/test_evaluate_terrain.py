"""`evaluate.py terrain` measures what kinds and levels it is asked for, and keeps the figures."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from learning_helpers import make_runner

from mute.checkpoint import save_checkpoint
from mute.command_lines import evaluate, evaluate_terrain
from mute.config import to_plain
from mute.evaluation import endurance
from mute.evaluation.crossing import Crossing
from mute.evaluation.endurance import HARDSHIPS
from mute.evaluation.tables import read_json
from mute.learning.runner import policy_part
from mute.support.errors import MuteError


@pytest.fixture(scope="module")
def policy_path(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("policy") / "policy.pt"
    runner = make_runner()
    checkpoint = runner.alg.save() | {"task": "go1_mute", "iter": 0}
    save_checkpoint(path, policy_part(checkpoint | {"config": to_plain(runner.task_cfg)}))
    return path


def _words(policy_path: Path, out: Path, *more: str) -> list[str]:
    words = ["terrain", "--policy", str(policy_path), "--episodes", "2", "--seconds", "1.1"]
    parts = [] if "--parts" in more else ["--parts", "crossings"]
    return [*words, "--out", str(out), *parts, *more]


def test_each_kind_and_level_is_a_row_and_flat_ground_but_one(policy_path, tmp_path, capsys):
    words = _words(policy_path, tmp_path, "--kinds", "flat,stairs", "--levels", "1", "4", "--json")
    assert evaluate.main(words) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == read_json(tmp_path / "terrain.json")
    rows = printed["crossings"]
    assert [(row["kind"], row["level"]) for row in rows] == [
        ("flat", 1),
        ("stairs", 1),
        ("stairs", 4),
    ]
    for row in rows:
        assert row["episodes"] == 2
        assert 0.0 <= row["success"] <= 1.0
        assert 0.0 <= row["falls"] <= 1.0
        assert all(row[name] > 0.0 for name in ("velocity_rmse", "height_rmse", "height_rmse_mean"))
    assert {"policy_sha256", "trained_seed", "commit", "machine", "beta"} <= printed.keys()
    lines = (tmp_path / "terrain.csv").read_text().splitlines()
    assert len(lines) == 4
    assert lines[0].split(",") == list(rows[0])


def test_what_a_policy_bears_is_told_part_by_part(policy_path, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(endurance, "LONGEST_PUSHES", 2.0)
    monkeypatch.setattr(evaluate_terrain, "LONGEST_PUSHES", 2.0)
    monkeypatch.setattr(evaluate_terrain, "_TRACKING_MINUTES", 0.01)
    parts = "hardships,pushes,tracking,walk"
    words = _words(policy_path, tmp_path, "--parts", parts, "--walkers", "2")
    assert evaluate.main([*words, "--minutes", "0.02"]) == 0
    printed = capsys.readouterr().out
    content = read_json(tmp_path / "terrain.json")
    assert "crossings" not in content
    assert [row["hardship"] for row in content["hardships"]] == list(HARDSHIPS)
    assert all(row["hardship"] in printed for row in content["hardships"])
    assert content["pushes"][0]["robots"] == content["walk"][0]["robots"] == 2
    assert content["walk"][0]["minutes"] == 0.02
    assert [row["seed"] for row in content["tracking"]] == [1, 2, 3, 4, 5]
    assert {row["robots"] for row in content["tracking"]} == {1}
    assert content["options"].startswith(" --parts hardships pushes tracking walk --episodes 2 ")
    assert len(content["figures"]) == 6  # four hardships, pushes, and the walk
    assert " of 6 targets are met" in printed
    for part in ("hardships", "pushes", "tracking", "walk"):
        lines = (tmp_path / f"terrain_{part}.csv").read_text().splitlines()
        assert len(lines) == 1 + len(content[part])
        assert f"terrain_{part}.csv" in printed
    assert not (tmp_path / "terrain.csv").exists()


def _made_up(kind: str, level: int) -> Crossing:
    shares, errors = (1.0, 0.0, 0.9), (0.1, 0.02, 0.01, 0.01)
    return Crossing(kind, level, 0.5, 2, *shares, *errors, *[math.nan] * 4)


def test_every_speed_is_a_row(policy_path, tmp_path, capsys):
    words = _words(policy_path, tmp_path, "--kinds", "flat", "--speed", "0.3,0.6", "--json")
    assert evaluate.main(words) == 0
    rows = json.loads(capsys.readouterr().out)["crossings"]
    assert [row["speed"] for row in rows] == [0.3, 0.6]
    assert rows[0]["made"] != rows[1]["made"]


def test_what_an_interrupt_leaves_whole_is_written(policy_path, tmp_path, monkeypatch, capsys):
    measured = []

    def cross(policy, cfg, *_):
        if measured:
            raise KeyboardInterrupt
        measured.append(_made_up(cfg.terrain.kind, cfg.terrain.first_levels[0]))
        return measured[0]

    monkeypatch.setattr(evaluate_terrain, "cross", cross)
    assert evaluate.main(_words(policy_path, tmp_path, "--kinds", "stairs")) == 130
    captured = capsys.readouterr()
    assert "interrupted; measured: 1 of 5" in captured.err
    assert "2 episodes of 1.1 s" in captured.out
    (row,) = read_json(tmp_path / "terrain.json")["crossings"]
    assert (row["kind"], row["level"], row["phase_mae"]) == ("stairs", 0, None)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--kinds", "stairs,moon"], "--kinds must be of flat, slopes, .* got 'moon'"),
        (["--kinds", "rooms,rooms"], "--kinds must name each but once, got rooms again"),
        (["--parts", "crossings,tea"], "--parts must be of crossings, .* got 'tea'"),
        (["--walkers", "0"], "--walkers must be an integer >= 1 .* got 0"),
        (["--minutes", "0"], "--minutes must be > 0 .* got 0"),
        (["--kinds"], "--kinds must name at least one"),
        (["--levels", "5"], "--levels must be an integer >= 0 and <= 4, got 5"),
        (["--levels", "2", "2"], "--levels must name each but once"),
        (["--episodes", "0"], "--episodes must be an integer >= 1 .* got 0"),
        (["--seconds", "1"], "--seconds must be > 1 .* got 1"),
        (["--speed", "0"], "--speed must be > 0 .* got 0"),
        (["--speed", "0.5,0.5"], "--speed must name each but once"),
        (["--beta", "1.5"], "--beta must be .* got 1.5"),
        (["--seed", "-1"], "--seed must be .* got -1"),
        (["--policy", "missing.pt"], r"missing\.pt"),
    ],
)
def test_a_bad_argument_is_told_by_name(words, message, tmp_path):
    with pytest.raises(MuteError, match=message):
        evaluate.main(["terrain", "--out", str(tmp_path), *words])
    assert list(tmp_path.iterdir()) == []


def test_a_heading_is_held_unless_it_is_told_not_to(tmp_path, capsys):
    runner = make_runner()
    runner.task_cfg.agent.heading_gain = 50.0
    checkpoint = runner.alg.save() | {"task": "go1_mute", "iter": 0}
    path = tmp_path / "holds.pt"
    save_checkpoint(path, policy_part(checkpoint | {"config": to_plain(runner.task_cfg)}))
    made = []
    for more in ([], ["--no-heading-hold"]):
        words = _words(path, tmp_path, "--kinds", "flat", "--json", *more)
        assert evaluate.main(words) == 0
        printed = json.loads(capsys.readouterr().out)
        assert ("--no-heading-hold" in printed["options"].split()) == bool(more)
        made.append(printed["crossings"][0]["made"])
    assert made[0] != made[1]
