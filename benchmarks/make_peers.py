"""Make the environments of the peers that MUTE is compared with: python -m benchmarks.make_peers.

mjlab, MuJoCo Playground and UniLab pin other versions of MuJoCo than MUTE, so each has a virtual
environment of its own in the folder that `--into` names, by its name there; `mute.benchmark
--peers all --peers-from` finds them. Gymnasium steps MUTE's own scene and needs none. One line for
each peer says what was made, or what is missing and why; the others are made all the same. What is
there already is left as it is.

Any Python 3.11 runs this: it imports nothing but the standard library. PyTorch for CPUs alone takes
a tenth of the room of its CUDA build, which pip installs on Linux unless it is told another index:
`--torch-index` names one.
"""

from __future__ import annotations

import argparse
import json
import shutil
import struct
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

__all__ = ["RECIPES", "Recipe", "main"]

_MADE = "made.json"
"""In a peer's folder: what was installed, for which wishes."""

_CORNERS = ((0.0, 0.0, 0.0), (0.01, 0.0, 0.0), (0.0, 0.01, 0.0), (0.0, 0.0, 0.01))
_FACES = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
"""A small tetrahedron, m: what stands in for a mesh that is only for show."""


@dataclass(frozen=True)
class Recipe:
    """How a peer's environment is made."""

    package: str
    """Package that it comes in."""
    requirements: tuple[str, ...]
    """What is installed, at versions that were tried."""
    torch: tuple[str, ...] = ()
    """What is installed of PyTorch before that."""
    meshes: str | None = None
    """Folder in the environment's packages for meshes that its package does not hold."""
    mesh_names: tuple[str, ...] = ()
    """Files there. They are for show: none collides, and every body has its inertia given."""


_GO2_MESHES = (
    *(f"base_{number}.obj" for number in range(5)),
    *("hip_0.obj", "hip_1.obj", "foot.obj"),
    *(f"{part}_0.obj" for part in ("thigh", "thigh_mirror", "calf", "calf_mirror")),
    *(f"{part}_1.obj" for part in ("thigh", "thigh_mirror", "calf", "calf_mirror")),
)
_GO1_MESHES = ("trunk.stl", "hip.stl", "thigh.stl", "thigh_mirror.stl", "calf.stl")

RECIPES = {
    "mjlab": Recipe(
        package="mjlab",
        requirements=("mjlab==1.6.0", "mujoco==3.11.0", "mujoco-warp==3.11.0", "warp-lang==1.19.0"),
        torch=("torch==2.13.0", "torchvision"),
    ),
    "mujoco_playground": Recipe(
        package="playground",
        requirements=(
            *("playground==0.2.0", "mujoco==3.17.0", "mujoco-mjx==3.17.0"),
            *("brax==0.14.2", "jax==0.9.2"),  # of newer ones this brax misses a function
        ),
        meshes="mujoco_playground/external_deps/mujoco_menagerie/unitree_go1/assets",
        mesh_names=_GO1_MESHES,
    ),
    "unilab": Recipe(
        package="unilab",
        requirements=("unilab[mujoco]==1.5.2", "mjbatch-uni==0.2.5", "mujoco==3.11.0"),
        torch=("torch==2.13.0",),
        meshes="unilab/assets/robots/go2/assets",
        mesh_names=_GO2_MESHES,
    ),
}
"""By a peer's name, how its environment is made."""


class _NotMadeError(Exception):
    """Why an environment could not be made, in one line."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status: 1 if a peer is missing."""
    args = _arguments(argv)
    print("gymnasium: needs no environment of its own")
    missing = False
    for name in args.peers:
        try:
            print(f"{name}: {_make(name, args)}", flush=True)
        except _NotMadeError as error:
            print(f"{name}: missing: {error}", flush=True)
            missing = True
    return int(missing)


def _arguments(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        "benchmarks.make_peers", description="Make the environments of MUTE's peers."
    )
    parser.add_argument("--into", type=Path, required=True, help="folder for the environments")
    parser.add_argument(
        "--peers", nargs="+", choices=list(RECIPES), default=list(RECIPES), metavar="PEER",
        help=f"which of {', '.join(RECIPES)}; all if not given",
    )  # fmt: skip
    parser.add_argument(
        "--python", default=sys.executable, help="Python that they are made from; this one"
    )
    parser.add_argument(
        "--torch-index", help="index that PyTorch comes from; the one that pip uses if not given"
    )
    parser.add_argument(
        "--wheels", type=Path, help="folder of wheels; nothing is then asked of a network"
    )
    args = parser.parse_args(argv)
    args.into = args.into.absolute()
    return args


