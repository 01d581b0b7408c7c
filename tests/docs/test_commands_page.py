"""The page of commands names what there is: every command, every option, and no other."""

from __future__ import annotations

import contextlib
import functools
import importlib
import io
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from places import REPOSITORY

_PAGE = (REPOSITORY / "docs" / "commands.md").read_text()
_PAGES = sorted([*REPOSITORY.glob("*.md"), *(REPOSITORY / "docs").glob("*.md")])
_NOT_OURS = (".ci/check_wheel.py", "-m venv ", "-m http.server ")
"""What is run from the checkout, or is Python's own, and is no command of MUTE's."""
_OF_OTHER_COMMANDS = {"-m mute.command_lines.benchmark_worker", "-m mute.live.gamepad_reader"}
"""What other commands start, by its path, and nobody else."""
_MODULES = {
    "train.py": "mute.command_lines.train",
    "play.py": "mute.command_lines.play",
    "evaluate.py": "mute.command_lines.evaluate",
    "-m mute.acoustics.meter": "mute.command_lines.meter",
    "-m mute.acoustics.calibration": "mute.command_lines.calibrate",
    "-m mute.export": "mute.command_lines.export",
    "-m mute.benchmark": "mute.command_lines.benchmark",
    "-m mute.release": "mute.command_lines.release",
    "-m mute.card": "mute.command_lines.card",
    "-m mute.web": "mute.command_lines.web",
    "-m benchmarks.levers": "benchmarks.levers",
    "-m benchmarks.mpc": "benchmarks.mpc",
    "-m benchmarks.make_peers": "benchmarks.make_peers",
    "-m benchmarks.peer_walks": "benchmarks.peer_walks",
    "-m benchmarks.physics": "benchmarks.physics",
    "-m benchmarks.quiet_terms": "benchmarks.quiet_terms",
    "-m benchmarks.sound": "benchmarks.sound",
    "-m benchmarks.terrain": "benchmarks.terrain",
    "examples/listen.py": "listen",
    "examples/run_onnx.py": "run_onnx",
    "examples/side_by_side.py": "side_by_side",
}
"""Where the main function of each command is."""


def _sections() -> dict[str, str]:
    """Return what the page says of each command."""
    parts = re.split(r"^## (.*)$", _PAGE, flags=re.MULTILINE)[1:]
    headed = zip(parts[::2], parts[1::2], strict=True)
    return {
        command: text for title, text in headed for command in re.findall("`python ([^`]+)`", title)
    }


def _help(command: str) -> str:
    """Return what a command prints for --help."""
    start = next(start for start in _MODULES if command == start or command.startswith(start + " "))
    words = command.removeprefix(start).split()
    main = importlib.import_module(_MODULES[start]).main
    printed = io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(printed):
        patch.setattr(sys, "argv", [start, *words, "--help"])
        with contextlib.suppress(SystemExit):
            main()
    return printed.getvalue()


@functools.cache
def _offered(command: str) -> set[str]:
    """Return the options of a command: those that begin a line of its help."""
    lines = re.findall(r"^[│|\s]*((?:--?[\w.-]+(?: [A-Z_]+)?, )*--[\w.-]+)", _help(command), re.M)
    return {word for line in lines for word in re.findall(r"--[a-z][\w.-]*", line)} - {"--help"}


@pytest.mark.parametrize("command", list(_sections()))
def test_the_page_names_every_option_of_a_command_and_no_other(command):
    named = set(re.findall(r"`(--[a-z][\w.-]*)[^`]*`", _sections()[command])) - {"--help"}
    offered = _offered(command)
    assert named <= offered, named - offered
    short = {name for name in offered if "." not in name and not name.startswith("--no-")}
    assert short - named == set()


def _code_on(page: Path) -> list[str]:
    """Return the lines of a page's blocks of code, and its code within sentences."""
    text = page.read_text()
    fenced = re.compile(r"^```\w*\n(.*?)^```", re.MULTILINE | re.DOTALL)
    indented = [line for line in text.splitlines() if line.startswith("    ")]
    inline = re.findall("`([^`\n]+(?:\n[^`\n]+)?)`", fenced.sub("", text))
    return [*"".join(fenced.findall(text)).splitlines(), *indented, *inline]


def _commands_on(page: Path) -> list[str]:
    """Return what follows `python` in a page's code, without comments."""
    code = (" ".join(line.split("  #")[0].split()) for line in _code_on(page))
    commands = (re.search(r"(?:^|\s)python (.*)", line) for line in code)
    return [found[1] for found in commands if found]


@pytest.mark.parametrize("page", _PAGES, ids=[page.name for page in _PAGES])
def test_a_command_that_any_page_gives_is_there_with_its_options(page):
    for words in map(str.split, _commands_on(page)):
        known = [
            command for command in _sections() if words[: len(command.split())] == command.split()
        ]
        assert known or f"{' '.join(words)} ".startswith(_NOT_OURS), " ".join(words)
        if known:
            given = {word.split("=")[0] for word in words if word.startswith("--")} - {"--help"}
            assert given <= _offered(known[0]), " ".join(words)


@pytest.mark.parametrize("page", _PAGES, ids=[page.name for page in _PAGES])
def test_a_field_that_any_page_names_as_an_option_is_there(page):
    named = set(re.findall(r"--(?:env|agent)\.[a-z.-]*[a-z]", page.read_text()))
    own = {name for name in named if ".wide-stance." in name}  # of the term that extending.md adds
    assert named - own <= _offered("train.py")


def test_the_page_has_every_module_that_can_be_run():
    modules = {
        f"-m {'.'.join(path.relative_to(REPOSITORY).with_suffix('').parts)}".removesuffix(
            ".__main__"
        )
        for path in (REPOSITORY / "mute").rglob("*.py")
        if 'if __name__ == "__main__":' in path.read_text()
    }
    scripts = {path.name for path in REPOSITORY.glob("*.py")}
    named = {" ".join(command.split()[:2]) for command in _sections()}
    assert modules - _OF_OTHER_COMMANDS <= named
    assert scripts <= {command.split()[0] for command in named}


def test_the_page_has_every_option_of_the_script_for_a_gpu():
    section = _PAGE.partition("## `benchmarks/gpu.sh`")[2].partition("\n## ")[0]
    script = (REPOSITORY / "benchmarks" / "gpu.sh").read_text()
    offered = set(re.findall(r"^ {8}(--[^)\n]*)\)", script, re.MULTILINE))
    assert set(re.findall(r"`(--[a-z-]+)`", section)) == set(re.split(r" \| ", " | ".join(offered)))


def test_the_page_has_every_subcommand_of_evaluate():
    listed = re.search(r"\{(.*)\}", _help("evaluate.py"))
    assert listed is not None
    named = {command.split()[1] for command in _sections() if command.startswith("evaluate.py ")}
    assert named == set(listed[1].split(","))


def test_the_page_has_every_name_that_an_installed_command_has():
    scripts = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]["scripts"]
    assert set(re.findall("`(mute-[a-z]+)`", _PAGE)) == set(scripts)


def test_a_module_that_the_page_names_starts():
    words = [sys.executable, "-m", "mute.export", "--help"]
    environ = {**os.environ, "OMP_NUM_THREADS": "1"}
    run = subprocess.run(words, cwd=REPOSITORY, env=environ, capture_output=True, check=False)
    assert run.returncode == 0
