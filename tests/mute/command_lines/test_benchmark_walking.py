"""Tests of how soon a training walks, with programs that stand in for `train.py` and the rest."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import git
import pytest

from mute.command_lines import benchmark, benchmark_walking
from mute.command_lines.benchmark_turns import Version
from mute.command_lines.benchmark_walking import time_to_walk
from mute.support.errors import MuteError

_TRAIN = """
import os, pathlib, signal, sys, time
start = time.time()
options = dict(zip(sys.argv[1::1], sys.argv[2::1]))
here = pathlib.Path(__file__).parent
(here / "pid").write_text(str(os.getpid()))
assert options["--agent.save-interval"] == "5" and options["--task"] == "go1_mute"
run = pathlib.Path(options["--log-dir"]) / "go1_mute" / "walk"
run.mkdir(parents=True)
for iteration in range(0, 60, 5):
    path = run / f".{iteration}"
    path.write_text(options["--seed"])
    saved = start + 60.0 * iteration  # as if each iteration took a minute
    os.utime(path, (saved, saved))
    path.rename(run / f"model_{iteration}.pt")
"""
_WAITS = "while True: signal.pause()\n"
"""A training that goes on, until it is told to end."""

_EVALUATE = """
import json, pathlib, sys
options = dict(zip(sys.argv[2::2], sys.argv[3::2]))
assert sys.argv[1] == "progress"
here = pathlib.Path(__file__).parent
pid = (here / "pid").read_text()
state = pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
(checkpoint,) = pathlib.Path(options["--run"]).glob("model_*.pt")
iteration = int(checkpoint.stem[6:])
with (here / "seen").open("a") as seen:
    print(state, iteration, checkpoint.read_text(), file=seen)
