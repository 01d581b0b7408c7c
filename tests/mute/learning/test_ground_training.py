"""A training over ground of each robot's own: its levels are logged, saved and gone on from."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import torch
from learning_helpers import differences, everything, make_runner

from mute.envs.randomization import full_randomization
from mute.envs.terrain import BoxGround, TerrainCfg
from mute.learning.runner import MuteRunner

_LEVELS = {f"Ground/level_{name}" for name in ("rooms", "blocks", "stairs", "stairs_down")}


def _runner(directory: Path | None, iterations: int = 3) -> MuteRunner:
    # So near a goal that some rise, and so long that some are left behind.
    terrain = TerrainCfg(kind="indoor", first_levels=(1, 3), crossed=0.01)
    env: dict[str, Any] = {"terrain": terrain, "num_envs": 16, "episode_length": 0.16}
    return make_runner(directory, iterations, **env, randomization=full_randomization(0.06))


def _curves(directory: Path) -> list[dict[str, float]]:
    lines = map(json.loads, (directory / "curves.jsonl").read_text().splitlines())
    return [{k: v for k, v in one.items() if not k.startswith("Perf/")} for one in lines]


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> tuple[Path, dict[str, Any]]:
    """Three iterations at a stretch."""
    directory = tmp_path_factory.mktemp("whole")
    runner = _runner(directory)
    assert runner.train()
    return directory, everything(runner)


def test_the_mean_level_of_each_kind_is_logged_and_moves(whole):
    curves = _curves(whole[0])
    levels = [{name: line[name] for name in line if name.startswith("Ground/")} for line in curves]
    assert all(set(each) == _LEVELS for each in levels)
    assert all(0.0 <= value <= 4.0 for each in levels for value in each.values())
    assert levels[0] != levels[-1]


def test_a_training_over_ground_goes_on_bit_for_bit(whole, tmp_path):
    directory, expected = whole
    torch.manual_seed(12345)
    runner = _runner(tmp_path)
    runner.load(str(directory / "model_0.pt"))
    assert runner.train()
    assert differences(everything(runner), expected) == []
    assert _curves(tmp_path) == _curves(directory)[1:]


def test_a_forgotten_level_would_change_what_goes_on(whole, tmp_path):
    directory, expected = whole
    runner = _runner(tmp_path)
    runner.load(str(directory / "model_0.pt"))
    ground = runner.env.env.ground
    assert isinstance(ground, BoxGround)
    ground.level = (ground.level + 1) % 5
    runner.train()
    changed = differences(everything(runner), expected)
    assert any(place.startswith("/world/env/ground/level") for place in changed)
