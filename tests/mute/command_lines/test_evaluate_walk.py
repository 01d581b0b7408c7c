"""`evaluate.py walk` writes figures, track, map and sound, and refuses bad input by name."""

from __future__ import annotations

import csv
import dataclasses
import json
import wave

import numpy as np
import pytest
import yaml
from places import SHIPPED_POLICY

from mute.acoustics.origin import sound_origin
from mute.command_lines import evaluate
from mute.command_lines import evaluate_walk as walk
from mute.controllers import load_policy
from mute.evaluation.course.course import Course, FloorArea
from mute.support.errors import MuteError

POLICY = SHIPPED_POLICY
COURSE = Course(
    path=((0.0, 0.0), (1.0, 0.0), (1.0, 0.6)),
    floors=(
        FloorArea("carpet", (-1.0, -1.0), (0.7, 2.0)),
        FloorArea("tile", (0.7, -1.0), (3.0, 2.0)),
    ),
    speed=0.4,
)


def _write_course(directory, course):
    path = directory / "course.yaml"
    areas = [
        {"floor": area.floor, "low": list(area.low), "high": list(area.high)}
        for area in course.floors
    ]
    waypoints = [list(point) for point in course.path]
    path.write_text(yaml.safe_dump({"speed": course.speed, "path": waypoints, "floors": areas}))
    return path


def test_the_command_writes_figures_track_map_and_sound(tmp_path, capsys):
    course, out, wav = _write_course(tmp_path, COURSE), tmp_path / "out", tmp_path / "walk.wav"
    arguments = ["--course", course, "--out", out, "--wav", wav, "--beta", "0", "--trials", "2"]
    arguments.append("--nominal")
    assert evaluate.main(["walk", *map(str, arguments)]) == 0
    content = json.loads((out / "walk.json").read_text())
    assert content["end"] == "arrived"
    assert content["beta"] == 0.0
    assert content["iteration"] == load_policy(POLICY).iteration
    assert (content["trials"], content["arrived"], content["stopped"]) == (2, 2, False)
    levels = [content["mnl"], content["others"][0]["mnl"]]
    assert levels[0] != levels[1]
    assert content["mnl_mean"] == pytest.approx(np.mean(levels))
    assert content["mnl_std"] == pytest.approx(np.std(levels, ddof=1))
    assert len(content["others"]) == len(content["nominal"]) == 1
    assert content.items() >= sound_origin(POLICY).items()
    assert content["mnl"] < content["pnl"]
    with (out / "track.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["time", "x", "y", "floor", "level"]
    mean = np.mean([float(row["level"]) for row in rows])
    assert mean == pytest.approx(content["mnl"], abs=0.01)
    assert {path.name for path in out.glob("course_map.*")} == {"course_map.png", "course_map.svg"}
    with wave.open(str(wav)) as file:
        kept = file.getnframes() / file.getframerate()
    last = max(content["seconds"], content["others"][0]["seconds"])
    assert kept == pytest.approx(last - 1.0)
    shown = capsys.readouterr().out
    assert "arrived after 1.6 m" in shown
    assert "2 of 2 arrived: MNL" in shown
    assert shown.endswith(f"kept: {wav}\n")
    assert "modelled" in shown


def test_walks_that_were_walked_outlive_an_interrupt(tmp_path, monkeypatch):
    real = walk.follow_course
    # As where an interrupt came before the others had ended.
    monkeypatch.setattr(
        walk, "follow_course", lambda *words, **options: real(*words, **options)[:1]
    )
    short = dataclasses.replace(COURSE, path=((0.0, 0.0), (0.5, 0.0)))
    course = _write_course(tmp_path, short)
    with pytest.raises(KeyboardInterrupt):
        words = ["--trials", "2", "--nominal", "--out", str(tmp_path / "out")]
        evaluate.main(["walk", "--course", str(course), *words])
    content = json.loads((tmp_path / "out" / "walk.json").read_text())
    assert (content["trials"], content["stopped"]) == (1, True)
    assert content["others"] == content["nominal"] == []
    assert content["mnl_ci95"] is None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--beta", "1.5"], "--beta must be numbers in"),
        (["--beta", "nan"], "--beta must be numbers in"),
        (["--seed", "-1"], "--seed must be .*, got -1"),
        (["--course", "none.yaml"], "cannot read the course none.yaml"),
        (["--policy", "none.pt"], "none.pt"),
        (["--out", str(POLICY)], "cannot be made a directory: File exists"),
    ],
)
def test_a_bad_argument_is_told_before_anything_walks(arguments, message):
    with pytest.raises(MuteError, match=message):
        evaluate.main(["walk", *arguments])