row = {"iteration": iteration, "walks": iteration >= WALKS_AT}
(pathlib.Path(options["--out"]) / "progress.json").write_text(json.dumps({"checkpoints": [row]}))
"""


def _checkout(folder: Path, walks_at: int, train: str = _TRAIN + _WAITS) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / "train.py").write_text(train)
    (folder / "evaluate.py").write_text(_EVALUATE.replace("WALKS_AT", str(walks_at)))
    return folder


def _version(name: str, checkout: Path) -> Version:
    return Version(name, sys.executable, checkout)


def _is_there(pid: str) -> bool:
    try:
        os.kill(int(pid), 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="tells from /proc what is halted")
def test_a_training_is_halted_while_it_is_measured_and_ended_once_it_walks(tmp_path):
    checkout = _checkout(tmp_path / "new", walks_at=45)
    content: dict = {}
    time_to_walk([_version("new", checkout)], "go1_mute", [7], content)
    (row,) = content["walking"]
    assert (row["seed"], row["version"], row["iteration"]) == (7, "new", 45)
    # The 45th iteration was saved after 45 min by the training's clock; what is taken off it is the
    # halt for the 40th one's measurement, and what it adds is this program's start.
    assert row["minutes"] == pytest.approx(45.0, abs=2.0)
    assert (checkout / "seen").read_text().splitlines() == ["T 40 7", "T 45 7"]
    assert not _is_there((checkout / "pid").read_text())
    assert content["median_old_over_new"] is None


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="tells from /proc what is halted")
def test_versions_walk_in_turns_and_the_median_over_seeds_compares_them(tmp_path, capsys):
    versions = [
        _version("new", _checkout(tmp_path / "new", walks_at=0)),
        _version("old", _checkout(tmp_path / "old", walks_at=50)),
    ]
    repository = git.Repo.init(tmp_path / "old")
    repository.index.add(["train.py"])
    author = git.Actor("A", "a@example.org")
    commit = repository.index.commit("begin", author=author, committer=author).hexsha
    content: dict = {}
    time_to_walk(versions, "go1_mute", [0, 1], content)
    assert content["commits"] == {"new": "unknown", "old": commit}
    order = [(row["seed"], row["version"], row["iteration"]) for row in content["walking"]]
    assert order == [(0, "new", 40), (0, "old", 50), (1, "old", 50), (1, "new", 40)]
    assert content["median_old_over_new"] == pytest.approx(50.0 / 40.0, rel=0.1)
    assert capsys.readouterr().err.splitlines()[0] == "seed 0, new version"


def test_the_command_prints_the_trainings_and_their_median_and_writes_them(
    tmp_path, monkeypatch, capsys
):
    def walked(_versions, _task, seeds, content, _keep) -> None:
        content |= {"definition": "minutes to a walk", "median_old_over_new": 1.5}
        content["neither_walks"] = 2
        content["walking"] = [
            {"seed": seed, "version": "new", "minutes": None, "iteration": None} for seed in seeds
        ]

    monkeypatch.setattr(benchmark, "time_to_walk", walked)
    out = tmp_path / "walking.json"
    assert benchmark.main(["--until-walking", "--seeds", "3", "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "minutes to a walk" in printed
    assert "old / new, median over seeds: 1.50" in printed
    assert "seeds with which neither version walks, left out: 2" in printed
    content = json.loads(out.read_text())
    assert content["walking"][0]["seed"] == 3
    assert content["stopped"] is None


@pytest.mark.parametrize(
    ("old", "new", "median", "neither"),
    [
        ((3.0, 4.0), (2.0, 2.0), 1.75, 0),
        ((3.0, 4.0, 9.0), (2.0, 2.0, None), 1.5, 0),  # of 1.5, 2 and 0: new never walks
        ((3.0, 4.0, None), (2.0, 2.0, 2.0), 2.0, 0),  # of 1.5, 2 and never: old never walks
        ((3.0, None), (2.0, 2.0), 1.5, 0),  # between 1.5 and never
        ((None, None, 3.0), (2.0, 2.0, 2.0), "never", 0),
        ((9.0, 9.0, 4.0), (None, None, 2.0), 0.0, 0),
        ((3.0, None, None), (2.0, None, None), 1.5, 2),
        ((None,), (None,), None, 1),
    ],
)
def test_a_seed_with_which_a_version_never_walks_counts_against_it(old, new, median, neither):
    rows = [
        {"seed": seed, "version": version, "minutes": minutes}
        for version, walks in (("old", old), ("new", new))
        for seed, minutes in enumerate(walks)
    ]
    told = {"median_old_over_new": median, "neither_walks": neither}
    assert benchmark_walking._compared(rows) == told


def test_a_seed_that_only_one_version_has_trained_with_yet_compares_nothing():
    rows = [{"seed": 0, "version": "old", "minutes": 9.0}]
    told = {"median_old_over_new": None, "neither_walks": 0}
    assert benchmark_walking._compared(rows) == told


@pytest.mark.parametrize("interrupted_again", [None, "terminate", "send_signal", "wait"])
def test_a_halted_training_ends_with_whoever_is_interrupted_however_often(
    tmp_path, monkeypatch, interrupted_again
):
    checkout = _checkout(tmp_path / "new", 0)

    def interrupt_measuring(*_: object) -> bool:
        if interrupted_again is not None:
            usual = getattr(subprocess.Popen, interrupted_again)

            def interrupted(*arguments: object) -> None:
                monkeypatch.setattr(subprocess.Popen, interrupted_again, usual)
                usual(*arguments) if interrupted_again == "terminate" else None
                raise KeyboardInterrupt

            monkeypatch.setattr(subprocess.Popen, interrupted_again, interrupted)
        raise KeyboardInterrupt

    monkeypatch.setattr(benchmark_walking, "_walks", interrupt_measuring)
    with pytest.raises(KeyboardInterrupt):
        time_to_walk([_version("new", checkout)], "go1_mute", [0], {})
    assert not _is_there((checkout / "pid").read_text())


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="tells from /proc what is halted")
def test_a_training_that_ends_without_walking_has_no_time(tmp_path):
    checkout = _checkout(tmp_path / "new", walks_at=1000, train=_TRAIN)
    (checkout / "evaluate.py").write_text(
        "import sys; open(sys.argv[5] + '/progress.json', 'w').write('{\"checkpoints\": []}')"
    )
    content: dict = {}
    time_to_walk([_version("new", checkout)], "go1_mute", [0], content)
    assert content["walking"] == [{"seed": 0, "version": "new", "minutes": None, "iteration": None}]


@pytest.mark.parametrize(
    ("train", "evaluate", "told"),
    [
        (
            "raise SystemExit('error: no such task')",
            "",
            "train.py of the new version ended with status 1: error: no such task",
        ),
        (
            _TRAIN + _WAITS,
            "raise SystemExit('error: bad file')",
            "evaluate.py progress of the new version: error: bad file",
        ),
    ],
)
def test_a_program_that_fails_is_told_in_one_line(tmp_path, train, evaluate, told):
    checkout = _checkout(tmp_path / "new", 0, train)
    (checkout / "evaluate.py").write_text(evaluate)
    with pytest.raises(MuteError) as caught:
        time_to_walk([_version("new", checkout)], "go1_mute", [0], {})
    assert str(caught.value) == told
    if (checkout / "pid").exists():  # a training that was halted when its measurement failed
        assert not _is_there((checkout / "pid").read_text())


def test_a_version_without_a_checkout_is_refused(tmp_path):
    for version in (Version("old", sys.executable, None), _version("old", tmp_path)):
        with pytest.raises(MuteError, match="needs a checkout of the old version"):
            time_to_walk([version], "go1_mute", [0], {})


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="tells from /proc what is halted")
def test_every_training_is_kept_as_it_ends(tmp_path):
    version = _version("new", _checkout(tmp_path / "new", walks_at=0))
    content: dict = {}
    kept: list[int] = []
    time_to_walk(
        [version], "go1_mute", [0, 1], content, lambda: kept.append(len(content["walking"]))
    )
    assert kept == [1, 2]
