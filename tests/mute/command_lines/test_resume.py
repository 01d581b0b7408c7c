"""`train.py --resume` really run: how a training stops, goes on, and what it refuses."""

from __future__ import annotations

import shutil
import signal
from pathlib import Path
from typing import Any

import pytest
import torch
import yaml
from earlier_versions import estimators_own_heights, flat_rewards, with_terms_of_then
from finished_run import (
    THREE_ITERATIONS,
    contents,
    curves,
    exit_status,
    is_one_line,
    tensorboard,
    train_tiny,
)
from training_process import start_training, stop_after

from mute.checkpoint import load_checkpoint, save_checkpoint
from mute.command_lines import train
from mute.command_lines.train import main
from mute.config import from_plain, to_plain
from mute.learning.runner import MuteRunner, policy_part
from mute.support.files import DiskError


@pytest.fixture(scope="module")
def finished(tmp_path_factory) -> Path:
    """Return the directory of a run of three iterations."""
    log_dir = tmp_path_factory.mktemp("runs")
    assert main([*THREE_ITERATIONS, "--log-dir", str(log_dir)]) == 0
    return log_dir / "go1_mute" / "a"


def _resumable(finished: Path, directory: Path) -> Path:
    """Copy a finished run, and return its last checkpoint."""
    shutil.copytree(finished, directory)
    return directory / "model_2.pt"


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
    assert tensorboard(run).Scalars("Loss/value")[-1].step == last

    arguments = ["--resume", "latest", "--log-dir", str(tmp_path)]
    assert train_tiny(*arguments, "--iterations", str(last + 3)) == 0
    assert (run / f"model_{last + 2}.pt").exists()
    assert [line["iteration"] for line in curves(run)] == list(range(last + 3))
    steps = [event.step for event in tensorboard(run).Scalars("Loss/value")]
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
    assert train_tiny("--resume", str(run / "model_1.pt"), "--iterations", "4") == 0
    assert [line["iteration"] for line in curves(run)] == [0, 1, 2, 3]
    steps = [event.step for event in tensorboard(run).Scalars("Loss/value")]
    assert steps == [0, 1, 2, 3]


def test_a_resumed_run_keeps_the_options_it_was_started_with(finished, tmp_path):
    path = tmp_path / "go1_mute" / "moved" / "model_2.pt"
    save_checkpoint(path, load_checkpoint(finished / "model_2.pt"))
    arguments = ["--plain", "--resume", str(path), "--iterations", "4"]
    assert main(arguments) == 0
    cfg = from_plain(load_checkpoint(path.with_name("model_3.pt"))["config"])
    assert (cfg.env.num_envs, cfg.env.seed, cfg.env.rewards.k) == (32, 5, 0.3)
    assert cfg.agent.iterations == 4


def test_a_resume_that_cannot_be_leaves_the_written_parameters_alone(finished, capsys):
    run = finished
    before = (run / "config.yaml").read_text()
    path = str(run / "model_2.pt")
    for arguments in (["--iterations", "3"], ["--iterations", "9", "--num-envs", "16"]):
        words = ["--plain", "--resume", path, *arguments]
        assert exit_status(lambda given=words: main(given)) == 2
        assert is_one_line(capsys.readouterr().err)
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
    path = str(finished / "model_2.pt")
    assert (
        exit_status(lambda: main(["--plain", "--resume", path, "--iterations", "9", *arguments]))
        == 2
    )
    error = capsys.readouterr().err
    assert is_one_line(error)
    assert all(word in error for word in words), error


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [
        ("--agent.activation", "relu", "agent.activation: a resumed run keeps 'elu', got 'relu'"),
        ("--agent.init-std", "0.5", "agent.init_std: a resumed run keeps 0.8, got 0.5"),
        ("--env.height-map.scale", "0.2", "env.height_map.scale: a resumed run keeps 0.1, got"),
        ("--env.scene.timestep", "0.004", "env.scene.timestep: a resumed run keeps 0.01, got"),
        ("--env.footfall.landing-window", "0.06", "env.footfall.landing_window: a resumed run"),
        ("--num-envs", "16", "env.num_envs: a resumed run keeps 32, got 16"),
        ("--env.randomization.gain-scale", "0.8 1.2", "env.randomization.gain_scale: a resumed"),
    ],
)
def test_a_field_that_a_resumed_run_cannot_change_is_named_and_nothing_is_written(
    option, value, words, finished, capsys
):
    run = finished
    before = contents(run)
    arguments = ["--resume", str(run / "model_2.pt"), "--iterations", "9", option, *value.split()]
    assert exit_status(lambda: main(["--plain", *arguments])) == 2
    error = capsys.readouterr().err
    assert is_one_line(error)
    assert "does not fit this configuration" in error
    assert words in error
    assert contents(run) == before


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
    assert [line["Loss/learning_rate"] for line in curves(path.parent)][3] == 1e-6


