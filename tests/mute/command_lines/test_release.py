"""Tests of the files of a release."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from learning_helpers import make_runner

from mute.command_lines import evaluate, release
from mute.evaluation.tables import read_json, write_json
from mute.support.errors import MuteError


@pytest.fixture
def run(tmp_path, monkeypatch):
    """A finished run of two iterations, and figures that need no walking."""
    run_dir = tmp_path / "run"
    runner = make_runner(run_dir)
    runner.train()
    parameters = {
        "command": "python train.py --task go1_mute --log-dir /somewhere --seed 3",
        "resumed": [{"command": "python train.py --resume /somewhere/run/model_0.pt"}],
        "commit": "c" * 40,
        "machine": "a machine",
    }
    (run_dir / "config.yaml").write_text(yaml.safe_dump(parameters))

    def measure(argv):
        write_json(Path(argv[-1]) / "gait.json", {"policy": argv[2]})
        return 0

    monkeypatch.setattr(evaluate, "main", measure)
    return run_dir


def test_a_release_holds_policy_onnx_and_a_card_of_where_they_come_from(run, tmp_path):
    out = tmp_path / "out"
    assert release.main(["--checkpoint", str(run / "model_1.pt"), "--out", str(out)]) == 0
    assert sorted(path.name for path in out.iterdir()) == [
        "go1_mute.json",
        "go1_mute.onnx",
        "go1_mute.pt",
    ]
    told = read_json(out / "go1_mute.json")
    assert told["command"] == "python train.py --task go1_mute --seed 3"
    assert told["resumed"] == ["python train.py --resume model_0.pt"]
    assert (told["seed"], told["iterations"], told["steps"]) == (3, 2, 2 * 8 * 8)
    assert (told["commit"], told["machine"]) == ("c" * 40, "a machine")
    assert told["figures"] == {"policy": "go1_mute.pt"}


def test_a_release_that_is_interrupted_leaves_the_files_of_the_last_one(run, tmp_path, monkeypatch):
    def interrupt(argv):
        raise KeyboardInterrupt

    release.main(["--checkpoint", str(run / "model_0.pt"), "--out", str(tmp_path)])
    before = {path: path.read_bytes() for path in tmp_path.glob("go1_mute.*")}
    monkeypatch.setattr(evaluate, "main", interrupt)
    with pytest.raises(KeyboardInterrupt):
        release.main(["--checkpoint", str(run / "model_1.pt"), "--out", str(tmp_path)])
    assert len(before) == 3
    assert {path: path.read_bytes() for path in tmp_path.glob("go1_mute.*")} == before


def test_a_policy_alone_cannot_be_released(run, tmp_path):
    release.main(["--checkpoint", str(run / "model_1.pt"), "--out", str(tmp_path)])
    with pytest.raises(MuteError, match="policy only"):
        release.main(["--checkpoint", str(tmp_path / "go1_mute.pt"), "--out", str(tmp_path)])


def test_a_checkpoint_outside_its_run_cannot_be_released(run, tmp_path):
    (run / "config.yaml").unlink()
    with pytest.raises(MuteError, match="outside its run"):
        release.main(["--checkpoint", str(run / "model_1.pt"), "--out", str(tmp_path)])


def test_a_released_policy_is_small(run, tmp_path):
    release.main(["--checkpoint", str(run / "model_1.pt"), "--out", str(tmp_path)])
    full, small = run / "model_1.pt", tmp_path / "go1_mute.pt"
    assert small.stat().st_size < full.stat().st_size
