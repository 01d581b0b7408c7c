"""`train.py` really run: what it writes, and how it refuses bad input."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from finished_run import (
    THREE_ITERATIONS,
    contents,
    curves,
    exit_status,
    is_one_line,
    tensorboard,
    train_tiny,
)
from places import REPOSITORY

from mute.checkpoint import load_checkpoint
from mute.command_lines import train
from mute.command_lines.train import main
from mute.config import from_plain
from mute.envs.rewards import reward_term
from mute.tasks import make_task

# -- a run ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def finished(tmp_path_factory) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """Three iterations, started from a shell."""
    log_dir = tmp_path_factory.mktemp("runs")
    command = [sys.executable, "train.py", *THREE_ITERATIONS, "--log-dir", str(log_dir)]
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    result = subprocess.run(
        command, cwd=REPOSITORY, env=environment, capture_output=True, text=True, timeout=180
    )
    return log_dir / "go1_mute" / "a", result


def test_a_run_ends_well_and_says_where_it_saved(finished):
    run, result = finished
    assert result.returncode == 0, result.stderr
    assert str(run / "model_2.pt") in result.stderr
    assert "Traceback" not in result.stderr


def test_plain_output_is_one_line_an_iteration(finished):
    lines = finished[1].stdout.splitlines()
    assert [line.split(" | ")[0] for line in lines] == ["1/3", "2/3", "3/3"]
    for words in ("steps/s", "tracking error", "landing speed, beta < 0.25", "left"):
        assert words in lines[-1]


def test_it_leaves_parameters_curves_and_checkpoints(finished):
    run, _ = finished
    names = {path.name for path in run.glob("*.*")}
    assert {"config.yaml", "curves.jsonl", "model_0.pt", "model_2.pt"} <= names
    assert "model_1.pt" not in names
    assert sum(name.startswith("events.out.tfevents") for name in names) == 1
    assert not any(name.endswith(".tmp") for name in names)


def test_options_arrive_in_the_written_parameters_from_which_the_run_is_re_made(finished):
    run, _ = finished
    written = yaml.safe_load((run / "config.yaml").read_text())
    assert written["command"].startswith("python train.py --plain --task go1_mute")
    assert written["task"] == "go1_mute"
    expected = make_task("go1_mute")
    expected.env.num_envs, expected.env.seed = 32, 5
    expected.env.rewards.k, expected.env.rewards.quiet_ramp = 0.3, (0.0, 1.0)
    expected.agent.iterations, expected.agent.save_interval = 3, 2
    expected.agent.noise_interval = 2
    expected.agent.estimation.network.lstm_hidden = 24
    assert from_plain({name: written[name] for name in ("env", "agent")}) == expected
    assert from_plain(load_checkpoint(run / "model_2.pt")["config"]) == expected


def test_tensorboard_has_every_reward_term_loss_estimator_error_and_landing_speed(finished):
    run, _ = finished
    rewards = make_task("go1_mute").env.rewards
    errors = ("total", "estimation", "forward", "phase", "velocity_rmse", "height_rmse")
    expected = {
        *(f"Reward/{name}" for name in rewards.terms),
        *(f"Loss/{name}" for name in ("value", "surrogate", "entropy", "learning_rate")),
        *(f"Loss/estimator_{name}" for name in (*errors, "phase_mae", "phase_closed")),
        "Gait/velocity_error_sq",
        "Gait/landing_speed_low_beta",
        "Gait/landing_speed_high_beta",
        "Noise/level_beta_0",
        "Noise/level_beta_1",
        "Perf/total_fps",
        "Curriculum/quiet",
    }
    events = tensorboard(run)
    assert expected <= set(events.Tags()["scalars"])
    assert [event.step for event in events.Scalars("Reward/lin_vel_tracking")] == [0, 1, 2]


def test_the_curves_file_says_the_same_as_tensorboard(finished):
    run, _ = finished
    lines, events = curves(run), tensorboard(run)
    assert [line["iteration"] for line in lines] == [0, 1, 2]
    for tag in events.Tags()["scalars"]:
        for event in events.Scalars(tag):
            assert lines[event.step][tag] == pytest.approx(event.value, rel=1e-6)


def test_the_quiet_terms_come_in_with_the_ramp(finished):
    lines = curves(finished[0])
    # 24 steps of 20 ms an iteration, a ramp of 1 s: means of 0.02 to 0.48, of 0.50 to 0.96 s.
    assert lines[0]["Curriculum/quiet"] == pytest.approx(0.25, abs=0.011)
    assert lines[1]["Curriculum/quiet"] == pytest.approx(0.73, abs=0.011)
    assert lines[2]["Reward/foot_drop_velocity"] < 0.0


def test_a_second_run_of_the_same_name_is_refused_and_changes_nothing(finished, capsys):
    run, _ = finished
    before = contents(run)
    assert train_tiny("--log-dir", str(run.parents[1]), "--run-name", "a", "--iterations", "1") == 2
    error = capsys.readouterr().err
    assert is_one_line(error)
    assert "--run-name" in error
    assert contents(run) == before


# -- options --------------------------------------------------------------------------------------


def test_options_of_earlier_versions_are_still_understood():
    options = ["--agent.estimation.network.height-scale", "0.2", "--env.height-map.offset=0.28"]
    options += ["--env.rewards.landing-speed", "-3.5", "--env.rewards.tilt=-5.0"]
    options += ["--env.rewards.apex_target=0.05", "--env.rewards.desired-height", "0.28"]
    args, _ = train._arguments(options)
    assert (args.env.height_map.scale, args.env.height_map.offset) == (0.2, 0.28)
    terms = args.env.rewards.terms
    assert (terms["landing_speed"].weight, terms["tilt"].weight) == (-3.5, -5.0)
    assert terms["touchdown_apex"].params == {"target": 0.05}
    assert terms["base_height"].params == {"desired": 0.28}


def test_a_term_has_options_for_its_weight_and_its_parameters():
    prefix = "--env.rewards.terms.near-ground-drop"
    args, _ = train._arguments([f"{prefix}.weight", "-2.0", f"{prefix}.params.depth", "0.05"])
    expected = make_task("go1_mute")
    expected.env.rewards.terms["near_ground_drop"] = reward_term(
        "near_ground_drop", -2.0, depth=0.05
    )
    assert args.env == expected.env


def test_a_term_that_the_task_does_without_can_be_asked_for():
    options = ["--env.rewards.terms.smoothness.weight", "-0.01", "--env.rewards.tilt", "-1.0"]
    args, _ = train._arguments(["--task", "go1_mute_paper", *options])
    expected = make_task("go1_mute_paper")
    expected.env.rewards.terms |= {
        "smoothness": reward_term("smoothness", -0.01),
        "tilt": reward_term("orientation", -1.0, group="lift"),
    }
    assert args.env == expected.env


def test_help_tells_what_each_term_and_each_parameter_is(capsys):
    with pytest.raises(SystemExit) as stop:
        train._arguments(["--help"])
    assert not stop.value.code
    text = " ".join(capsys.readouterr().out.replace("│", " ").split())
    for words in (
        "--env.rewards.terms.landing-speed.weight FLOAT Penalise each landing by its speed squared",
        "--env.rewards.terms.near-ground-drop.params.depth FLOAT The height at which 1/e of it",
        "Group: guide. (default: 0.7)",
    ):
        assert words in text


# -- bad input -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--task", "go2"], ["--task", "'go2'", "go1_mute_paper"]),
        (["--task"], ["--task"]),
        (["--task", "mute_nowhere:walk"], ["--task", "no module 'mute_nowhere'"]),
        (["--task", "mute.tasks:walk"], ["--task", "'walk'", "go1_mute_paper"]),
        (["--num-envs", "-3"], ["num_envs", "-3"]),
        (["--num-envs", "0"], ["num_envs", "0"]),
        (["--num-envs", "many"], ["--num-envs", "many"]),
        (["--iterations", "0"], ["iterations", "0"]),
        (["--seed", "-1"], ["seed", "-1"]),
        (["--seed", "99999999999999999999"], ["seed", "99999999999999999999"]),
        (["--device", "tpu"], ["--device", "tpu"]),
        (["--resume", "nowhere/model_1.pt"], ["nowhere/model_1.pt"]),
        (["--resume", "."], ["directory"]),
        (["--resume", "latest"], ["no checkpoint"]),
        (["--run-name", "../up"], ["--run-name", "../up"]),
        (["--run-name", ".."], ["--run-name", "'..'"]),
        (["--run-name", "."], ["--run-name", "'.'"]),
        (["--run-name", "a\nb"], ["--run-name", r"'a\nb'"]),
        (["--bogus", "3"], ["--bogus"]),
        (["stray"], ["stray"]),
        (["--env.rewards.k", "1.5"], ["rewards.k", "1.5"]),
        (["--env.rewards.quiet-ramp", "2.0", "1.0"], ["quiet_ramp"]),
        (["--env.episode-length", "-1.0"], ["episode_length", "-1.0"]),
        (["--agent.ppo.num-mini-batches", "0"], ["num_mini_batches", "0"]),
        (["--agent.activation", "foo"], ["activation", "foo"]),
        (["--agent.init-std", "-1.0"], ["init_std", "-1.0"]),
        (["--env.height-map.spacing", "0.0"], ["height_map.spacing", ">= 0.01", "0.0"]),
        (["--env.rewards.landing-speed", "nan"], ["rewards.terms.landing_speed.weight", "nan"]),
        (
            ["--env.rewards.terms.foot-clearance.params.target", "0"],
            ["rewards.terms.foot_clearance.params.target", ">= 1e-06", "0.0"],
        ),
        (["--env.rewards.terms.landing.weight", "1"], ["--env.rewards.terms.landing.weight"]),
        (["--env.observations.noise-level", "inf"], ["observations.noise_level", "inf"]),
        (["--env.randomization.added-mass", "-6.0", "0.0"], ["added_mass", "-5.204", "-6.0"]),
        (["--env.randomization.push-velocity", "nan"], ["push_velocity", "nan"]),
        (["--agent.ppo.num-mini-batches", "25"], ["agent.ppo.num_mini_batches", "24", "25"]),
        (["--num-envs", "3"], ["agent.estimation.num_mini_batches", "robots_share or 1", "2"]),
    ],
    ids=lambda value: " ".join(value),
)
def test_bad_input_is_refused_in_one_line_before_anything_is_written(
    arguments, words, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    assert train_tiny("--log-dir", str(tmp_path / "runs"), *arguments) == 2
    captured = capsys.readouterr()
    assert is_one_line(captured.err), captured.err
    assert all(word in captured.err for word in words), captured.err
    assert captured.out == ""
    assert not (tmp_path / "runs").exists()


def test_what_the_world_refuses_is_told_in_one_line_and_leaves_nothing(
    tmp_path, capsys, monkeypatch
):
    def refuse(*args) -> None:
        raise ValueError("the world is not as asked")

    monkeypatch.setattr(train, "MuteRunner", refuse)
    assert train_tiny("--log-dir", str(tmp_path / "runs")) == 2
    assert capsys.readouterr().err == "error: the world is not as asked\n"
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(
    ("options", "warned"),
    [
        (("--env.num-threads", "3"), True),
        (("--env.num-threads", "2"), False),
        (("--env.num-threads", "0"), False),
        (("--env.num-threads", "3", "--env.engine", "warp"), False),  # it has no such threads
    ],
)
def test_more_threads_than_processors_are_taken_with_one_line_of_warning(
    options, warned, tmp_path, capsys, monkeypatch
):
    taken = []

    def stop(task, cfg, *args) -> None:
        taken.append(cfg.env.num_threads)
        raise ValueError("far enough")

    monkeypatch.setattr(train, "core_share", lambda: 2)
    monkeypatch.setattr(train, "MuteRunner", stop)
    assert train_tiny("--log-dir", str(tmp_path / "runs"), *options) == 2
    *lines, error = capsys.readouterr().err.splitlines()
    warnings = [line for line in lines if line.startswith("warning: --env.num-threads 3: ")]
    assert len(warnings) == warned
    assert error == "error: far enough"
    assert taken == [int(options[1])]


def test_a_log_directory_that_cannot_be_made_is_told_in_one_line(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert train_tiny("--log-dir", str(tmp_path / "file"), "--iterations", "1") == 2
    error = capsys.readouterr().err
    assert is_one_line(error)
    assert "--log-dir" in error


def test_help_is_no_mistake(capsys):
    assert exit_status(lambda: main(["--help"])) == 0
    assert "--num-envs" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("device", "options", "expected"),
    [
        ("cpu", [], 1024),
        ("cuda", [], 1024),  # whose physics is on the CPU all the same
        ("cuda", ["--task", "go1_mute_flat"], 4096),
        ("cuda", ["--task", "go1_mute_flat", "--num-envs", "7"], 7),
        ("cuda", ["--task", "go1_mute_flat", "--env.num-envs", "1024"], 1024),
    ],
)
def test_the_number_of_robots_suits_the_device_unless_it_is_given(
    monkeypatch, device, options, expected
):
    monkeypatch.setattr(train, "resolve_device", lambda _: device)
    args, _ = train._arguments(options)
    assert train._configuration(args).env.num_envs == expected
