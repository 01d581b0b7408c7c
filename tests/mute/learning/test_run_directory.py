"""The directory of a run: one for each, also within a second; the command that goes on."""

from __future__ import annotations

import shlex
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from mute.learning.distributed import Ranks
from mute.learning.run_directory import (
    claim_run,
    give_up_run,
    last_saved,
    plan_run,
    program_name,
    resume_hint,
    started_command,
)
from mute.support.errors import MuteError


def test_runs_begun_in_the_same_second_get_directories_of_their_own(tmp_path):
    planned = plan_run(tmp_path / "task", "", "2026-01-02_03-04-05")
    with ThreadPoolExecutor(6) as pool:
        claimed = list(pool.map(lambda _: claim_run(planned, named=False), range(6)))
    names = {planned.name, *(f"{planned.name}-{number}" for number in range(1, 6))}
    assert (
        {path.name for path in claimed} == names == {path.name for path in planned.parent.iterdir()}
    )


def test_one_of_two_runs_that_are_given_the_same_name_is_refused(tmp_path):
    planned = [plan_run(tmp_path, "mine", "now") for _ in range(2)]
    assert claim_run(planned[0], named=True) == tmp_path / "mine"
    with pytest.raises(MuteError, match=r"mine holds a run already: choose another --run-name"):
        claim_run(planned[1], named=True)


def test_a_name_that_a_run_has_is_refused_with_a_path_that_a_shell_takes(tmp_path):
    run = tmp_path / "o'clock runs" / "mine"
    claim_run(run, named=True)
    with pytest.raises(MuteError) as caught:
        plan_run(run.parent, "mine", "now")
    assert shlex.split(str(caught.value).split("go on with ")[1]) == [
        "--resume",
        f"{run}/model_N.pt",
    ]


def test_a_directory_without_a_run_in_it_can_be_named(tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("")
    assert claim_run(plan_run(tmp_path, "mine", "now"), named=True) == tmp_path / "mine"


@pytest.mark.parametrize("named", [True, False])
def test_a_run_that_does_not_begin_leaves_no_directory(named, tmp_path):
    give_up_run(claim_run(tmp_path / "mine", named))
    assert list(tmp_path.iterdir()) == []


def test_a_run_that_does_not_begin_leaves_what_was_there(tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("")
    give_up_run(claim_run(tmp_path / "mine", named=True))
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["notes.txt"]


# -- the command that goes on --------------------------------------------------------------------


@pytest.mark.parametrize(
    ("ranks", "launcher"),
    [
        (Ranks(), "python"),
        (Ranks(0, 2, 0, 2), "torchrun --nproc-per-node=2"),
        (Ranks(0, 4, 0, 2), "torchrun --nnodes=2 --nproc-per-node=2"),
    ],
    ids=["alone", "two ranks", "two machines"],
)
def test_the_script_is_named_as_it_was_started(ranks, launcher):
    assert shlex.join(started_command(ranks, "train.py")) == f"{launcher} train.py"
    words = started_command(ranks, "../my tree/train.py")
    assert shlex.join(words) == f"{launcher} '../my tree/train.py'"


def test_an_installed_command_is_named_by_its_name_where_a_shell_finds_it(tmp_path, monkeypatch):
    command = tmp_path / "mute-train"
    command.write_text("#!/bin/sh\n")
    command.chmod(0o755)
    assert started_command(Ranks(), str(command)) == [str(command)]
    monkeypatch.setenv("PATH", str(tmp_path))
    assert started_command(Ranks(), str(command)) == ["mute-train"]
    words = ["torchrun", "--nproc-per-node=2", "--no-python", "mute-train"]
    assert started_command(Ranks(0, 2, 0, 2), str(command)) == words


def test_what_was_run_is_asked_of_the_process_only_for_its_own_arguments(monkeypatch):
    monkeypatch.setattr(sys, "argv", ["tools/train.py", "--plain"])
    assert program_name(None) == "tools/train.py"
    assert program_name(["--plain"]) == "train.py"


def test_the_hint_is_quoted_for_a_shell():
    path = Path("my runs/it's/$HOME/model_3.pt")
    hint = resume_hint(["python", "train.py"], "go1_mute", path)
    words = ["python", "train.py", "--task", "go1_mute", "--resume", str(path)]
    assert shlex.split(hint) == words


def test_the_last_checkpoint_of_a_run_is_named_with_the_command_that_goes_on(tmp_path):
    assert last_saved(tmp_path, ["mute-train"], "t") == "no checkpoint has been saved yet"
    for name in ("model_9.pt", "model_10.pt"):
        (tmp_path / name).touch()
    goes_on = f"mute-train --task t --resume {tmp_path}/model_10.pt"
    said = last_saved(tmp_path, ["mute-train"], "t")
    assert said == f"the last checkpoint is whole, go on with: {goes_on}"