def _make(name: str, args: argparse.Namespace) -> str:
    """Make one environment; return what was made.

    Raises:
        _NotMadeError: If it cannot be made.
    """
    recipe, folder = RECIPES[name], args.into / name
    python = folder / "bin" / "python"
    wanted = [*recipe.torch, *recipe.requirements]
    made = _made(folder)
    if made is not None and made["requirements"] == wanted and python.exists():
        return f"there already: {_told(made['versions'])} in {folder}"
    if not python.exists():
        shutil.rmtree(folder, ignore_errors=True)
        _run([args.python, "-m", "venv", str(folder)], "no virtual environment")
    if recipe.torch:
        index = ["--index-url", args.torch_index] if args.torch_index else []
        _install(python, recipe.torch, [*index, *_offline(args)])
    # PyTorch is named again, or pip might exchange it for another one.
    _install(python, wanted, _offline(args))
    versions = _versions(python, recipe)
    stand_ins = _stand_in_for_meshes(python, recipe)
    content = {"requirements": wanted, "versions": versions}
    (folder / _MADE).write_text(json.dumps(content, indent=2) + "\n")
    shown = f", {stand_ins} meshes for show stood in for by tetrahedra" if stand_ins else ""
    return f"made: {_told(versions)}{shown} in {folder}"


def _made(folder: Path) -> dict | None:
    """Return what was made there, or None if nothing was, or not to the end."""
    try:
        content = json.loads((folder / _MADE).read_text())
    except (OSError, ValueError):
        return None
    return content if {"requirements", "versions"} <= set(content) else None


def _told(versions: dict[str, str]) -> str:
    return ", ".join(f"{name} {version}" for name, version in versions.items())


def _offline(args: argparse.Namespace) -> list[str]:
    return ["--no-index", "--find-links", str(args.wheels)] if args.wheels else []


def _install(python: Path, requirements: Sequence[str], options: Sequence[str]) -> None:
    command = [str(python), "-m", "pip", "install", "--quiet", *options, *requirements]
    _run(command, "pip install failed")


def _versions(python: Path, recipe: Recipe) -> dict[str, str]:
    """Return the versions of the package and of what it was asked for with, as installed."""
    names = [recipe.package, *(_name(each) for each in (*recipe.requirements, *recipe.torch))]
    names = list(dict.fromkeys(names))
    program = (
        "import json, sys; from importlib import metadata; "
        "print(json.dumps({name: metadata.version(name) for name in sys.argv[1:]}))"
    )
    return json.loads(_run([str(python), "-c", program, *names], "not installed as asked for"))


def _name(requirement: str) -> str:
    return requirement.partition("==")[0].partition("[")[0]


def _stand_in_for_meshes(python: Path, recipe: Recipe) -> int:
    """Write tetrahedra for meshes that are not there; return how many there are of them."""
    if recipe.meshes is None:
        return 0
    program = "import sysconfig; print(sysconfig.get_path('purelib'))"
    folder = Path(_run([str(python), "-c", program], "no folder of packages").strip())
    folder /= recipe.meshes
    folder.mkdir(parents=True, exist_ok=True)
    missing = [folder / name for name in recipe.mesh_names if not (folder / name).exists()]
    for path in missing:
        path.write_bytes(_obj() if path.suffix == ".obj" else _stl())
    return len(missing)


def _obj() -> bytes:
    corners = [f"v {x} {y} {z}" for x, y, z in _CORNERS]
    faces = [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in _FACES]
    return "\n".join([*corners, *faces, ""]).encode()


def _stl() -> bytes:
    triangles = b"".join(
        struct.pack("<12fH", *(0.0, 0.0, 0.0), *_CORNERS[a], *_CORNERS[b], *_CORNERS[c], 0)
        for a, b, c in _FACES
    )
    return bytes(80) + struct.pack("<I", len(_FACES)) + triangles


def _run(command: Sequence[str], failure: str) -> str:
    """Run a program and return what it prints.

    Raises:
        _NotMadeError: If it fails, with the last line that it says.
    """
    try:
        result = subprocess.run(command, capture_output=True, text=True)
    except OSError as error:
        raise _NotMadeError(f"{failure}: {command[0]}: {error.strerror}") from error
    if result.returncode != 0:
        lines = (result.stderr + result.stdout).strip().splitlines() or ["no message"]
        told = [line for line in lines if line.startswith("ERROR")] or lines
        raise _NotMadeError(f"{failure}: {told[-1].removeprefix('ERROR: ')[-200:]}")
    return result.stdout


if __name__ == "__main__":
    sys.exit(main())
