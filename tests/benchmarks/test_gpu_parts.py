"""Tests of the parts that are run on a GPU: how they begin, how they end, and what is kept."""

from __future__ import annotations

import fcntl
import json
import math
import os
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest
import torch
from places import REPOSITORY

from benchmarks import gpu, gpu_engines, gpu_rates
from benchmarks.gpu import Part, Stop, run_part
from mute.command_lines import train
from mute.command_lines.arguments import parse


def _part(source: str, limit: float = 60.0, name: str = "a part") -> Part:
    return Part(name, (sys.executable, "-c", source), limit, gpu._last_line)


def _said(source: str, limit: float = 60.0) -> dict:
    outcome = run_part(_part(source, limit), 60.0)
    return {name: outcome.get(name) for name in ("status", "message", "result")}


def test_a_part_that_fails_leaves_the_last_line_of_what_it_said():
    assert _said("raise SystemExit('CUDA out of memory')") == {
        "status": "failed",
        "message": "status 1: CUDA out of memory",
        "result": None,
    }


def test_a_part_that_prints_no_result_has_failed():
    assert _said("print('no figures')")["status"] == "failed"


def test_a_part_that_fails_keeps_the_result_that_it_had():
    said = _said("print('{\"worst\": 2.0}'); raise SystemExit(1)")
    assert (said["status"], said["result"]) == ("failed", {"worst": 2.0})


def test_half_a_line_that_a_part_was_saying_does_not_hide_the_line_before():
    said = _said("print('{\"rate\": 2.0}'); print('{\"ra', end=''); raise SystemExit(1)")
    assert said["result"] == {"rate": 2.0}


def _holding(held: Path, holds: Path) -> str:
    """Return a program whose child locks a file, says so by writing to a pipe, and never ends."""
    child = (
        "import fcntl, signal\n"
        f"held = open({str(held)!r}, 'w')\n"
        "fcntl.flock(held, fcntl.LOCK_EX)\n"
        f"open({str(holds)!r}, 'w').write('holds')\n"
        "signal.pause()"
    )
    return f"import subprocess, sys; subprocess.run([sys.executable, '-c', {child!r}])"


def _is_free(held: Path) -> bool:
    """Tell whether a file is unlocked, or soon will be: a killed child takes its time to be gone.

    However slow the machine is, only a child that goes on is waited for in vain.
    """
    with held.open("r+") as file:
        waiting = threading.Thread(target=fcntl.flock, args=(file, fcntl.LOCK_EX), daemon=True)
        waiting.start()
        waiting.join(60.0)
        return not waiting.is_alive()


class _Clock:
    """A clock that stands still until a file is there, and then is past every limit."""

    def __init__(self, holds: Path) -> None:
        self._holds = holds

    def monotonic(self) -> float:
        return 1000.0 if self._holds.exists() else 0.0


def test_a_part_that_takes_too_long_is_ended_with_all_that_it_started(tmp_path, monkeypatch):
    held, holds = tmp_path / "held", tmp_path / "holds"
    monkeypatch.setattr(gpu, "time", _Clock(holds))
    said = _said(_holding(held, holds))
    assert said["status"] == "timed out"
    assert re.fullmatch(r"ended after \d+ s", said["message"])
    assert _is_free(held)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_a_signal_ends_the_part_under_way_with_all_that_it_started(tmp_path, number):
    held, holds, out = tmp_path / "held", tmp_path / "holds", tmp_path / "gpu.json"
    os.mkfifo(holds)
    program = (
        "import sys\n"
        "from benchmarks import gpu\n"
        f"part = gpu.Part('first', (sys.executable, '-c', {_holding(held, holds)!r}), 60.0,"
        " gpu._last_line)\n"
        "second = gpu.Part('second', ('/nowhere',), 60.0, gpu._last_line)\n"
        "gpu._parts = lambda *_: [part, second]\n"
        f"sys.exit(gpu.main(['--out', {str(out)!r}]))\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", program], cwd=REPOSITORY, text=True, stderr=subprocess.PIPE
    )
    assert holds.read_text() == "holds"  # waits until the part holds the file
    process.send_signal(number)
    _, complaint = process.communicate()
    assert process.returncode == 128 + number
    name = signal.Signals(number).name
    assert complaint == f"error: stopped by {name}; written: {out}\n"
    content = json.loads(out.read_text())
    assert content["stopped"] == name
    assert list(content["parts"]) == ["first"]
    assert content["parts"]["first"]["status"] == "stopped"
    assert _is_free(held)


