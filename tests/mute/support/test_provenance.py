"""Tests of what tables and files say of where they come from."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path

import git
import pytest
from places import FLAT_POLICY, SHIPPED_POLICY

from mute.acoustics.body import CALIBRATION_FILE
from mute.acoustics.origin import sound_origin
from mute.command_lines import evaluate
from mute.support import provenance
from mute.support.errors import MuteError

SHIPPED = SHIPPED_POLICY


@pytest.fixture
def commit(tmp_path, monkeypatch) -> str:
    """Make a repository with a program and a document in it the project's; return its commit."""
    repository = git.Repo.init(tmp_path)
    for name in ("program.py", "docs/table.json"):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text("")
        repository.index.add([name])
    author = git.Actor("A", "a@example.org")
    monkeypatch.setattr(provenance, "REPOSITORY", tmp_path)
    return repository.index.commit("begin", author=author, committer=author).hexsha


def test_a_changed_program_makes_the_commit_dirty(commit, tmp_path):
    assert provenance.current_commit() == commit
    (tmp_path / "program.py").write_text("pass\n")
    assert provenance.current_commit() == f"{commit}-dirty"


def test_a_result_written_to_the_documents_leaves_the_next_one_clean(commit, tmp_path):
    (tmp_path / "docs" / "table.json").write_text("[]\n")
    assert provenance.current_commit() == commit


def test_outside_git_the_commit_is_unknown(tmp_path, monkeypatch):
    monkeypatch.setattr(provenance, "REPOSITORY", tmp_path)
    assert provenance.current_commit() == "unknown"


def test_a_file_is_placed_without_the_folders_of_a_machine(tmp_path):
    assert provenance.place_of(SHIPPED_POLICY) == "resources/go1/go1_mute.pt"
    path = tmp_path / "someone" / "runs" / "go1_mute" / "seed0" / "model_9.pt"
    assert provenance.place_of(path) == "model_9.pt"
    path.parent.mkdir(parents=True)
    (path.parent / "config.yaml").write_text("")
    assert provenance.place_of(path) == "go1_mute/seed0/model_9.pt"
    assert provenance.place_of(Path("/model_9.pt")) == "model_9.pt"


def test_the_origin_of_levels_names_the_policy_the_calibration_the_commit_and_the_machine():
    origin = sound_origin(SHIPPED)
    assert origin["policy"] == "resources/go1/go1_mute.pt"
    assert origin["policy_sha256"] == hashlib.sha256(SHIPPED.read_bytes()).hexdigest()
    assert origin["calibration_sha256"] == hashlib.sha256(CALIBRATION_FILE.read_bytes()).hexdigest()
    assert origin["commit"] == provenance.current_commit()
    assert re.search(r", (1 core|\d+ cores)\b", origin["machine"])


def test_a_table_of_levels_has_its_origin_beside_it(tmp_path):
    words = ["--surface", "wood", "--beta", "0", "--trials", "1", "--seconds", "1.5"]
    evaluate.main(["noise", *words, "--sources", "fan", "--out", str(tmp_path)])
    about = json.loads((tmp_path / "noise_about.json").read_text())
    assert about.items() >= sound_origin(SHIPPED).items()


def test_the_calibration_that_ships_was_fitted_to_the_policy_of_flat_ground():
    fitted = json.loads(CALIBRATION_FILE.read_text())["policy"]
    assert fitted["sha256"] == provenance.file_sha256(FLAT_POLICY)


def test_a_file_that_cannot_be_read_is_told_in_one_line():
    with pytest.raises(MuteError, match=r"cannot read absent\.pt: No such file"):
        provenance.file_sha256(Path("absent.pt"))