def test_parameters_are_written_when_the_run_has_begun_and_not_before(
    finished, tmp_path, monkeypatch, capsys
):
    path = _resumable(finished, tmp_path / "run")
    before = path.with_name("config.yaml").read_bytes()

    def refuse(*args: object, **kwargs: object) -> None:
        raise DiskError("cannot write in run: No space left on device")

    monkeypatch.setattr("mute.learning.logger.CurveWriter.__init__", refuse)
    assert exit_status(lambda: main(["--plain", "--resume", str(path), "--iterations", "4"])) == 2
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
    assert exit_status(lambda: main(["--plain", "--resume", str(path), "--iterations", "4"])) == 2
    error = capsys.readouterr().err
    assert is_one_line(error), error
    assert f"{parameters} is damaged: " in error
    assert words in error
    assert "move it away" in error
    assert {item: item.read_bytes() for item in path.parent.glob("*.*")} == before


def test_a_run_of_an_earlier_version_goes_on_with_its_rewards(finished, tmp_path):
    saved = load_checkpoint(finished / "model_2.pt")
    expected = with_terms_of_then(from_plain(saved["config"]))
    saved["config"] = flat_rewards(estimators_own_heights(to_plain(expected), 0.3, 0.1))
    old = tmp_path / "go1_mute" / "old" / "model_2.pt"
    save_checkpoint(old, saved)
    assert train._configuration(train._arguments(["--resume", str(old)])[0]) == expected
    assert main(["--plain", "--resume", str(old), "--iterations", "4"]) == 0
    again = load_checkpoint(old.with_name("model_3.pt"))["config"]["env"]
    assert again["rewards"] == to_plain(expected)["env"]["rewards"]
    assert again["height_map"] == to_plain(expected)["env"]["height_map"]


def test_the_seed_that_a_resumed_run_has_may_be_given(finished):
    path = str(finished / "model_2.pt")
    args, checkpoint = train._arguments(["--resume", path, "--seed", "5"])
    assert checkpoint == Path(path)
    assert train._configuration(args).env.seed == 5


def test_a_checkpoint_that_later_ones_follow_is_not_resumed(finished, capsys):
    run = finished
    before = contents(run)
    assert exit_status(lambda: main(["--plain", "--resume", str(run / "model_0.pt")])) == 2
    error = capsys.readouterr().err
    assert is_one_line(error)
    assert f"resume {run / 'model_2.pt'}, or delete or move" in error
    assert contents(run) == before


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
    assert (
        exit_status(lambda: main(["--plain", "--resume", str(path), "--iterations", "9", *rate]))
        == 2
    )
    *told, error = capsys.readouterr().err.splitlines()
    assert len(told) == 1  # the run's directory
    assert error.startswith("error: iteration 3: NaN or infinity in the ")
    assert "stops and keeps nothing of this iteration" in error
    assert words in error
    assert "the last checkpoint is whole, go on with: " in error
    assert error.endswith(f"--resume {path}")
    assert path.read_bytes() == whole
    assert not path.with_name("model_3.pt").exists()
    assert [line["iteration"] for line in curves(path.parent)] == [0, 1, 2]


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
    make(path, load_checkpoint(finished / "model_2.pt"))
    assert exit_status(lambda: main(["--plain", "--resume", str(path), "--iterations", "9"])) == 2
    error = capsys.readouterr().err
    assert is_one_line(error), error
    assert words in error
    assert str(path) in error
    assert [item.name for item in tmp_path.iterdir()] == ["model_0.pt"]
