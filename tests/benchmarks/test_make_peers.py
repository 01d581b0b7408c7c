"""Tests of what makes the peers' environments, with a stand-in for Python and its pip."""

from __future__ import annotations

import json
from pathlib import Path

import mujoco
import pytest

from benchmarks import make_peers

_PYTHON = """#!/bin/sh
# The Python that environments are made from, and that of the environments.
echo "$0 $*" >> {log}
case "$*" in
  "-m venv "*) mkdir -p "$3/bin" && cp "$0" "$3/bin/python" ;;
  "-m pip install "*)
    case "$*" in
      *$(cat {broken})*)
        echo "trying" >&2; echo "ERROR: no matching distribution for $(cat {broken})" >&2
        echo "a notice" >&2; exit 1 ;;
    esac ;;
  *purelib*) echo "$(dirname "$0")/../packages" ;;
  *) shift 2; sep="{{"
     for name in "$@"; do printf '%s"%s": "1.2.3"' "$sep" "$name"; sep=", "; done
     echo "}}" ;;
esac
"""


@pytest.fixture
def python(tmp_path):
    """Return a function that writes a Python whose pip fails for one package."""

    def write(broken: str = "nothing-breaks") -> list[str]:
        path = tmp_path / "python"
        (tmp_path / "broken").write_text(broken)
        path.write_text(_PYTHON.format(broken=tmp_path / "broken", log=tmp_path / "log"))
        path.chmod(0o755)
        return ["--python", str(path), "--into", str(tmp_path / "peers")]

    return write


def _log(tmp_path: Path) -> str:
    log = tmp_path / "log"
    return log.read_text() if log.exists() else ""


def test_a_peer_that_pip_cannot_install_is_told_and_the_others_are_made(python, tmp_path, capsys):
    assert make_peers.main(python(broken="mjlab")) == 1
    gymnasium, mjlab, playground, unilab = capsys.readouterr().out.splitlines()
    assert gymnasium == "gymnasium: needs no environment of its own"
    assert mjlab == "mjlab: missing: pip install failed: no matching distribution for mjlab"
    assert playground.startswith("mujoco_playground: made: playground 1.2.3, mujoco 1.2.3, ")
    assert unilab.startswith("unilab: made: unilab 1.2.3, mjbatch-uni 1.2.3, ")
    made = json.loads((tmp_path / "peers" / "unilab" / "made.json").read_text())
    assert made["versions"]["torch"] == "1.2.3"
    assert not (tmp_path / "peers" / "mjlab" / "made.json").exists()


def test_what_is_there_already_is_left_and_what_was_missing_is_made(python, tmp_path, capsys):
    make_peers.main(python(broken="unilab"))
    before = _log(tmp_path)
    capsys.readouterr()
    assert make_peers.main(python()) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(": ")[1].split(" ")[0] for line in lines[1:]] == ["there", "there", "made"]
    again = _log(tmp_path).removeprefix(before)
    assert "unilab" in again
    assert "playground" not in again


def test_other_versions_than_were_made_are_installed_anew(python, tmp_path, capsys):
    arguments = [*python(), "--peers", "mjlab"]
    make_peers.main(arguments)
    made = tmp_path / "peers" / "mjlab" / "made.json"
    content = json.loads(made.read_text())
    made.write_text(json.dumps(content | {"requirements": ["mjlab==1.0.0"]}))
    capsys.readouterr()
    assert make_peers.main(arguments) == 0
    assert capsys.readouterr().out.splitlines()[1].startswith("mjlab: made: ")
    assert json.loads(made.read_text()) == content


def test_pytorch_alone_comes_from_the_index_that_is_named(python, tmp_path):
    make_peers.main([*python(), "--peers", "unilab", "--torch-index", "https://index.example"])
    of_torch, of_all = (line for line in _log(tmp_path).splitlines() if "pip install" in line)
    assert of_torch.endswith("--index-url https://index.example torch==2.13.0")
    assert "https://index.example" not in of_all


def test_wheels_of_a_folder_are_enough(python, tmp_path):
    make_peers.main([*python(), "--wheels", "/wheels"])
    installs = [line for line in _log(tmp_path).splitlines() if "pip install" in line]
    assert len(installs) == 5
    assert all("--no-index --find-links /wheels " in line for line in installs)


def test_a_python_that_is_not_there_is_told(tmp_path, capsys):
    missing = ["--python", "/nowhere/python", "--into", str(tmp_path), "--peers", "mjlab"]
    assert make_peers.main(missing) == 1
    assert capsys.readouterr().out.splitlines()[1] == (
        "mjlab: missing: no virtual environment: /nowhere/python: No such file or directory"
    )


@pytest.mark.parametrize("name", ["mujoco_playground", "unilab"])
def test_mujoco_reads_what_stands_in_for_meshes_and_meshes_that_are_there_stay(
    name, python, tmp_path
):
    recipe = make_peers.RECIPES[name]
    folder = tmp_path / "peers" / name / "packages" / str(recipe.meshes)
    make_peers.main([*python(), "--peers", name])
    (tmp_path / "peers" / name / "made.json").unlink()
    kept = folder / recipe.mesh_names[0]
    kept.write_bytes(b"own")
    make_peers.main([*python(), "--peers", name])
    assert kept.read_bytes() == b"own"
    assert sorted(path.name for path in folder.iterdir()) == sorted(recipe.mesh_names)
    mesh = folder / recipe.mesh_names[-1]
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><asset><mesh name='one' file='{mesh}'/></asset>"
        "<worldbody><geom type='mesh' mesh='one'/></worldbody></mujoco>"
    )
    assert (model.nmeshvert, model.nmeshface) == (4, 4)
