"""Tests of what is measured on a GPU, as far as a CPU can show it."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
import torch
from peer_programs import peer_python

from benchmarks import gpu_engines, gpu_memory, gpu_rates
from benchmarks.gpu_engines import judge, largest
from mute.command_lines.benchmark_peers import ITSELF


def test_the_engines_walk_the_same_on_the_cpu(capsys):
    assert gpu_engines.main(["--device", "cpu", "--num-envs", "8", "--steps", "10"]) == 0
    told = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert (told["device"], told["num_envs"], told["steps"]) == ("cpu", 8, 10)
    assert told["within_tolerances"]
    assert told["agreed"] >= told["least_agreed"] == 7 / 8
    for name, tolerance in told["tolerances"].items():
        # Engines in different precision never agree to the last bit.
        assert 0.0 < told["differences"][name] <= tolerance
    for name, tolerance in told["mean_tolerances"].items():
        assert 0.0 < told["mean_differences"][name] <= tolerance
    assert 0.25 < told["means"]["height"][0] < 0.35
    assert 0.0 < told["means"]["landing speed"][0] < 1.0


_WORST = dict.fromkeys(gpu_engines.TOLERANCES, 0.0)
_MEANS = {name: (1.0, 1.0) for name in gpu_engines.MEAN_TOLERANCES}


def _within(worst: dict | None = None, means: dict | None = None, agreed: int = 64) -> object:
    judged = judge(_WORST | (worst or {}), _MEANS | (means or {}), agreed, 64, 100)
    return judged["within_tolerances"]


@pytest.mark.parametrize("bad", [0.011, math.nan, math.inf])
def test_a_difference_that_is_too_large_or_no_number_is_not_within_tolerances(bad):
    assert _within({"qvel": 0.01})
    assert not _within({"qvel": bad})


@pytest.mark.parametrize("bad", [0.88, 1.12, math.nan, math.inf])
def test_a_mean_over_all_robots_that_differs_or_is_no_number_is_not_within_tolerances(bad):
    assert _within(means={"landing speed": (1.0, 1.09)})
    assert not _within(means={"landing speed": (1.0, bad)})


def test_robots_may_part_at_a_small_rate_and_no_faster():
    # 0.993 to the power of 100 is 0.495: 31.7 of 64.
    assert _within(agreed=32)
    assert not _within(agreed=31)
    assert judge(_WORST, _MEANS, 60, 64, 10)["within_tolerances"]  # 59.7 of them
    assert not judge(_WORST, _MEANS, 59, 64, 10)["within_tolerances"]
    assert not judge(_WORST, _MEANS, 0, 1, 10)["within_tolerances"]  # nothing was compared


def test_the_largest_difference_is_that_of_robots_that_agreed():
    difference = torch.tensor([[0.1, -0.3], [0.9, 0.0]])
    assert largest(difference, torch.tensor([True, False])) == pytest.approx(0.3)
    assert largest(difference, torch.tensor([False, False])) == 0.0


@pytest.mark.parametrize("bad", [math.nan, math.inf])
@pytest.mark.parametrize("robot", [0, 1])
def test_what_is_not_finite_counts_of_every_robot(bad, robot):
    difference = torch.zeros(2, 3)
    difference[robot, 1] = bad
    assert largest(difference, torch.tensor([True, False])) == math.inf


def _rates(folder: Path, monkeypatch, answers: str, *options: str) -> int:
    pythons = {
        ITSELF: peer_python(folder, ITSELF, answers),
        "mjlab": folder / "mjlab" / "bin" / "python",
    }
    monkeypatch.setattr(gpu_rates, "peer_pythons", lambda *_: pythons)
    return gpu_rates.main(["--num-envs", "8", "--rounds", "1", "--device", "cpu", *options])


def test_rates_are_told_after_every_round_and_mjlab_that_is_not_there(
    tmp_path, monkeypatch, capsys
):
    answers = "dict(steps=100 * number, seconds=1.0)"
    assert _rates(tmp_path, monkeypatch, answers, "--peers-from", str(tmp_path)) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    known = [(line["mute"]["environment"], line["mute"]["loop"]) for line in lines]
    # Of each part the first round does not count.
    assert known == [(None, None), (200.0, None), (200.0, None), (200.0, 200.0)]
    assert all("does not start: No such file" in line["mjlab"]["note"] for line in lines)


def test_without_a_rate_of_mute_itself_the_part_has_failed(tmp_path, monkeypatch, capsys):
    answers = "dict(error='no memory') if part == 'loop' else dict(steps=8, seconds=1.0)"
    assert _rates(tmp_path, monkeypatch, answers) == 1
    told = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert (told["mute"]["environment"], told["mute"]["loop"]) == (8.0, None)
    assert told["mute"]["note"].endswith("loop: no memory")
    assert told["mjlab"]["note"].startswith("not timed: ")


def test_memory_is_that_of_the_first_gpu_as_the_driver_tells_it(tmp_path, monkeypatch):
    program = tmp_path / "nvidia-smi"
    program.write_text('#!/bin/sh\necho "$1" >"$0.asked"\necho 512\necho 7\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    assert gpu_memory.memory_in_use() == 512.0
    assert (tmp_path / "nvidia-smi.asked").read_text() == "--query-gpu=memory.used\n"
    program.write_text("#!/bin/sh\necho '[N/A]'\n")
    assert gpu_memory.memory_in_use() is None
    program.write_text("#!/bin/sh\nexit 9\n")
    assert gpu_memory.memory_in_use() is None


def test_on_the_cpu_no_memory_of_a_gpu_is_taken():
    assert gpu_memory.peak_of_this_process("cpu") is None
