"""Tests of how every command names its policy."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from places import SHIPPED_POLICY

from mute.checkpoint import load_checkpoint, save_checkpoint
from mute.command_lines import calibrate, evaluate, export, play
from mute.command_lines.policy_options import DriverArgs, PolicyArgs
from mute.support.errors import MuteError

COMMANDS: dict[str, tuple[Callable[[Sequence[str]], int], list[str]]] = {
    "play": (play.main, []),
    "export": (export.main, []),
    "calibrate": (calibrate.main, []),
    "gait": (evaluate.main, ["gait"]),
    "noise": (evaluate.main, ["noise"]),
    "sweep-speed": (evaluate.main, ["sweep-speed"]),
    "sweep-beta": (evaluate.main, ["sweep-beta"]),
    "walk": (evaluate.main, ["walk"]),
}


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    """Make an older run of one task and a newer one of another."""
    saved = load_checkpoint(SHIPPED_POLICY)
    for age, task in enumerate(("go1_mute_paper", "go1_mute")):
        run = tmp_path / "runs" / task / "run"
        for iteration in (7, 10):
            content = saved | {"task": task, "iter": iteration}
            save_checkpoint(run / f"model_{iteration}.pt", content)
        os.utime(run, (1e9 - age, 1e9 - age))
    return tmp_path / "runs"


def test_latest_is_of_all_tasks_unless_one_is_named(runs: Path):
    args = PolicyArgs(policy=Path("latest"), log_dir=runs)
    assert args.with_policy_found().policy == runs / "go1_mute_paper" / "run" / "model_10.pt"
    args = dataclasses.replace(args, task="go1_mute")
    assert args.with_policy_found().policy == runs / "go1_mute" / "run" / "model_10.pt"


def test_the_policy_that_ships_is_meant_where_none_is_named():
    assert PolicyArgs().with_policy_found().policy == SHIPPED_POLICY
    assert PolicyArgs(task="go1_mute").with_policy_found().policy == SHIPPED_POLICY
    with pytest.raises(MuteError, match="no policy ships for task 'go1_mute_paper'"):
        PolicyArgs(task="go1_mute_paper").with_policy_found()


def test_a_policy_that_is_named_must_be_of_the_task_that_is_named(runs: Path):
    path = runs / "go1_mute_paper" / "run" / "model_7.pt"
    assert PolicyArgs(path).with_policy_found().policy == path
    assert PolicyArgs(path, "go1_mute_paper").with_policy_found().policy == path
    with pytest.raises(MuteError, match=r"model_7\.pt is of task 'go1_mute_paper', not 'go1_mute'"):
        PolicyArgs(path, "go1_mute").with_policy_found()


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_looks_for_the_latest_where_it_is_told(command: str, tmp_path: Path):
    main, words = COMMANDS[command]
    words = [*words, "--policy", "latest", "--log-dir", str(tmp_path)]
    with pytest.raises(MuteError, match=f"no checkpoint under {tmp_path}"):
        main(words)
    with pytest.raises(MuteError, match=r"must be one of .*go1_mute.*, got 'go2'"):
        main([*words, "--task", "go2"])


def test_the_latest_policy_is_the_one_that_is_exported(runs: Path, tmp_path: Path):
    out = tmp_path / "policy.onnx"
    export.main(["--policy", "latest", "--log-dir", str(runs), "--out", str(out)])
    assert out.stat().st_size > 100_000


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"policy": Path("x.pt")}, "--policy goes with --controller policy alone, got 'x.pt'"),
        ({"task": "go1_mute"}, "--task goes with --controller policy alone, got 'go1_mute'"),
    ],
)
def test_a_policy_named_for_a_controller_that_has_none_is_refused(given, message):
    with pytest.raises(MuteError, match=message):
        DriverArgs(controller="mpc", **given).with_driver_found()


def test_what_drives_is_the_policy_or_a_controller_and_is_told_apart_where_levels_rest_on_it():
    policy = DriverArgs().with_driver_found()
    exact = DriverArgs(controller="mpc_true_velocity")
    assert policy.driver().task == "go1_mute"
    assert exact.driver().task == "mpc_true_velocity"
    origins = [args.origin() for args in (policy, DriverArgs(controller="mpc"), exact)]
    assert [origin["policy"] for origin in origins[1:]] == ["mpc", "mpc_true_velocity"]
    assert len({origin["policy_sha256"] for origin in origins}) == 3
    assert {tuple(origin) for origin in origins} == {tuple(origins[0])}


def test_the_policy_that_is_measured_is_the_one_that_is_named_whatever_is_saved_meanwhile(
    runs: Path,
):
    args = DriverArgs(policy=Path("latest"), task="go1_mute", log_dir=runs).with_driver_found()
    newer = runs / "go1_mute" / "run" / "model_11.pt"
    save_checkpoint(newer, load_checkpoint(SHIPPED_POLICY) | {"iter": 11})
    assert args.driver().iteration == 10
    assert args.origin()["policy"].endswith("model_10.pt")
    assert args.driver_name.endswith("model_10.pt")


def test_an_export_that_is_asked_for_a_task_is_not_taken_for_a_damaged_checkpoint():
    with pytest.raises(
        MuteError, match=r"--task goes with checkpoints.* policy\.onnx is an export"
    ):
        DriverArgs(policy=Path("policy.onnx"), task="go1_mute").with_driver_found()