def test_a_signal_that_is_ignored_stays_so_and_others_act_again_afterwards(monkeypatch):
    actions = {signal.SIGHUP: signal.SIG_IGN, signal.SIGTERM: signal.SIG_DFL}
    for number, action in actions.items():
        monkeypatch.setitem(actions, number, signal.signal(number, action))
    try:
        stop = Stop()
        with stop.listening():
            assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
            signal.raise_signal(signal.SIGTERM)
        assert stop.asked == signal.SIGTERM
        assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    finally:
        for number, action in actions.items():
            signal.signal(number, action)


def test_a_part_for_which_no_time_is_left_is_not_begun():
    outcome = run_part(_part("print('{}')"), left=0.0)
    assert (outcome["status"], outcome["message"]) == ("not begun", "no time was left")


def test_a_part_that_fails_does_not_keep_others_from_running(tmp_path, monkeypatch, capsys):
    parts = [
        _part("raise SystemExit('broken')", name="a"),
        _part('print(\'{"rate": 1.0, "worst": [NaN, -Infinity]}\')', name="b"),
    ]
    monkeypatch.setattr(gpu, "_parts", lambda *_: parts)
    out = tmp_path / "gpu.json"
    assert gpu.main(["--out", str(out), "--dry-run-on-cpu"]) == 1
    content = json.loads(out.read_text(), parse_constant=pytest.fail)
    assert [content["parts"][name]["status"] for name in "ab"] == ["failed", "done"]
    # JSON has no number for what is none.
    assert content["parts"]["b"]["result"] == {"rate": 1.0, "worst": [None, None]}
    assert (content["stopped"], content["rehearsal_on_cpu"]) == (None, True)
    assert content["machine"]["versions"]["mujoco"]
    assert "a: failed status 1: broken" in capsys.readouterr().out


def test_a_file_that_cannot_be_written_is_told_in_one_line(tmp_path, capsys):
    assert gpu.main(["--out", str(tmp_path / "nowhere" / "gpu.json")]) == 2
    told = capsys.readouterr().err
    assert re.fullmatch(r"error: .*/nowhere/gpu.json.part: No such file or directory\n", told)


def _words(part: Part) -> list[str]:
    """Return the options of a part's program, which is a module."""
    python, option, module, *words = part.command
    assert (python, option) == (sys.executable, "-m")
    modules = {"over": "gpu_training"}
    name = part.name.split("_")[0]
    assert module == f"benchmarks.{modules.get(name, 'gpu_' + name)}"
    return words


@pytest.mark.parametrize(
    ("argv", "device", "robots", "sizes"),
    [([], "cuda", 4096, [4096, 16384]), (["--dry-run-on-cpu"], "cpu", 16, [8, 16])],
)
def test_every_part_is_asked_for_what_its_program_knows(
    tmp_path, monkeypatch, argv, device, robots, sizes
):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    argv = [*argv, "--peers-from", str(tmp_path)]
    engines, training, ground, *rates = gpu._parts(gpu._arguments(argv), tmp_path)
    assert parse(gpu_engines.GpuEnginesArgs, _words(engines), "").device == device
    args, _ = train._arguments(_words(training))
    assert (args.task, args.device, args.num_envs) == ("go1_mute_flat", device, robots)
    args, _ = train._arguments(_words(ground))
    assert (args.task, args.device) == ("go1_mute", device)
    asked = [parse(gpu_rates.GpuRatesArgs, _words(part), "") for part in rates]
    assert [each.num_envs for each in asked] == sizes
    assert {(each.device, each.peers_from) for each in asked} == {(device, tmp_path)}
    assert sum(part.limit for part in (engines, training, ground, *rates)) <= 600.0


def test_the_curves_of_a_training_tell_its_speed_and_its_last_reward(tmp_path):
    args = gpu._arguments(["--dry-run-on-cpu"])
    training = gpu._parts(args, tmp_path)[1]
    run = tmp_path / "training" / "go1_mute_flat" / "gpu"
    run.mkdir(parents=True)
    rows = [
        {"iteration": number, "Perf/total_fps": rate, "Train/mean_reward": reward}
        for number, (rate, reward) in enumerate([(1.0, 0.5), (10.0, 0.25), (30.0, math.nan),
                                                 (20.0, 1.5)])
    ]  # fmt: skip
    (run / "curves.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    told = {
        "num_envs": 16,
        "iterations_asked": 2,
        "iterations": 4,
        "steps_per_second": 30.0,
        "mean_reward": 1.5,
    }
    assert training.result("") == told  # of one that was ended
    assert training.result('a line\n{"peak_gpu_memory_mb": 7.0}\n') == told | {
        "peak_gpu_memory_mb": 7.0
    }
