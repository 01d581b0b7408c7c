"""Tests of when peers' policies walk, with peers that answer what is needed."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence

import pytest

from benchmarks import peer_walks
from benchmarks.peer_walks import PeerWalksArgs, train_until_walking
from mute.command_lines.benchmark_peers import PeerRate
from mute.support.errors import MuteError


class _Peer:
    """Answers with given iterations and trials, and notes what it was asked."""

    def __init__(self, seconds: Sequence[float], trials: Sequence[object] = ()) -> None:
        self.rate, self.fault = PeerRate("mjlab", version="1.0", num_envs=8, note="a note"), None
        self._seconds, self._trials = iter(seconds), iter(trials)
        self.asked: list[str] = []

    def ask(self, request: str) -> object:
        self.asked.append(request)
        if request == "loop":
            return {"steps": 1000, "seconds": next(self._seconds)}
        error, falls = _pair(self._trials)
        return {"velocity_error_sq": error, "fall_rate": falls}

    def close(self) -> None:
        pass


def _pair(trials: Iterator[object]) -> Sequence[float]:
    trial = next(trials)
    assert isinstance(trial, tuple)
    return trial


def _train(peer: _Peer, **args: float) -> peer_walks.PeerWalk:
    return train_until_walking(peer, PeerWalksArgs(**args))  # pyright: ignore[reportArgumentType]


def test_a_peer_ends_with_its_first_walk_and_the_time_that_it_had_trained():
    peer = _Peer([90.0] + [30.0] * 99, [(0.2, 0.0), (0.01, 0.5), (0.049, 0.0)])
    walk = _train(peer, every=1.0, minutes=30.0)
    # The first iteration compiles and counts as the second one: half a minute each.
    assert [trial.minutes for trial in walk.trials] == [1.0, 2.0, 3.0]
    assert [trial.walks for trial in walk.trials] == [False, False, True]
    row = walk.as_row()
    assert (row["walks"], row["minutes"], row["steps"]) == (True, 3.0, 6000)
    assert peer.asked.count("walk 128 10.0") == 3


def test_a_peer_that_never_walks_is_told_with_how_far_it_came():
    walk = _train(
        _Peer([60.0] * 9, [(0.5, 0.1), (0.3, 0.2), (float("nan"), 0.0)]), every=2.0, minutes=5.0
    )
    row = walk.as_row()
    assert [trial.minutes for trial in walk.trials] == [2.0, 4.0, 5.0]
    assert (row["walks"], row["minutes"], row["note"]) == (False, 5.0, "a note")


def test_a_peer_that_fails_keeps_its_trials_and_says_why():
    peer = _Peer([60.0] * 9, [(0.5, 0.1)])
    ask = peer.ask
    peer.ask = lambda request: {"error": "no memory"} if len(peer.asked) > 3 else ask(request)
    row = _train(peer, every=2.0, minutes=5.0).as_row()
    assert (row["minutes"], row["walks"], row["note"]) == (2.0, False, "no memory")


def test_every_trial_is_in_the_file_before_the_next_begins(tmp_path, monkeypatch):
    out = tmp_path / "walks.json"
    peer = _Peer([60.0] * 9, [(0.5, 0.1), (0.3, 0.2)])
    ask = peer.ask

    def interrupted(request: str) -> object:
        if peer.asked.count("walk 128 10.0") == 2:
            raise KeyboardInterrupt
        return ask(request)

    peer.ask = interrupted
    monkeypatch.setattr(peer_walks, "Peer", lambda *_: peer)
    argv = ["--peers", "mjlab", "--every", "1", "--out", str(out), "--json"]
    with pytest.raises(KeyboardInterrupt):
        peer_walks.main(argv)
    (row,) = json.loads(out.read_text())["peers"]
    assert [trial["velocity_error_sq"] for trial in row["trials"]] == [0.5, 0.3]


def test_a_peer_that_does_not_start_is_told_and_the_others_go_on(tmp_path, capsys):
    out = tmp_path / "walks.json"
    argv = ["--peers", "mjlab,unilab", "--peers-from", str(tmp_path), "--json", "--out", str(out)]
    assert peer_walks.main(argv) == 0
    content = json.loads(capsys.readouterr().out)
    assert json.loads(out.read_text()) == content
    assert (content["limit_minutes"], content["tried_every_minutes"]) == (30.0, 5.0)
    mjlab, unilab = content["peers"]
    assert mjlab["note"].startswith(f"{tmp_path}/mjlab/bin/python does not start: ")
    assert (unilab["name"], unilab["walks"], unilab["trials"]) == ("unilab", None, [])


@pytest.mark.parametrize(
    ("argv", "names"),
    [
        (["--peers", "gymnasium"], "--peers must name peers that learn, got 'gymnasium'"),
        (["--minutes", "0"], "--minutes"),
        (["--every", "-1"], "--every"),
        (["--num-envs", "0"], "--num-envs"),
        (["--trials", "0"], "--trials"),
    ],
)
def test_bad_input_is_refused_by_name(argv, names):
    with pytest.raises(MuteError, match=names):
        peer_walks.main(argv)
