"""Tests of Menagerie's look: its meshes, and what is said where they are not there."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from mute.envs.menagerie import SceneError
from mute.envs.scene import SceneCfg, build_scene


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return build_scene(SceneCfg())


def test_without_the_menagerie_package_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco_menagerie", None)
    with pytest.raises(SceneError, match="pip install mujoco_menagerie"):
        build_scene(SceneCfg(look="menagerie"))


def test_a_menagerie_without_its_files_is_one_clear_error(monkeypatch):
    class MenagerieError(Exception):
        pass

    def get(name: str) -> None:
        raise MenagerieError(f"cannot download {name}")

    package = SimpleNamespace(get=get, MenagerieError=MenagerieError)
    monkeypatch.setitem(sys.modules, "mujoco_menagerie", package)
    with pytest.raises(SceneError, match="cannot download unitree_go1"):
        build_scene(SceneCfg(look="menagerie"))


def test_menagerie_meshes_take_the_place_of_our_primitives_and_leave_the_physics(
    monkeypatch, tmp_path, model
):
    (tmp_path / "assets").mkdir()
    (tmp_path / "assets" / "trunk.obj").write_text(
        "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    (tmp_path / "go1.xml").write_text(
        '<mujoco><compiler meshdir="assets"/>'
        '<asset><material name="paint" rgba="1 0 0 1"/><mesh file="trunk.obj"/></asset>'
        '<worldbody><body name="trunk"><freejoint/>'
        '<geom type="mesh" mesh="trunk" material="paint"/></body></worldbody></mujoco>'
    )
    robot = SimpleNamespace(
        spec=lambda entry: mujoco.MjSpec.from_file(str(tmp_path / f"{entry}.xml"))
    )
    package = SimpleNamespace(get=lambda name: robot, MenagerieError=RuntimeError)
    monkeypatch.setitem(sys.modules, "mujoco_menagerie", package)

    dressed = build_scene(SceneCfg(look="menagerie"))
    looks = np.flatnonzero(dressed.geom_group == 2)
    assert len(looks) == 1
    assert dressed.geom_type[looks[0]] == mujoco.mjtGeom.mjGEOM_MESH
    assert dressed.body(dressed.geom_bodyid[looks[0]]).name == "trunk"
    np.testing.assert_array_equal(dressed.mat_rgba[dressed.geom_matid[looks[0]]], (1, 0, 0, 1))
    np.testing.assert_allclose(dressed.body_mass, model.body_mass)
    np.testing.assert_allclose(dressed.body_inertia, model.body_inertia)
