"""What ends a training from outside costs no work: signals, closed pipes, a full disk."""

from __future__ import annotations

import contextlib
import errno
import os
import shlex
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import yaml
from finished_run import train_tiny
from places import REPOSITORY, SHIPPED_POLICY
from tensorboard.summary.writer.record_writer import RecordWriter
from training_process import TINY, start_training, stop_after

from mute.checkpoint import load_checkpoint
from mute.command_lines import train
from mute.learning.displays import PlainDisplay


def _at_iteration(monkeypatch: pytest.MonkeyPatch, asked: int, act: Callable[[], object]) -> None:
    """Do something in this process as it shows an iteration, of which the first is 0."""
    show = PlainDisplay.update

    def update(self: PlainDisplay, iteration: int, total: int, scalars: dict[str, float]) -> None:
        show(self, iteration, total, scalars)
        if iteration == asked:
            act()

    monkeypatch.setattr(PlainDisplay, "update", update)


# -- signals -------------------------------------------------------------------------------------


def test_a_closed_terminal_ends_a_training_saved(tmp_path):
    process = start_training("--iterations", "100000", "--log-dir", str(tmp_path))
    out, err = stop_after(process, 2, signal.SIGHUP)
    assert process.returncode == 128 + signal.SIGHUP, err
    (run,) = (tmp_path / "go1_mute").iterdir()
    path = run / f"model_{len(out.splitlines()) - 1}.pt"
    assert load_checkpoint(path)["iter"] == len(out.splitlines()) - 1
    assert f"interrupted, saved: {path}\n" in err
    assert "Traceback" not in err


def test_what_is_ignored_from_the_start_stays_so_and_another_signal_saves(tmp_path):
    previous = {number: signal.getsignal(number) for number in (signal.SIGHUP, signal.SIGINT)}
    try:
        for number in previous:
            signal.signal(number, signal.SIG_IGN)  # as `nohup train.py &` in a script
        process = start_training("--iterations", "100000", "--log-dir", str(tmp_path))
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
    assert process.stdout is not None
    process.stdout.readline()
    for number in previous:
        process.send_signal(number)
    # Two whole iterations later, it still learns.
    out, err = stop_after(process, 3, signal.SIGUSR1)
    assert process.returncode == 128 + signal.SIGUSR1, err
    (run,) = (tmp_path / "go1_mute").iterdir()
    assert (run / f"model_{len(out.splitlines())}.pt").exists()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGXCPU], ids=lambda each: each.name)
