"""Check that MUTE installs: build it, install it in an empty environment, use it somewhere else.

    python .ci/check_wheel.py [--keep DIRECTORY]

The folder that it is used from, and the environment itself, hold packages of a user's own that have
the names of this tree's folders. They must neither break MUTE nor be hidden by it, whether it is
installed as a wheel or as an editable tree, and there is no git program to be found. Needs `build`
and `pyright`, and the package index.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path, PurePosixPath

TREE = Path(__file__).resolve().parents[1]
TORCH = "torch==2.13.0"
COMMANDS = ("mute-train", "mute-play", "mute-evaluate", "mute-export", "mute-meter")
OWN = ("envs/__init__.py", "envs/rewards.py", "networks/__init__.py", "mute_something/__init__.py")
"""Modules of the user's own, besides `train.py` and `evaluate.py` in their folder."""

PROGRAM = """\
import envs.rewards
import evaluate
import gymnasium
import mute_something
import networks
import numpy as np
import train

import mute  # registers the robot
from mute.networks import Estimator
from mute.support.provenance import current_commit

for module in (envs.rewards, evaluate, mute_something, networks, train):
    assert module.WHOSE == "the user's", module
assert Estimator.__module__ == "mute.networks.estimator"
robot = gymnasium.make("MUTE/Go1-v0")
observation, _ = robot.reset(seed=0)
for _ in range(50):
    observation, *_ = robot.step(np.zeros(12, dtype=np.float32))
    assert observation.shape == (46,) and np.isfinite(observation).all()
print(f"MUTE {mute.__version__}, commit {current_commit()}")
"""


def main() -> int:
    """Build, install and use; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--keep", type=Path, help="folder to work in, in place of a temporary one")
    folder = parser.parse_args().keep
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        check(folder.resolve())
        return 0
    with tempfile.TemporaryDirectory() as name:
        check(Path(name))
    return 0


def check(folder: Path) -> None:
    """Do everything in a folder."""
    run(TREE, sys.executable, "-m", "build", "--outdir", folder / "dist", TREE)
    (archive,) = folder.glob("dist/*.tar.gz")
    (wheel,) = folder.glob("dist/*.whl")
    check_contents(archive, wheel)
    environment = folder / "venv"
    run(folder, sys.executable, "-m", "venv", "--clear", environment)
    python = environment / "bin" / "python"
    run(folder, python, "-m", "pip", "install", "--quiet", TORCH)
    run(folder, python, "-m", "pip", "install", "--quiet", wheel)
    user = folder / "user"
    write_own(user, *OWN, "train.py", "evaluate.py")
    (user / "program.py").write_text(PROGRAM)
    use(python, user)
    run(folder, python, "-m", "pip", "uninstall", "--quiet", "--yes", "mute")
    run(folder, python, "-m", "pip", "install", "--quiet", "--no-deps", "--editable", TREE)
    use(python, user)
    run(user, sys.executable, "-m", "pyright", "--pythonpath", python, "program.py")
    # Packages that are installed come before those of an editable tree.
    (site,) = environment.glob("lib/python3*/site-packages")
    write_own(site, *OWN)
    run(folder, python, "-c", "import mute.tasks, envs.rewards; print(envs.rewards.WHOSE)")


def check_contents(archive: Path, wheel: Path) -> None:
    """Compare what was built with the tree: all of the package once, and nothing else.

    Raises:
        AssertionError: If something is missing, double, or does not belong there.
    """
    package = {
        path.relative_to(TREE).as_posix()
        for folder in ("mute", "mute/envs", "mute/networks", "mute/resources")
        for path in (TREE / folder).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    with zipfile.ZipFile(wheel) as content:
        names = content.namelist()
    about = [name for name in names if ".dist-info/" in name]
    expect(f"{wheel.name}", Counter(names), Counter([*package, *about]))
    with tarfile.open(archive) as content:
        files = [PurePosixPath(entry.name) for entry in content if not entry.isdir()]
    inside = [path.relative_to(path.parts[0]).as_posix() for path in files]
    about = [name for name in inside if not name.startswith("src/mute/")]
    expect(archive.name, Counter(inside), Counter([*(f"src/{name}" for name in package), *about]))
    others = ("tests", "docs", "envs", "networks", "web")
    strange = [name for name in about if name.startswith(others)]
    assert not strange, f"{archive.name} holds {strange}"


def expect(name: str, found: Counter[str], wanted: Counter[str]) -> None:
    """Compare names that were found with those that should be there.

    Raises:
        AssertionError: If they differ.
    """
    missing, extra = wanted - found, found - wanted
    assert not missing and not extra, f"{name}: missing {list(missing)}, too many {list(extra)}"
    print(f"{name}: {len(found)} files", flush=True)


def write_own(folder: Path, *names: str) -> None:
    """Write modules of the user's own, each of which says so."""
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text('WHOSE = "the user\'s"\n')


def use(python: Path, user: Path) -> None:
    """Use every command, and MUTE as a library, from a user's folder and without git."""
    programs = python.parent
    policy = output(
        user,
        python,
        "-c",
        "from mute.support.resources import RESOURCES; print(RESOURCES / 'go1/go1_mute.pt')",
    ).strip()
    for command in COMMANDS:
        output(user, programs / command, "--help")
    run(user, programs / "mute-play", "--seconds", "1", "--viewer", "none", "--wav", "walk.wav")
    levels = output(user, programs / "mute-meter", "walk.wav", "--json")
    assert "laeq" in levels.lower(), levels
    run(user, programs / "mute-export", "--policy", policy, "--out", "policy.onnx")
    assert (user / "policy.onnx").stat().st_size > 100_000
    run(user, python, "-m", "mute.web", "--out", "assets")
    assert (user / "assets" / "page.json").is_file()
    short = ("--trials", "1", "--seconds", "1.5", "--beta", "0", "--out", "evaluation")
    run(user, programs / "mute-evaluate", "noise", "--surface", "wood", *short)
    options = ("--iterations", "1", "--num-envs", "16", "--plain", "--log-dir", "runs")
    run(user, programs / "mute-train", *options, "--agent.noise-interval", "0")
    told = output(user, python, "program.py")
    assert told.endswith("commit unknown\n"), told


def run(folder: Path, *command: str | Path) -> None:
    """Run a command in a folder and show what it prints.

    Raises:
        subprocess.CalledProcessError: If it fails.
    """
    print("+", *command, flush=True)
    subprocess.run(command, cwd=folder, env=environment_for(command), check=True)


def output(folder: Path, *command: str | Path) -> str:
    """Run a command in a folder and return what it prints.

    Raises:
        subprocess.CalledProcessError: If it fails.
    """
    environment = environment_for(command)
    result = subprocess.run(
        command, cwd=folder, env=environment, stdout=subprocess.PIPE, text=True, check=True
    )
    return result.stdout


def environment_for(command: Sequence[str | Path]) -> dict[str, str]:
    """Return the variables for a command: the tools keep theirs, MUTE gets a user's.

    A user has nothing of this tree on the path of Python's, and here no git either.
    """
    environment = {name: text for name, text in os.environ.items() if name != "PYTHONPATH"}
    program = Path(command[0])
    if program.parent != Path(sys.executable).parent and "pip" not in command:
        environment["PATH"] = str(program.parent)
    return environment


if __name__ == "__main__":
    sys.exit(main())
