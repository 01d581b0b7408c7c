"""Tests of the peers of the benchmark: who they are, what they are asked, and what comes of it."""

from __future__ import annotations

import fcntl
import sys
import venv
from pathlib import Path

import numpy as np
import pytest
from peer_programs import peer_python
from peers.walking import WalkMeter

from mute.command_lines.benchmark_peers import (
    ITSELF,
    PEERS,
    Peer,
    PeerRate,
    peer_names,
    peer_pythons,
    time_peers,
)
from mute.tasks import FLAT_TASK


def _time(name: str, python: Path, own: Path, rounds: int = 1) -> PeerRate:
    return time_peers([name], {ITSELF: own, name: python}, 8, rounds, FLAT_TASK)[1]


@pytest.fixture
def own(tmp_path):
    """Return an interpreter that stands in for MUTE, and makes 100 control steps a second."""
    return peer_python(tmp_path, ITSELF, "dict(steps=100, seconds=1.0)")


def test_all_stands_for_every_peer_and_nothing_for_none():
    assert peer_names(("all",)) == ("gymnasium", "mjlab", "mujoco_playground", "unilab")
    assert peer_names(()) == ()


def test_a_folder_has_each_peer_by_its_name_and_one_that_is_named_counts_before_it(tmp_path):
    given = {"mjlab": None, "unilab": Path("/own/python")}
    assert peer_pythons(PEERS, tmp_path, given) == {
        "mute": Path(sys.executable),
        "gymnasium": Path(sys.executable),
        "mjlab": tmp_path / "mjlab" / "bin" / "python",
        "mujoco_playground": tmp_path / "mujoco_playground" / "bin" / "python",
        "unilab": Path("/own/python"),
    }
    assert set(peer_pythons(PEERS, None, {}).values()) == {Path(sys.executable)}


def test_mute_and_peers_are_asked_in_turns_back_and_forth(tmp_path, own):
    answers = "dict(steps=100, seconds=1.0)"
    pythons = {ITSELF: own} | {
        name: peer_python(tmp_path, name, answers) for name in ("mjlab", "unilab")
    }
    time_peers(["mjlab", "unilab"], pythons, 8, 1, FLAT_TASK)
    asked = (tmp_path / "asked").read_text().splitlines()
    there, back = ["mute", "mjlab", "unilab"], ["unilab", "mjlab", "mute"]
    assert asked == [
        f"{name} {part}" for part in ("environment", "loop") for name in (*there, *back)
    ]


def test_rates_are_medians_of_all_rounds_but_the_first(tmp_path, own):
    # Rounds of 10 (which compiles), 400, 100 and 200 control steps a second.
    python = peer_python(
        tmp_path,
        "mjlab",
        "dict(steps=[10, 800, 200, 400][number - 1], seconds=[1.0, 2.0][number > 1])",
    )
    rate = _time("mjlab", python, own, rounds=3)
    assert (rate.environment, rate.loop) == (200.0, 200.0)
    assert rate.over_mute == {"environment": 2.0, "loop": 2.0}
    assert rate.rounds == {"environment": 3, "loop": 3}
    assert rate.intervals["loop"] == [None, None]  # three rounds are too few
    assert (rate.engine, rate.robot, rate.physics_step) == ("an engine 2.0", "a robot", 0.005)
    assert rate.note == "a note"


def test_of_enough_rounds_the_interval_of_the_median_is_told(tmp_path, own):
    python = peer_python(tmp_path, "mjlab", "dict(steps=100 * number, seconds=1.0)")
    rate = _time("mjlab", python, own, rounds=6)
    # With six values it is from the smallest to the largest: 1/32 lies outside.
    assert (rate.environment, rate.intervals["environment"]) == (450.0, [200.0, 700.0])


def test_a_peer_without_a_learner_has_no_rate_of_a_loop_and_no_fault(tmp_path, own):
    answers = "dict(absent=part) if part == 'loop' else dict(steps=8, seconds=1.0)"
    rate = _time("gymnasium", peer_python(tmp_path, "gymnasium", answers), own)
    assert (rate.environment, rate.loop, rate.note) == (8.0, None, "a note")


def test_a_part_that_fails_is_told_and_the_other_one_is_timed(tmp_path, own):
    answers = "dict(error='no memory') if part == 'loop' else dict(steps=8, seconds=1.0)"
    rate = _time("mjlab", peer_python(tmp_path, "mjlab", answers), own)
    assert (rate.environment, rate.loop, rate.note) == (8.0, None, "a note; loop: no memory")


def test_a_peer_that_dies_is_told_once_and_keeps_what_it_had(tmp_path, own):
    answers = "dict(steps=8, seconds=1.0) if part == 'environment' else sys.exit('out of memory')"
    rate = _time("mjlab", peer_python(tmp_path, "mjlab", answers), own, rounds=2)
    assert rate.environment == 8.0
    assert rate.note == "a note; failed with status 1: out of memory"


