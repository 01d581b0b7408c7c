"""`train.py` really run: what it writes, how it stops, goes on, and refuses bad input."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import torch
import yaml
from earlier_versions import estimators_own_heights, flat_rewards
from places import REPOSITORY
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from training_process import TINY, start_training, stop_after

from mute.checkpoint import load_checkpoint, save_checkpoint
from mute.command_lines import train
from mute.command_lines.train import main
from mute.config import from_plain, to_plain
from mute.envs.menagerie import SceneError
from mute.envs.rewards import reward_term
from mute.learning.runner import MuteRunner, policy_part
from mute.support.errors import run_cli
from mute.support.files import DiskError
from mute.tasks import make_task


def _train(*arguments: str) -> int:
    """Run the command in this process and return its exit status."""
    with pytest.raises(SystemExit) as stop:
        run_cli(lambda: main([*TINY, *arguments]))
    assert isinstance(stop.value.code, int)
    return stop.value.code


def _curves(run: Path) -> list[dict[str, float]]:
    return [json.loads(line) for line in (run / "curves.jsonl").read_text().splitlines()]


def _tensorboard(run: Path) -> EventAccumulator:
    return EventAccumulator(str(run), size_guidance={"scalars": 0}).Reload()


def _is_one_line(text: str) -> bool:
    return text.startswith("error: ") and text.count("\n") == 1 and text.endswith("\n")


# -- a run ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def finished(tmp_path_factory) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """Three iterations, started from a shell."""
    log_dir = tmp_path_factory.mktemp("runs")
    command = [sys.executable, "train.py", "--plain", "--task", "go1_mute", "--num-envs", "32"]
    command += ["--iterations", "3", "--seed", "5", "--log-dir", str(log_dir), "--run-name", "a"]
    command += ["--env.rewards.k", "0.3", "--agent.estimation.network.lstm-hidden", "24"]
    command += ["--env.rewards.quiet-ramp", "0.0", "1.0", "--agent.save-interval", "2"]
    command += ["--agent.noise-interval", "2"]
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
    events = _tensorboard(run)
    assert expected <= set(events.Tags()["scalars"])
    assert [event.step for event in events.Scalars("Reward/lin_vel_tracking")] == [0, 1, 2]


def test_the_curves_file_says_the_same_as_tensorboard(finished):
    run, _ = finished
    curves, events = _curves(run), _tensorboard(run)
    assert [line["iteration"] for line in curves] == [0, 1, 2]
    for tag in events.Tags()["scalars"]:
        for event in events.Scalars(tag):
            assert curves[event.step][tag] == pytest.approx(event.value, rel=1e-6)


def test_the_quiet_terms_come_in_with_the_ramp(finished):
    curves = _curves(finished[0])
    # 24 steps of 20 ms an iteration, a ramp of 1 s: means of 0.02 to 0.48, of 0.50 to 0.96 s.
    assert curves[0]["Curriculum/quiet"] == pytest.approx(0.25, abs=0.011)
    assert curves[1]["Curriculum/quiet"] == pytest.approx(0.73, abs=0.011)
    assert curves[2]["Reward/foot_drop_velocity"] < 0.0


def test_a_second_run_of_the_same_name_is_refused_and_changes_nothing(finished, capsys):
    run, _ = finished
    before = {path: path.read_bytes() for path in run.glob("*.*")}
    assert _train("--log-dir", str(run.parents[1]), "--run-name", "a", "--iterations", "1") == 2
    error = capsys.readouterr().err
    assert _is_one_line(error)
    assert "--run-name" in error
    assert {path: path.read_bytes() for path in run.glob("*.*")} == before


# -- stopping and going on -----------------------------------------------------------------------


def test_ctrl_c_saves_says_where_and_the_run_goes_on_from_there(tmp_path, capsys):
    process = start_training(
        "--iterations", "100000", "--log-dir", str(tmp_path), "--run-name", "b"
    )
    out, err = stop_after(process, 2, signal.SIGINT)
    assert process.returncode == 130, err
    run = tmp_path / "go1_mute" / "b"
    last = len(out.splitlines()) - 1
    path = run / f"model_{last}.pt"
    assert path.exists()
    assert f"interrupted, saved: {path}" in err
    assert f"--resume {path}" in err
    assert "Traceback" not in err
    # Every curve is on the disk, the last iteration's too.
    assert _tensorboard(run).Scalars("Loss/value")[-1].step == last

    arguments = ["--resume", "latest", "--log-dir", str(tmp_path)]
    assert _train(*arguments, "--iterations", str(last + 3)) == 0
    assert (run / f"model_{last + 2}.pt").exists()
    assert [line["iteration"] for line in _curves(run)] == list(range(last + 3))
    steps = [event.step for event in _tensorboard(run).Scalars("Loss/value")]
    assert steps == list(range(last + 3))


def test_a_killed_run_leaves_whole_checkpoints_and_curves_that_go_on_without_repeating(tmp_path):
    process = start_training(
        "--iterations", "100000", "--agent.save-interval", "1", "--log-dir", str(tmp_path)
    )
    out, _ = stop_after(process, 4, signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL
    (run,) = (tmp_path / "go1_mute").iterdir()
    checkpoints = sorted(run.glob("model_*.pt"))
    # The line of an iteration is printed just before it is saved.
    assert len(checkpoints) >= len(out.splitlines()) - 1 >= 3
    for path in checkpoints:
        assert load_checkpoint(path)["iter"] == int(path.stem.removeprefix("model_"))
    for path in checkpoints[2:]:
        path.unlink()
    assert _train("--resume", str(run / "model_1.pt"), "--iterations", "4") == 0
    assert [line["iteration"] for line in _curves(run)] == [0, 1, 2, 3]
    steps = [event.step for event in _tensorboard(run).Scalars("Loss/value")]
    assert steps == [0, 1, 2, 3]


def test_a_resumed_run_keeps_the_options_it_was_started_with(finished, tmp_path):
    path = tmp_path / "go1_mute" / "moved" / "model_2.pt"
    save_checkpoint(path, load_checkpoint(finished[0] / "model_2.pt"))
    arguments = ["--plain", "--resume", str(path), "--iterations", "4"]
    assert main(arguments) == 0
    cfg = from_plain(load_checkpoint(path.with_name("model_3.pt"))["config"])
    assert (cfg.env.num_envs, cfg.env.seed, cfg.env.rewards.k) == (32, 5, 0.3)
    assert cfg.agent.iterations == 4


def test_a_resume_that_cannot_be_leaves_the_written_parameters_alone(finished, capsys):
    run, _ = finished
    before = (run / "config.yaml").read_text()
    path = str(run / "model_2.pt")
    for arguments in (["--iterations", "3"], ["--iterations", "9", "--num-envs", "16"]):
        with pytest.raises(SystemExit) as stop:
            run_cli(lambda given=arguments: main(["--plain", "--resume", path, *given]))
        assert stop.value.code == 2
        assert _is_one_line(capsys.readouterr().err)
    assert (run / "config.yaml").read_text() == before


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--seed", "6"], ["--seed 6", "its own seed 5"]),
        (["--env.seed", "6"], ["--seed 6", "its own seed 5"]),
        (["--run-name", "other"], ["--run-name other"]),
    ],
    ids=lambda value: " ".join(value),
)
def test_an_option_that_a_resumed_run_cannot_heed_is_refused(arguments, words, finished, capsys):
    path = str(finished[0] / "model_2.pt")
    with pytest.raises(SystemExit) as stop:
        run_cli(lambda: main(["--plain", "--resume", path, "--iterations", "9", *arguments]))
    assert stop.value.code == 2
    error = capsys.readouterr().err
    assert _is_one_line(error)
    assert all(word in error for word in words), error


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [
        ("--agent.activation", "relu", "agent.activation: a resumed run keeps 'elu', got 'relu'"),
        ("--agent.init-std", "0.5", "agent.init_std: a resumed run keeps 0.8, got 0.5"),
        ("--env.height-map.scale", "0.2", "env.height_map.scale: a resumed run keeps 0.1, got"),
        ("--env.scene.timestep", "0.004", "env.scene.timestep: a resumed run keeps 0.005, got"),
        ("--env.footfall.landing-window", "0.06", "env.footfall.landing_window: a resumed run"),
        ("--num-envs", "16", "env.num_envs: a resumed run keeps 32, got 16"),
        ("--env.randomization.friction", "0.3 0.9", "env.randomization.friction: a resumed run"),
    ],
)
def test_a_field_that_a_resumed_run_cannot_change_is_named_and_nothing_is_written(
    option, value, words, finished, capsys
):
    run, _ = finished
    before = {path: path.read_bytes() for path in run.glob("*.*")}
    arguments = ["--resume", str(run / "model_2.pt"), "--iterations", "9", option, *value.split()]
    with pytest.raises(SystemExit) as stop:
        run_cli(lambda: main(["--plain", *arguments]))
    assert stop.value.code == 2
    error = capsys.readouterr().err
    assert _is_one_line(error)
    assert "does not fit this configuration" in error
    assert words in error
    assert {path: path.read_bytes() for path in run.glob("*.*")} == before


def _resumable(finished, directory: Path) -> Path:
    """Copy a finished run, and return its last checkpoint."""
    shutil.copytree(finished[0], directory)
    return directory / "model_2.pt"


@pytest.mark.parametrize(
    ("options", "rate"),
    [([], None), (["1e-6"], 1e-6), (["1e-3"], 1e-3)],
    ids=["not given", "another", "the one of the start"],
)
def test_a_learning_rate_that_is_given_is_the_one_that_is_learnt_at(
    options, rate, finished, tmp_path, monkeypatch
):
    path = _resumable(finished, tmp_path / "run")
    content = load_checkpoint(path)
    content["optimizer_state_dict"]["param_groups"][0]["lr"] = 3e-4
    save_checkpoint(path, content)
    seen = []
    monkeypatch.setattr(
        MuteRunner, "train", lambda runner: seen.append(runner.alg.optimizer.param_groups[0]["lr"])
    )
    given = ["--agent.ppo.learning-rate", *options] if options else []
    main(["--plain", "--resume", str(path), "--iterations", "4", *given])
    assert seen == [rate or 3e-4]


def test_the_written_parameters_are_those_that_the_resumed_run_learns_with(finished, tmp_path):
    path = _resumable(finished, tmp_path / "run")
    options = ["--agent.ppo.learning-rate", "1e-6", "--agent.estimation.learning-rate=2e-6"]
    options += ["--agent.ppo.schedule", "fixed", "--env.episode-length", "9.0"]
    assert main(["--plain", "--resume", str(path), "--iterations", "4", *options]) == 0
    written = yaml.safe_load(path.with_name("config.yaml").read_text())
    assert written["agent"]["ppo"]["learning_rate"] == 1e-6
    assert written["env"]["episode_length"] == 9.0
    assert "--agent.ppo.learning-rate 1e-6" in written["resumed"][0]["command"]
    saved = load_checkpoint(path.with_name("model_3.pt"))
    assert saved["optimizer_state_dict"]["param_groups"][0]["lr"] == 1e-6
    assert saved["estimator_trainer"]["optimizer"]["param_groups"][0]["lr"] == 2e-6
    assert [line["Loss/learning_rate"] for line in _curves(path.parent)][3] == 1e-6


def test_parameters_are_written_when_the_run_has_begun_and_not_before(
    finished, tmp_path, monkeypatch, capsys
):
    path = _resumable(finished, tmp_path / "run")
    before = path.with_name("config.yaml").read_bytes()

    def refuse(*args: object, **kwargs: object) -> None:
        raise DiskError("cannot write in run: No space left on device")

    monkeypatch.setattr("mute.learning.logger.CurveWriter.__init__", refuse)
    with pytest.raises(SystemExit) as stop:
        run_cli(lambda: main(["--plain", "--resume", str(path), "--iterations", "4"]))
    assert stop.value.code == 2
    assert "No space left on device; the last checkpoint is whole" in capsys.readouterr().err
    assert path.with_name("config.yaml").read_bytes() == before


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"task: [go1", "while parsing a flow sequence"),
        (b"\xff\xfe\x00x", ""),
        (b"- 1\n- 2\n", "it holds no fields"),
        (b"", "it holds no fields"),
        (b"command: {a: 1}\n", "it must tell its command in words"),
        (b"resumed: 3\n", "resumed must be a list"),
        (b"resumed: [3]\n", "resumed[0] must tell its command in words"),
    ],
    ids=["cut short", "no text", "list", "empty", "command", "resumed", "entry"],
)
def test_damaged_parameters_are_blamed_in_one_line_and_nothing_is_lost(
    content, words, finished, tmp_path, capsys
):
    path = _resumable(finished, tmp_path / "run")
    parameters = path.with_name("config.yaml")
    parameters.write_bytes(content)
    before = {item: item.read_bytes() for item in path.parent.glob("*.*")}
    with pytest.raises(SystemExit) as stop:
        run_cli(lambda: main(["--plain", "--resume", str(path), "--iterations", "4"]))
    assert stop.value.code == 2
    error = capsys.readouterr().err
    assert _is_one_line(error), error
    assert f"{parameters} is damaged: " in error
    assert words in error
    assert "move it away" in error
    assert {item: item.read_bytes() for item in path.parent.glob("*.*")} == before


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


def test_a_run_of_an_earlier_version_goes_on_with_its_rewards(finished, tmp_path):
    saved = load_checkpoint(finished[0] / "model_2.pt")
    expected = from_plain(saved["config"])
    saved["config"] = flat_rewards(estimators_own_heights(saved["config"], 0.3, 0.1))
    old = tmp_path / "go1_mute" / "old" / "model_2.pt"
    save_checkpoint(old, saved)
    assert train._configuration(train._arguments(["--resume", str(old)])[0]) == expected
    assert main(["--plain", "--resume", str(old), "--iterations", "4"]) == 0
    again = load_checkpoint(old.with_name("model_3.pt"))["config"]["env"]
    assert again["rewards"] == to_plain(expected)["env"]["rewards"]
    assert again["height_map"] == to_plain(expected)["env"]["height_map"]


def test_the_seed_that_a_resumed_run_has_may_be_given(finished):
    path = str(finished[0] / "model_2.pt")
    args, checkpoint = train._arguments(["--resume", path, "--seed", "5"])
    assert checkpoint == Path(path)
    assert train._configuration(args).env.seed == 5


def test_a_checkpoint_that_later_ones_follow_is_not_resumed(finished, capsys):
    run, _ = finished
    before = {path: path.read_bytes() for path in run.glob("*.*")}
    with pytest.raises(SystemExit) as stop:
        run_cli(lambda: main(["--plain", "--resume", str(run / "model_0.pt")]))
    assert stop.value.code == 2
    error = capsys.readouterr().err
    assert _is_one_line(error)
    assert f"resume {run / 'model_2.pt'}, or delete or move" in error
    assert {path: path.read_bytes() for path in run.glob("*.*")} == before


# -- numbers that are none any more ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ("--agent.ppo.learning-rate", "--agent.ppo.learning-rate may help"),
        ("--agent.estimation.learning-rate", "--agent.estimation.learning-rate may help"),
    ],
)
def test_a_training_that_diverges_stops_says_so_and_keeps_the_last_good_checkpoint(
    option, words, finished, tmp_path, capsys
):
    path = _resumable(finished, tmp_path / "run")
    whole = path.read_bytes()
    rate = [option, "1e30", "--agent.ppo.schedule", "fixed", "--agent.save-interval", "1"]
    with pytest.raises(SystemExit) as stop:
        run_cli(lambda: main(["--plain", "--resume", str(path), "--iterations", "9", *rate]))
    assert stop.value.code == 2
    *told, error = capsys.readouterr().err.splitlines()
    assert len(told) == 1  # the run's directory
    assert error.startswith("error: iteration 3: NaN or infinity in the ")
    assert "stops and keeps nothing of this iteration" in error
    assert words in error
    assert "the last checkpoint is whole, go on with: " in error
    assert error.endswith(f"--resume {path}")
    assert path.read_bytes() == whole
    assert not path.with_name("model_3.pt").exists()
    assert [line["iteration"] for line in _curves(path.parent)] == [0, 1, 2]


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
            ["rewards.terms.foot_clearance.params.target", "> 0", "0.0"],
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
    assert _train("--log-dir", str(tmp_path / "runs"), *arguments) == 2
    captured = capsys.readouterr()
    assert _is_one_line(captured.err), captured.err
    assert all(word in captured.err for word in words), captured.err
    assert captured.out == ""
    assert not (tmp_path / "runs").exists()


def _without(saved: dict[str, Any], name: str) -> dict[str, Any]:
    return {key: value for key, value in saved.items() if key != name}


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda path, saved: path.write_text("no checkpoint"), "not a checkpoint"),
        (lambda path, saved: torch.save({"weights": 1}, path), "another program"),
        (lambda path, saved: save_checkpoint(path, policy_part(saved)), "policy only"),
        (lambda path, saved: save_checkpoint(path, saved | {"task": "go9"}), "go9"),
        (lambda path, saved: save_checkpoint(path, saved | {"config": 3}), "configuration"),
        (lambda path, saved: save_checkpoint(path, saved | {"env": {}}), "does not fit"),
        (lambda path, saved: save_checkpoint(path, _without(saved, "iter")), "iter is missing"),
        (lambda path, saved: save_checkpoint(path, saved | {"iter": "2"}), "iter must be int"),
        (lambda path, saved: save_checkpoint(path, _without(saved, "infos")), "infos is missing"),
    ],
    ids=[
        "text",
        "foreign",
        "policy only",
        "other task",
        "bad config",
        "no world",
        "no iteration",
        "word for an iteration",
        "no infos",
    ],
)
def test_a_checkpoint_that_cannot_be_resumed_is_refused_in_one_line(
    make, words, finished, tmp_path, capsys
):
    path = tmp_path / "model_0.pt"
    make(path, load_checkpoint(finished[0] / "model_2.pt"))
    with pytest.raises(SystemExit) as stop:
        run_cli(lambda: main(["--plain", "--resume", str(path), "--iterations", "9"]))
    assert stop.value.code == 2
    error = capsys.readouterr().err
    assert _is_one_line(error), error
    assert words in error
    assert str(path) in error
    assert [item.name for item in tmp_path.iterdir()] == ["model_0.pt"]


@pytest.mark.parametrize("kind", [ValueError, SceneError])
def test_what_the_world_refuses_is_told_in_one_line_and_leaves_nothing(
    kind, tmp_path, capsys, monkeypatch
):
    def refuse(*args) -> None:
        raise kind("look: meshes are missing")

    monkeypatch.setattr(train, "MuteRunner", refuse)
    assert _train("--log-dir", str(tmp_path / "runs")) == 2
    assert capsys.readouterr().err == "error: look: meshes are missing\n"
    assert not (tmp_path / "runs").exists()


def test_a_log_directory_that_cannot_be_made_is_told_in_one_line(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert _train("--log-dir", str(tmp_path / "file"), "--iterations", "1") == 2
    error = capsys.readouterr().err
    assert _is_one_line(error)
    assert "--log-dir" in error


def test_help_is_no_mistake(capsys):
    with pytest.raises(SystemExit) as stop:
        run_cli(lambda: main(["--help"]))
    assert stop.value.code == 0
    assert "--num-envs" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("device", "options", "expected"),
    [
        ("cpu", [], 1024),
        ("cuda", [], 4096),
        ("cuda", ["--num-envs", "7"], 7),
        ("cuda", ["--env.num-envs", "1024"], 1024),
    ],
)
def test_the_number_of_robots_suits_the_device_unless_it_is_given(
    monkeypatch, device, options, expected
):
    monkeypatch.setattr(train, "resolve_device", lambda _: device)
    args, _ = train._arguments(options)
    assert train._configuration(args).env.num_envs == expected
