"""What the page is given is what Python walks in."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import mujoco
import numpy as np
import onnxruntime
import pytest
from dreamwaq_helpers import write_dreamwaq_policy
from places import REPOSITORY, RESOURCES

from mute.acoustics.floors import FLOORS
from mute.acoustics.listener import SAMPLE_RATE, WAV_FULL_SCALE
from mute.acoustics.recorder import AT_LIMIT, RELEASE
from mute.checkpoint import load_checkpoint, save_checkpoint
from mute.command_lines.policy_options import policies_that_ship
from mute.command_lines.web import main
from mute.controllers import load_policy
from mute.envs.quadruped_env import QuadrupedEnv, scene_of
from mute.envs.scene import FOOT_RADIUS, STAND_JOINT_POS, SceneCfg
from mute.envs.terrain.ground import NEAR
from mute.evaluation.noise_levels import SETTLE_TIME
from mute.support.errors import MuteError
from mute.web.assets import walking_cfg
from mute.web.scene_text import check_same, scene_text

SHIPPED = RESOURCES / "go1" / "go1_mute.pt"
_NUMBER = re.compile(r"(?<![\w.])\d[\d_]*(?:\.\d+)?(?:e-?\d+)?")
"""A number in TypeScript."""
REFERENCE = REPOSITORY / "web" / "test" / "reference"


@pytest.fixture(scope="module")
def assets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("assets") / "new"
    assert main(["--out", str(out)]) == 0
    return out


def test_the_scene_of_the_page_moves_as_the_environment_to_the_bit(assets: Path):
    cfg = walking_cfg(load_policy(SHIPPED).cfg.env, "wood", 1.0)
    model = mujoco.MjModel.from_xml_path(str(assets / "flat.xml"))
    data = mujoco.MjData(model)
    own = QuadrupedEnv(cfg).simulation.model
    twin = mujoco.MjData(own)
    for stepped, state in ((model, data), (own, twin)):
        mujoco.mj_resetDataKeyframe(stepped, state, 0)
        for step in range(300):
            state.ctrl[:] = np.array(STAND_JOINT_POS) + 0.2 * np.sin(0.05 * step + np.arange(12))
            mujoco.mj_step(stepped, state)
    np.testing.assert_array_equal(data.qpos, twin.qpos)
    np.testing.assert_array_equal(data.sensordata, twin.sensordata)


def test_a_scene_that_would_move_otherwise_is_refused():
    cfg = SceneCfg(foot_forces=True)
    text = scene_text(cfg)
    check_same(text, cfg)
    with pytest.raises(RuntimeError, match="body_mass"):
        check_same(text.replace('mass="5.204"', 'mass="5.2041"'), cfg)
    with pytest.raises(RuntimeError, match=r"opt\.timestep"):
        check_same(text, dataclasses.replace(cfg, timestep=0.004))


def test_scenes_hold_nothing_that_only_mujoco_4_reads(assets: Path):
    for name in ("flat.xml", "stairs.xml"):
        root = ElementTree.parse(assets / name).getroot()
        assert not root.findall(".//general"), "motors are position servos, as in the robot's file"
        assert not [element for element in root.iter() if "input" in element.attrib]
    boxes = root.findall("worldbody/geom[@type='box']")
    assert len(boxes) == json.loads((assets / "page.json").read_text())["stairs"]["boxes"]


def test_page_data_tells_every_floor_as_sound_has_it(assets: Path):
    data = json.loads((assets / "page.json").read_text())
    told = {floor["name"]: floor for floor in data["floors"]}
    assert list(told) == list(FLOORS)
    for name, floor in FLOORS.items():
        assert told[name]["friction"] == floor.friction
        assert tuple(told[name]["solref"]) == floor.solref


def test_the_page_understands_the_layout_that_is_written_and_has_no_figure_of_its_own(assets: Path):
    source = REPOSITORY / "web" / "src"
    data = json.loads((assets / "page.json").read_text())
    assert f"const FORMAT = {data['format']};" in (source / "physics" / "page_data.ts").read_text()
    assert data["contact"] == {"release": RELEASE, "at_limit": AT_LIMIT}
    assert data["footfall"]["near"] == NEAR
    assert data["settle_time"] == SETTLE_TIME
    assert (data["sample_rate"], data["foot_radius"]) == (SAMPLE_RATE, FOOT_RADIUS)
    sound = json.loads((assets / "sound.json").read_text())
    assert sound["full_scale"] == WAV_FULL_SCALE
    assert sound["meter"]["settle_time"] == SETTLE_TIME
    for name in ("control/footfalls.ts", "sound/recorder.ts", "sound/playback.ts"):
        numbers = {float(number) for number in _NUMBER.findall((source / name).read_text())}
        for figure in (RELEASE, AT_LIMIT, NEAR, FOOT_RADIUS):
            assert figure not in numbers, f"{name} has {figure} of its own"


def test_every_controller_is_an_export_that_runs_at_the_rate_of_the_scene(assets: Path):
    data = json.loads((assets / "page.json").read_text())
    cfg = scene_of(walking_cfg(load_policy(SHIPPED).cfg.env, "wood", 1.0))
    for controller in data["controllers"]:
        session = onnxruntime.InferenceSession((assets / controller["file"]).read_bytes())
        metadata = session.get_modelmeta().custom_metadata_map
        assert metadata["joint_names"].split(",") == data["joint_names"]
        assert float(metadata["control_dt"]) == pytest.approx(cfg.timestep * data["decimation"])


def test_reference_walks_are_those_of_the_policy_that_ships():
    kept = json.loads((REFERENCE / "walks.json").read_text())
    digest = hashlib.sha256(SHIPPED.read_bytes()).hexdigest()
    assert kept["policy_sha256"] == digest, (
        "make them again: python -m mute.web --out web/assets --reference web/test/reference"
    )


def test_a_policy_that_is_missing_is_told_of_in_one_line(tmp_path: Path):
    with pytest.raises(MuteError, match=r"nowhere\.pt"):
        main(["--policy", str(tmp_path / "nowhere.pt"), "--out", str(tmp_path)])


def test_a_world_that_cannot_be_is_told_of_the_policy_whose_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def refused(cfg: SceneCfg) -> str:
        raise ValueError("env.scene.cone must be elliptic")

    monkeypatch.setattr("mute.web.assets.scene_text", refused)
    with pytest.raises(MuteError, match=r"^--policy .*go1_mute\.pt: env\.scene\.cone must be"):
        main(["--out", str(tmp_path)])


def test_where_the_page_is_not_nothing_is_made_for_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(MuteError, match=r"the page is not here \(web/package\.json is missing\)"):
        main([])
    assert not list(tmp_path.iterdir())


def test_further_policies_come_into_the_list_of_controllers_unless_their_task_is_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("mute.command_lines.web.policies_that_ship", lambda: [SHIPPED])
    with pytest.raises(MuteError, match=r"--also: .* different tasks, got go1_mute, go1_mute"):
        main(["--out", str(tmp_path), "--also", str(SHIPPED)])
    other = load_checkpoint(SHIPPED) | {"task": "go1_other"}
    save_checkpoint(tmp_path / "other.pt", other)
    assert main(["--out", str(tmp_path), "--also", str(tmp_path / "other.pt")]) == 0
    controllers = json.loads((tmp_path / "page.json").read_text())["controllers"]
    assert [(one["label"], one["file"]) for one in controllers] == [
        ("MUTE", "go1_mute.onnx"),
        ("go1_other", "go1_other.onnx"),
    ]
    assert (tmp_path / "go1_other.onnx").is_file()


def test_every_policy_that_ships_comes_into_the_list_unless_its_task_is_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    one = write_dreamwaq_policy(tmp_path / "go1_dreamwaq.pt")
    monkeypatch.setattr("mute.command_lines.web.policies_that_ship", lambda: [one, SHIPPED])
    for words, names in (
        ([], ["go1_mute", "go1_dreamwaq"]),
        (["--policy", str(one)], ["go1_dreamwaq", "go1_mute"]),
    ):
        out = tmp_path / "assets"
        assert main(["--out", str(out), *words]) == 0
        controllers = json.loads((out / "page.json").read_text())["controllers"]
        assert [controller["name"] for controller in controllers] == names
        named = {"name": "go1_dreamwaq", "label": "DreamWaQ", "file": "go1_dreamwaq.onnx"}
        assert named in controllers


def test_policies_that_ship_are_all_of_the_resources():
    assert SHIPPED in policies_that_ship()
    assert policies_that_ship() == sorted((RESOURCES / "go1").glob("*.pt"))