@pytest.mark.parametrize(
    ("name", "package"),
    [("mjlab", "mjlab"), ("mujoco_playground", "playground"), ("unilab", "unilab")],
)
def test_a_peer_whose_package_is_missing_says_so(tmp_path, own, name, package):
    venv.create(tmp_path / "venv", symlinks=True)
    python = tmp_path / "venv" / "bin" / "python"
    assert _time(name, python, own) == PeerRate(
        name, note=f"{package} is not installed for {python}"
    )


def test_an_interrupt_while_a_peer_starts_leaves_nothing_running(tmp_path, monkeypatch):
    held = tmp_path / "held"
    python = tmp_path / "python"
    python.write_text(
        f"#!{sys.executable}\n"
        "import fcntl, signal\n"
        f"held = open({str(held)!r}, 'w')\n"
        "fcntl.flock(held, fcntl.LOCK_EX)\n"
        "print('never an answer, but a sign that it holds the file', flush=True)\n"
        "signal.pause()\n"
    )
    python.chmod(0o755)
    read = Peer._answer

    def interrupted(peer: Peer) -> dict:
        read(peer)
        raise KeyboardInterrupt

    monkeypatch.setattr(Peer, "_answer", interrupted)
    with pytest.raises(KeyboardInterrupt):
        time_peers(["mjlab"], {ITSELF: python}, 8, 1, FLAT_TASK)
    with held.open("r+") as free:
        fcntl.flock(free, fcntl.LOCK_EX | fcntl.LOCK_NB)


def test_what_is_known_is_told_after_every_round(tmp_path, own):
    told: list[tuple[float | None, float | None, int]] = []

    def after_round(rates) -> None:
        mjlab = rates[1]
        told.append((mjlab.environment, mjlab.loop, sum(mjlab.rounds.values())))

    python = peer_python(tmp_path, "mjlab", "dict(steps=100 * number, seconds=1.0)")
    pythons = {ITSELF: own, "mjlab": python}
    time_peers(["mjlab"], pythons, 8, 2, FLAT_TASK, after_round=after_round)
    # The first round of each part does not count.
    assert told == [
        (None, None, 0), (200.0, None, 1), (250.0, None, 2),
        (250.0, None, 2), (250.0, 200.0, 3), (250.0, 250.0, 4),
    ]  # fmt: skip


def test_an_interpreter_that_is_not_there_is_told(own):
    rate = _time("mjlab", Path("/nowhere/python"), own)
    assert rate == PeerRate(
        "mjlab", note="/nowhere/python does not start: No such file or directory"
    )


@pytest.mark.parametrize(
    ("script", "note"),
    [
        ("echo broken >&2; exit 3", "failed with status 3: broken"),
        ("exit 3", "failed with status 3: no message"),
        ("true", "failed with status 0: no message"),
        ("echo hello", "it printed 'hello' instead of an answer"),
        ("""echo '{"speed": 3}'""", "it said something that is not known"),
    ],
)
def test_a_peer_that_breaks_says_so(tmp_path, own, script, note):
    python = tmp_path / "python"
    python.write_text(f"#!/bin/sh\n{script}\n")
    python.chmod(0o755)
    assert _time("mjlab", python, own) == PeerRate("mjlab", note=note)


@pytest.fixture(scope="module")
def itself():
    """MUTE itself, as it is timed beside the peers."""
    peer = Peer(ITSELF, Path(sys.executable), 4, FLAT_TASK)
    yield peer
    peer.close()


def test_mute_trains_and_steps_as_many_robots_as_it_is_told(itself):
    assert itself.fault is None
    assert (itself.rate.robot, itself.rate.task, itself.rate.num_envs) == (
        "Unitree Go1", FLAT_TASK, 4,
    )  # fmt: skip
    assert (itself.rate.physics_step, itself.rate.decimation) == (0.005, 4)
    for _ in range(2):
        answer = itself.ask("loop")
        assert (answer["steps"], answer["seconds"] > 0.0) == (4 * 24, True)
    answer = itself.ask("environment")
    assert answer["steps"] % 4 == 0
    assert answer["seconds"] >= 1.0


def test_what_a_peer_does_not_have_and_what_fails_is_answered(itself):
    assert itself.ask("walk 4 1.0") == {"absent": "walk"}
    assert itself.ask("dance") == {"absent": "dance"}


def test_the_walk_of_a_peer_is_judged_as_that_of_mute():
    meter = WalkMeter(2, step_dt=0.5)
    command = np.array([[1.0, 0.0, 9.0], [0.5, 0.5, 9.0]])
    up, down = np.array([False, False]), np.array([False, True])
    meter.update(command, np.zeros((2, 3)), up)  # settles
    meter.update(command, np.zeros((2, 3)), up)  # settles
    meter.update(command, np.array([[0.9, 0.2, 0.0], [0.5, 0.5, 0.0]]), up)  # 0.05 and 0
    meter.update(command, np.array([[1.0, 0.0, 0.0], [7.0, 7.0, 0.0]]), down)  # 0; a new episode
    meter.update(command, np.array([[1.0, 0.4, 0.0], [7.0, 7.0, 0.0]]), up)  # 0.16; settles
    error, falls = meter.figures()
    assert error == pytest.approx((0.05 + 0.0 + 0.0 + 0.16) / 4)
    assert falls == 0.5
