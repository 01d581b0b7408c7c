"""The look of MuJoCo Menagerie's Go1, for whoever has its package; the physics stays ours."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import mujoco

from mute.support.errors import MuteError

__all__ = ["SceneError", "dress_in_menagerie"]

_VISUAL_GROUP = 2
"""Geom group of shapes only looked at; collision shapes are in group 3, hidden by default."""


class SceneError(MuteError):
    """Raised where a scene needs something that this machine does not have."""


def dress_in_menagerie(spec: mujoco.MjSpec) -> None:
    """Show the meshes of the `mujoco_menagerie` package's Go1 in place of our primitives.

    Args:
        spec: A scene with the robot, not compiled yet.

    Raises:
        SceneError: The package or its meshes are not there.
    """
    source = _load_menagerie_go1()
    mesh_dir = Path(source.modelfiledir) / source.meshdir
    for geom in [geom for geom in spec.geoms if geom.group == _VISUAL_GROUP]:
        spec.delete(geom)
    for mesh in source.meshes:
        name = mesh.name or Path(mesh.file).stem  # a mesh without a name goes by its file's
        spec.add_mesh(name=f"menagerie_{name}", file=str(mesh_dir / mesh.file), scale=mesh.scale)
    for material in source.materials:
        spec.add_material(
            name=f"menagerie_{material.name}",
            rgba=material.rgba,
            specular=material.specular,
            shininess=material.shininess,
        )
    for geom in source.geoms:
        body = spec.body(geom.parent.name)
        if geom.type != mujoco.mjtGeom.mjGEOM_MESH or body is None:
            continue
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=f"menagerie_{geom.meshname}",
            material=f"menagerie_{geom.material}" if geom.material else "silver",
            pos=geom.pos,
            quat=geom.quat,
            group=_VISUAL_GROUP,
            contype=0,
            conaffinity=0,
            mass=0.0,
        )


def _load_menagerie_go1() -> mujoco.MjSpec:
    """Return MuJoCo Menagerie's Go1, which its package fetches into a cache on first use."""
    try:
        menagerie: Any = importlib.import_module("mujoco_menagerie")
    except ImportError as error:
        raise SceneError(
            "look 'menagerie' needs the package mujoco_menagerie: pip install mujoco_menagerie,"
            " or use look 'primitives'"
        ) from error
    try:
        return menagerie.get("unitree_go1").spec("go1")
    except (menagerie.MenagerieError, OSError, ValueError) as error:
        raise SceneError(
            "look 'menagerie' found no Go1 in the cache of mujoco_menagerie and could not fetch it"
            f" ({error}): fetch it once where there is a network, or use look 'primitives'"
        ) from error
