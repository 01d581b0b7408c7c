"""`train.py --env.terrain.kind` trains over ground, says its levels, and keeps its kind."""

from __future__ import annotations

from finished_run import curves, exit_status, is_one_line, tensorboard, train_tiny

from mute.command_lines.train import main

_LEVELS = {"Ground/level_rooms", "Ground/level_stairs", "Ground/level_stairs_down"}


def test_a_training_over_ground_shows_its_levels_goes_on_and_keeps_its_kind(tmp_path, capsys):
    ground = ("--task", "go1_mute_flat", "--env.terrain.kind", "indoor", "--num-envs", "16")
    ground += ("--log-dir", str(tmp_path))
    assert train_tiny(*ground, "--run-name", "a", "--iterations", "1") == 0
    run = tmp_path / "go1_mute_flat" / "a"
    resume = ("--task", "go1_mute_flat", "--resume", str(run / "model_0.pt"), "--iterations", "2")
    capsys.readouterr()
    for option, value in (("kind", "rough"), ("first-levels", "2 3")):
        words = ["--plain", *resume, f"--env.terrain.{option}", *value.split()]
        assert exit_status(lambda given=words: main(given)) == 2
        error = capsys.readouterr().err
        assert is_one_line(error)
        assert f"env.terrain.{option.replace('-', '_')}: a resumed run keeps" in error
    assert train_tiny("--num-envs", "16", *resume, "--env.terrain.crossed", "3") == 0
    assert (run / "model_1.pt").exists()
    written = curves(run)
    assert [line["iteration"] for line in written] == [0, 1]
    assert all(line.keys() >= _LEVELS for line in written)
    assert set(tensorboard(run).Tags()["scalars"]) >= _LEVELS