def test_before_a_training_begins_a_signal_ends_it_in_one_line(
    number, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr(train, "MuteRunner", lambda *args: signal.raise_signal(number))
    assert train_tiny("--log-dir", str(tmp_path / "runs")) == 128 + number
    assert capsys.readouterr().err == "interrupted\n"
    assert not (tmp_path / "runs").exists()


# -- the command that goes on --------------------------------------------------------------------


def test_the_hint_goes_on_as_a_shell_reads_it(tmp_path, capsys, monkeypatch):
    log_dir = tmp_path / "my runs, o'clock"
    _at_iteration(monkeypatch, 1, lambda: signal.raise_signal(signal.SIGTERM))
    assert train_tiny("--iterations", "3", "--log-dir", str(log_dir)) == 128 + signal.SIGTERM
    (hint,) = (
        line.removeprefix("go on with: ")
        for line in capsys.readouterr().err.splitlines()
        if line.startswith("go on with: ")
    )
    words = shlex.split(hint)
    assert words[:2] == ["python", "train.py"]
    assert train.main([*TINY, *words[2:]]) == 0
    assert load_checkpoint(Path(words[-1]).with_name("model_2.pt"))["iter"] == 2


# -- two runs in a second ------------------------------------------------------------------------


def test_two_runs_begun_in_the_same_second_are_both_kept(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(train.time, "strftime", lambda form: "2026-01-02_03-04-05")
    for seed in ("1", "2"):
        words = ("--iterations", "1", "--seed", seed, "--log-dir", str(tmp_path))
        assert train_tiny(*words) == 0
    said = capsys.readouterr().err
    for name, seed in (("2026-01-02_03-04-05", 1), ("2026-01-02_03-04-05-1", 2)):
        run = tmp_path / "go1_mute" / name
        assert f"saved: {run / 'model_0.pt'}\n" in said
        assert load_checkpoint(run / "model_0.pt")["config"]["env"]["seed"] == seed
        assert yaml.safe_load((run / "config.yaml").read_text())["env"]["seed"] == seed
        assert len(list(run.glob("events.*"))) == 1


# -- nobody reads --------------------------------------------------------------------------------


def test_a_training_goes_on_where_nobody_reads_its_lines(tmp_path):
    process = start_training("--iterations", "6", "--log-dir", str(tmp_path), "--run-name", "a")
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.readline()
    process.stdout.close()
    err = process.stderr.read()
    assert process.wait(timeout=120) == 0, err
    path = tmp_path / "go1_mute" / "a" / "model_5.pt"
    assert load_checkpoint(path)["iter"] == 5
    assert err.splitlines() == [f"run: {path.parent}", f"saved: {path}"]


def test_a_training_goes_on_where_nobody_reads_its_errors(tmp_path):
    words = ("--iterations", "4", "--log-dir", str(tmp_path), "--run-name", "a", "--no-plain")
    process = start_training(*words)  # the live display goes to the standard error
    assert process.stderr is not None
    process.stderr.readline()
    process.stderr.close()
    assert process.stdout is not None
    assert process.stdout.read() == ""
    assert process.wait(timeout=120) == 0
    assert load_checkpoint(tmp_path / "go1_mute" / "a" / "model_3.pt")["iter"] == 3


@contextlib.contextmanager
def _closed_pipe() -> Iterator[int]:
    reader, writer = os.pipe()
    os.close(reader)
    yield writer
    os.close(writer)


def _run(command: list[str], output: int) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *command],
        cwd=REPOSITORY,
        stdout=output,
        stderr=subprocess.PIPE,
        text=True,
        timeout=120,
    )


def test_figures_that_nobody_reads_end_quietly():
    with _closed_pipe() as output:
        run = _run(["play.py", "--json", "--seconds", "0.2"], output)
    assert run.returncode == 128 + signal.SIGPIPE
    assert "Traceback" not in run.stderr
    assert "ignored" not in run.stderr  # what the interpreter says of a pipe that it finds broken


def test_an_evaluation_writes_its_files_where_nobody_reads_its_tables(tmp_path):
    words = ["noise", "--surface", "wood", "--beta", "0", "--trials", "1", "--seconds", "1.2"]
    command = ["evaluate.py", *words, "--policy", str(SHIPPED_POLICY), "--out", str(tmp_path)]
    with _closed_pipe() as output:
        run = _run(command, output)
    assert run.returncode == 0
    assert "Traceback" not in run.stderr
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"noise.csv", "noise.json", "noise_about.json"}


# -- a full disk ---------------------------------------------------------------------------------


