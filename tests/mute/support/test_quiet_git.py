"""Tests of MUTE on machines without a git program."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import git
import pytest
from places import REPOSITORY


def _run(code: str, **variables: str) -> str:
    """Run code in a new process and return what it prints."""
    environ = {name: text for name, text in os.environ.items() if name != "GIT_PYTHON_REFRESH"}
    result = subprocess.run(
        [sys.executable, "-c", code],
        env=environ | {"PYTHONPATH": str(REPOSITORY)} | variables,
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    return result.stdout.strip()


def test_without_a_git_program_a_training_begins_and_its_commit_is_unknown(tmp_path: Path):
    (tmp_path / "file").touch()
    repository = git.Repo.init(tmp_path)
    repository.index.add(["file"])
    author = git.Actor("A", "a@example.org")
    repository.index.commit("begin", author=author, committer=author)
    run_dir = tmp_path / "run"
    code = f"""
import dataclasses
from pathlib import Path
from mute.learning.runner import MuteRunner
from mute.support import provenance
from mute.tasks import make_task
import rsl_rl

place = Path({str(tmp_path)!r})
rsl_rl.__file__ = str(place / "file")  # as in a virtual environment that lies in a checkout
provenance.REPOSITORY = place
cfg = make_task("go1_mute")
env = dataclasses.replace(cfg.env, num_envs=4, num_threads=1)
ppo = dataclasses.replace(cfg.agent.ppo, num_mini_batches=2)
agent = dataclasses.replace(cfg.agent, iterations=1, num_steps_per_env=2, ppo=ppo, noise_interval=0)
runner = MuteRunner("go1_mute", dataclasses.replace(cfg, env=env, agent=agent), place / "run")
print(runner.train(), provenance.current_commit())
"""
    assert _run(code, PATH=str(run_dir)) == "True unknown"
    assert (run_dir / "model_0.pt").is_file()


@pytest.mark.parametrize("given", ["", "quiet"])
def test_importing_git_leaves_the_environment_as_it_was(given: str):
    code = """
import os
from mute.support.quiet_git import import_git
before = dict(os.environ)
print(import_git().__name__, os.environ == before)
"""
    assert _run(code, **({"GIT_PYTHON_REFRESH": given} if given else {})) == "git True"
