"""`evaluate.py gait` and `progress` write their figures, and refuse bad input by name."""

from __future__ import annotations

import json

import pytest
from learning_helpers import NUM_ENVS, NUM_STEPS, make_runner

from mute.checkpoint import save_checkpoint
from mute.command_lines import evaluate
from mute.config import to_plain
from mute.evaluation.tables import read_json
from mute.learning.runner import policy_part
from mute.support.errors import MuteError


@pytest.fixture(scope="module")
def policy_path(tmp_path_factory):
    path = tmp_path_factory.mktemp("policy") / "policy.pt"
    runner = make_runner()
    checkpoint = runner.alg.save() | {"task": "go1_mute", "iter": 0}
    save_checkpoint(path, policy_part(checkpoint | {"config": to_plain(runner.task_cfg)}))
    return path


def test_evaluate_gait_writes_its_figures(policy_path, tmp_path, capsys):
    arguments = ["gait", "--policy", str(policy_path), "--trials", "4", "--seconds", "1.2"]
    assert evaluate.main([*arguments, "--beta", "0", "1", "--out", str(tmp_path)]) == 0
    summary = json.loads((tmp_path / "gait.json").read_text())
    assert [row["beta"] for row in summary["range"]] == [0.0, 1.0]
    assert {"fall_rate", "velocity_error_sq", "phase_mae"} <= summary["range"][0].keys()
    assert {"landing_speed_mean", "apex_mean"} <= summary["at_speed"][1].keys()
    assert (tmp_path / "gait_range.csv").exists()
    assert "at an actual speed" in capsys.readouterr().out


def test_a_controller_without_an_estimator_is_measured_too(tmp_path, capsys):
    arguments = ["gait", "--controller", "mpc", "--trials", "4", "--seconds", "1.2"]
    assert evaluate.main([*arguments, "--beta", "0", "--out", str(tmp_path)]) == 0
    summary = json.loads((tmp_path / "gait.json").read_text())
    assert summary["policy"] == "mpc"
    assert summary["range"][0]["fall_rate"] == 0.0
    assert "phase_mae" not in summary["range"][0]
    assert "phase_mae" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        ([], "gait"),
        (["dance"], "dance"),
        (["gait", "--trials", "0"], "--trials"),
        (["gait", "--beta", "1.2"], "--beta"),
        (["gait", "--seconds", "0.5"], "--seconds"),
        (["gait", "--speed", "3"], "--speed"),
        (["gait", "--policy", "missing.pt"], "missing.pt"),
    ],
)
def test_evaluate_refuses_bad_input_by_name(arguments, names):
    with pytest.raises(MuteError, match=names):
        evaluate.main(arguments)


def test_progress_measures_the_checkpoints_of_a_run_in_their_order(tmp_path):
    runner = make_runner(tmp_path, iterations=2)
    runner.train()
    out = tmp_path / "figures"
    arguments = ["progress", "--run", str(tmp_path), "--trials", "2", "--seconds", "1.2"]
    assert evaluate.main([*arguments, "--out", str(out)]) == 0
    rows = read_json(out / "progress.json")["checkpoints"]
    assert [row["iteration"] for row in rows] == [0, 1]
    assert [row["steps"] for row in rows] == [NUM_ENVS * NUM_STEPS, 2 * NUM_ENVS * NUM_STEPS]
    assert 0.0 < rows[0]["minutes"] < rows[1]["minutes"]
    assert not any(row["walks"] for row in rows)  # nothing walks after two iterations


def test_progress_refuses_a_directory_without_checkpoints(tmp_path):
    with pytest.raises(MuteError, match="no checkpoint"):
        evaluate.main(["progress", "--run", str(tmp_path)])
