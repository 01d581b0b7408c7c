"""Tests of the script that measures MUTE on a GPU: what it refuses, and what it starts."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import pytest
from places import REPOSITORY

_SCRIPT = REPOSITORY / "benchmarks" / "gpu.sh"


def _program(path: Path, script: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)
    return path


def _run(*options: str | Path, **settings: Path | str) -> subprocess.CompletedProcess[str]:
    """Run the script in `cwd`, with `path` before all other folders of programs."""
    variables = dict(os.environ)
    if "path" in settings:
        variables["PATH"] = f"{settings['path']}{os.pathsep}{os.environ['PATH']}"
    command = ["bash", str(_SCRIPT), *map(str, options)]
    cwd = settings.get("cwd", REPOSITORY)
    return subprocess.run(command, capture_output=True, text=True, env=variables, cwd=cwd)


def _refused(result: subprocess.CompletedProcess[str], told: str) -> bool:
    """Tell whether it ended with status 2 and one line that begins as given."""
    one = result.stderr.count("\n") == 1
    return result.returncode == 2 and one and result.stderr.startswith(f"error: {told}")


def test_what_is_asked_for_is_handed_on_with_whole_paths_from_the_checkout(tmp_path):
    python = _program(tmp_path / "python", 'echo "$0"\npwd\nprintf "%s\\n" "$@"')
    link = tmp_path / "environment" / "python"
    link.parent.mkdir()
    link.symlink_to(python)
    options = ["--python", "environment/python", "--out", "gpu.json", "--peers-from", "peers"]
    result = _run(*options, "--dry-run-on-cpu", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    called, folder, *words = result.stdout.splitlines()
    # The link stays: an interpreter finds its packages by the path that it is called by.
    assert (Path(called), Path(folder)) == (link, REPOSITORY)
    left = words.pop(words.index("--seconds") + 1)
    assert 500 <= int(left) <= 600
    assert words == [
        *("-m", "benchmarks.gpu", "--out", str(tmp_path / "gpu.json"), "--seconds"),
        *("--peers-from", str(tmp_path / "peers"), "--dry-run-on-cpu"),
    ]


def test_figures_of_another_time_are_removed_first(tmp_path):
    out = tmp_path / "gpu.json"
    out.write_text("old")
    result = _run("--python", _program(tmp_path / "python", "exit 3"), "--out", out)
    assert (result.returncode, out.exists()) == (3, False)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--fast"], "unknown option --fast; "),
        (["--out"], "--out needs a value"),
        (["--out", "/nowhere/gpu.json"], "--out: there is no folder /nowhere"),
        (["--out", "/"], "--out: / is a folder"),
        (["--python", "/nowhere/python"], "--python: /nowhere/python is no program that can be"),
        (["--python", str(_SCRIPT.parent)], f"--python: {_SCRIPT.parent} is no program that can"),
    ],
)
def test_bad_options_are_refused_in_one_line(options, told):
    assert _refused(_run(*options), told)


def test_where_packages_cannot_be_installed_the_file_says_so(tmp_path):
    out = tmp_path / "gpu.json"
    # It neither has MUTE nor can install it.
    _program(tmp_path / "venv" / "bin" / "python", "exit 1")
    options = ["--out", out, "--wheels", tmp_path, "--venv", tmp_path / "venv"]
    # The Python that is found is this one, whatever else the machine has.
    _program(tmp_path / "bin" / "python3.11", "exit 0")
    result = _run(*options, path=tmp_path / "bin")
    reason = "the packages cannot be installed, or not in 300 s"
    assert _refused(result, f"{reason}\n")
    assert json.loads(out.read_text()) == {"error": reason}


_WITHOUT_PIP = """
case "$1 $2" in
"-c "*) exit 0 ;;
"-m venv") mkdir -p "$3/bin"; cp "$0" "$3/bin/python"; echo a long story; exit 1 ;;
*) exit 1 ;;
esac
"""


def test_an_environment_without_pip_is_told_in_one_line_and_removed(tmp_path):
    python = _program(tmp_path / "bin" / "python3.11", _WITHOUT_PIP)
    venv, out = tmp_path / "venv", tmp_path / "gpu.json"
    result = _run("--out", out, "--venv", venv, path=python.parent)
    assert _refused(result, "no virtual environment with pip can be made")
    assert "python3-venv" in json.loads(out.read_text())["error"]
    assert not venv.exists()


@pytest.mark.parametrize("name", ["python3.12", "python3.13", "python3"])
def test_every_python_that_is_new_enough_is_found(tmp_path, name):
    for other in ("python3.11", "python3.12", "python3.13", "python3"):
        _program(tmp_path / "bin" / other, "exit 1")  # too old
    python = _program(tmp_path / "bin" / name, _WITHOUT_PIP)
    result = _run("--out", tmp_path / "a", "--venv", tmp_path / "venv", path=python.parent)
    assert f"can be made by {python};" in result.stderr


def test_where_no_python_is_new_enough_the_file_says_so(tmp_path):
    for name in ("python3.11", "python3.12", "python3.13", "python3"):
        _program(tmp_path / "bin" / name, "exit 1")
    out = tmp_path / "gpu.json"
    result = _run("--out", out, "--venv", tmp_path / "venv", path=tmp_path / "bin")
    assert _refused(result, "Python 3.11, 3.12 or 3.13 is not there")
    assert json.loads(out.read_text()) == {"error": "Python 3.11, 3.12 or 3.13 is not there"}
