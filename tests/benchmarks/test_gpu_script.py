"""Tests of what measures MUTE on a GPU, as far as a CPU can show it."""

from __future__ import annotations

import fcntl
import json
import os
import subprocess
import sys

import pytest
from places import REPOSITORY

from benchmarks import gpu
from benchmarks.gpu import Part, run_part

_SCRIPT = REPOSITORY / "benchmarks" / "gpu.sh"


def _part(source: str, limit: float = 60.0) -> Part:
    return Part("a part", (sys.executable, "-c", source), limit, json.loads)


def _said(source: str, limit: float = 60.0) -> dict:
    outcome = run_part(_part(source, limit), 60.0)
    return {name: outcome.get(name) for name in ("status", "message", "result")}


@pytest.fixture(scope="module")
def rehearsal(tmp_path_factory):
    """Return what the script writes in its rehearsal, with a folder that has no mjlab."""
    folder = tmp_path_factory.mktemp("gpu")
    out = folder / "gpu.json"
    options = ["--python", sys.executable, "--out", str(out), "--peers-from", str(folder)]
    command = ["bash", str(_SCRIPT), *options, "--dry-run-on-cpu"]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    return json.loads(out.read_text())


def test_the_rehearsal_runs_every_part(rehearsal):
    assert rehearsal["rehearsal_on_cpu"]
    assert {name: part["status"] for name, part in rehearsal["parts"].items()} == dict.fromkeys(
        ("engines", "training", "rates_8", "rates_16"), "done"
    )
    assert all(part["limit_seconds"] >= 60.0 for part in rehearsal["parts"].values())
    assert rehearsal["machine"]["versions"]["mujoco"]


def test_the_rehearsal_holds_the_engines_to_each_other(rehearsal):
    engines = rehearsal["parts"]["engines"]["result"]
    assert (engines["device"], engines["num_envs"], engines["steps"]) == ("cpu", 8, 10)
    assert engines["within_tolerances"]
    assert engines["agreed"] >= engines["least_agreed"] > 0.0
    for name, tolerance in engines["tolerances"].items():
        # Engines in different precision never agree to the last bit.
        assert 0.0 < engines["differences"][name] <= tolerance


def test_the_rehearsal_trains_and_tells_speed_and_reward(rehearsal):
    training = rehearsal["parts"]["training"]["result"]
    assert (training["iterations"], training["num_envs"]) == (2, 16)
    assert training["steps_per_second"] > 0.0
    assert isinstance(training["mean_reward"], float)


def test_the_rehearsal_times_loops_and_says_that_mjlab_is_not_there(rehearsal):
    for number in (8, 16):
        rates = rehearsal["parts"][f"rates_{number}"]["result"]
        assert rates["mute"]["num_envs"] == number
        assert min(rates["mute"]["environment"], rates["mute"]["loop"]) > 0.0
        assert "does not start: No such file" in rates["mjlab"]["note"]


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


def test_a_part_that_takes_too_long_is_ended_with_all_that_it_started(tmp_path):
    held = tmp_path / "held"
    child = (
        "import fcntl, signal\n"
        f"held = open({str(held)!r}, 'w')\n"
        "fcntl.flock(held, fcntl.LOCK_EX)\n"
        "signal.pause()"
    )
    source = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {child!r}])"
    said = _said(source, limit=3.0)
    assert (said["status"], said["message"]) == ("timed out", "ended after 3 s")
    with held.open("w") as free:
        fcntl.flock(free, fcntl.LOCK_EX)  # it would wait for ever for a child that goes on


def test_a_part_for_which_no_time_is_left_is_not_begun():
    outcome = run_part(_part("print('{}')"), left=0.0)
    assert (outcome["status"], outcome["message"]) == ("not begun", "no time was left")


def test_a_part_that_fails_does_not_keep_others_from_running(tmp_path, monkeypatch, capsys):
    parts = [_part("raise SystemExit('broken')"), _part("print('{\"rate\": 1.0}')")]
    named = [
        Part(name, part.command, 60.0, json.loads) for name, part in zip("ab", parts, strict=True)
    ]
    monkeypatch.setattr(gpu, "_parts", lambda *_: named)
    out = tmp_path / "gpu.json"
    assert gpu.main(["--out", str(out), "--dry-run-on-cpu"]) == 1
    content = json.loads(out.read_text())["parts"]
    assert [content[name]["status"] for name in "ab"] == ["failed", "done"]
    assert content["b"]["result"] == {"rate": 1.0}
    assert "a: failed status 1: broken" in capsys.readouterr().out


def test_on_a_gpu_the_parts_are_those_that_were_asked_for_and_fit_in_ten_minutes(tmp_path):
    parts = {part.name: part for part in gpu._parts(gpu._arguments([]), tmp_path)}
    assert list(parts) == ["engines", "training", "rates_4096", "rates_16384"]
    assert sum(part.limit for part in parts.values()) <= 600.0
    training = " ".join(parts["training"].command)
    assert "--task go1_mute --device cuda --num-envs 4096 --iterations 60" in training


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--fast"], "error: unknown option --fast; "),
        (["--out"], "error: --out needs a value"),
    ],
)
def test_the_script_refuses_what_it_does_not_know_in_one_line(options, told):
    result = subprocess.run(["bash", str(_SCRIPT), *options], capture_output=True, text=True)
    assert result.returncode == 2
    assert result.stderr.startswith(told)
    assert result.stderr.count("\n") == 1


def test_where_packages_cannot_be_installed_the_file_says_so(tmp_path):
    wheels = tmp_path / "wheels"
    wheels.mkdir()
    out = tmp_path / "gpu.json"
    python = tmp_path / "venv" / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.write_text("#!/bin/sh\nexit 1\n")  # neither has MUTE nor can install it
    python.chmod(0o755)
    options = ["--out", str(out), "--wheels", str(wheels), "--venv", str(tmp_path / "venv")]
    (tmp_path / "python3.11").symlink_to(python)
    variables = os.environ | {"PATH": f"{tmp_path}{os.pathsep}{os.environ['PATH']}"}
    command = ["bash", str(_SCRIPT), *options]
    result = subprocess.run(command, capture_output=True, text=True, env=variables)
    assert result.returncode == 2
    reason = "the packages cannot be installed, or not in 300 s"
    assert json.loads(out.read_text()) == {"error": reason}
    assert result.stderr == f"error: {reason}\n"