def _last_named(error: str) -> Path:
    """Return the checkpoint that a line of an error says to go on from."""
    assert error.startswith("error: ")
    assert error.count("\n") == 1
    assert "No space left on device; the last checkpoint is whole, go on with: " in error
    return Path(shlex.split(error.split("go on with: ")[1])[-1])


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """Return a disk of a few megabytes."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=8m", "tmpfs", str(disk)]
    try:
        made = subprocess.run(mount, capture_output=True)
    except FileNotFoundError:
        pytest.skip("there is no mount here")
    if made.returncode != 0:
        pytest.skip("mounting a disk takes root")
    yield disk
    subprocess.run(["umount", str(disk)], check=True)


def test_a_disk_that_fills_up_ends_a_training_in_one_line_that_names_the_last_checkpoint(
    small_disk,
):
    words = ("--iterations", "100000", "--agent.save-interval", "1", "--log-dir", str(small_disk))
    process = start_training(*words)
    _, err = process.communicate(timeout=240)
    assert process.returncode == 2, err
    told, error = err.splitlines(keepends=True)
    assert told.startswith("run: ")
    last = _last_named(error)
    (run,) = (small_disk / "go1_mute").iterdir()
    saved = {path: load_checkpoint(path)["iter"] for path in run.glob("model_*.pt")}
    assert last == max(saved, key=lambda path: saved[path])
    assert not list(run.glob("*.tmp"))


def test_a_checkpoint_that_finds_the_disk_full_is_told_with_the_one_before(
    tmp_path, capsys, monkeypatch
):
    replace = os.replace

    def replace_but_one(source: Path, target: Path) -> None:
        if Path(target).name == "model_2.pt":
            raise OSError(errno.ENOSPC, "No space left on device")
        replace(source, target)

    monkeypatch.setattr("mute.support.files.os.replace", replace_but_one)
    words = ("--iterations", "9", "--agent.save-interval", "1", "--log-dir", str(tmp_path))
    assert train_tiny(*words) == 2
    run_line, error = capsys.readouterr().err.splitlines(keepends=True)
    run = Path(run_line.split()[-1])
    assert _last_named(error) == run / "model_1.pt"
    assert f"cannot write checkpoint {run / 'model_2.pt'}: " in error
    assert {path.name for path in run.glob("model*")} == {"model_0.pt", "model_1.pt"}


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
@pytest.mark.parametrize("iterations", ["9", "4"], ids=["amid a run", "at its end"])
def test_curves_that_find_the_disk_full_cost_no_iteration(
    iterations, tmp_path, capsys, monkeypatch
):
    run = tmp_path / "go1_mute" / "a"

    def fill_up() -> None:
        (run / "curves.jsonl").unlink()
        (run / "curves.jsonl").symlink_to("/dev/full")

    _at_iteration(monkeypatch, 2, fill_up)
    words = ("--iterations", iterations, "--log-dir", str(tmp_path), "--run-name", "a")
    assert train_tiny(*words) == 2
    _, error = capsys.readouterr().err.splitlines(keepends=True)
    assert f"cannot write {run / 'curves.jsonl'}: " in error
    assert _last_named(error) == run / "model_3.pt"
    assert load_checkpoint(run / "model_3.pt")["iter"] == 3


@pytest.mark.filterwarnings("error::pytest.PytestUnhandledThreadExceptionWarning")
def test_what_tensorboard_cannot_write_costs_no_iteration(tmp_path, capsys, monkeypatch):
    def refuse(*arguments: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    _at_iteration(monkeypatch, 2, lambda: monkeypatch.setattr(RecordWriter, "write", refuse))
    words = ("--iterations", "99", "--log-dir", str(tmp_path), "--run-name", "a")
    assert train_tiny(*words) == 2
    out, err = capsys.readouterr()
    _, error = err.splitlines(keepends=True)
    run = tmp_path / "go1_mute" / "a"
    assert f"cannot write TensorBoard's curves in {run}: " in error
    learnt = len(out.splitlines()) - 1
    assert 3 <= learnt < 98
    assert _last_named(error) == run / f"model_{learnt}.pt"
    assert load_checkpoint(run / f"model_{learnt}.pt")["iter"] == learnt


def test_parameters_that_find_the_disk_full_leave_no_run(tmp_path, capsys, monkeypatch):
    def refuse(source: Path, target: Path) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("mute.support.files.os.replace", refuse)
    assert train_tiny("--log-dir", str(tmp_path), "--run-name", "a") == 2
    path = tmp_path / "go1_mute" / "a" / "config.yaml"
    assert capsys.readouterr().err == f"error: cannot write {path}: No space left on device\n"
    assert not path.parent.exists()
