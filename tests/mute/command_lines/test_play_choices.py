"""What can be chosen in the page of `play.py --viewer web`, and what fits which robots."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import pytest
from dreamwaq_helpers import write_dreamwaq_policy
from places import RESOURCES, SHIPPED_POLICY

pytest.importorskip("viser", reason="needs mute[web]")

from mute.command_lines.play_choices import misfit, page_choices, with_all_sensors
from mute.command_lines.policy_options import DriverArgs
from mute.controllers.command import Command
from mute.controllers.learned import LearnedController
from mute.controllers.mpc.controller import MpcController
from mute.controllers.onnx_policy import OnnxController
from mute.envs.quadruped_env import QuadrupedEnv
from mute.evaluation.session import Session
from mute.evaluation.trials import evaluation_cfg
from mute.live.panel import Choice
from mute.support.errors import MuteError
from mute.tasks import make_task

SHIPPED_ONNX = RESOURCES / "go1" / "go1_mute.onnx"


def _make_session(args: DriverArgs) -> Session:
    driver = args.driver()
    cfg = with_all_sensors(evaluation_cfg(driver.cfg.env, 1, seconds=5.0, seed=0))
    env = QuadrupedEnv(dataclasses.replace(cfg, num_threads=1))
    return Session(env, driver.controller(env.cfg), Command())


def _choices(*policies: Path, **args: object) -> dict[str, Choice]:
    found = DriverArgs(**args).with_driver_found()  # pyright: ignore[reportArgumentType]
    return page_choices(found, policies, _make_session(found))


def test_policies_exports_and_the_planner_can_drive_one_after_the_other(tmp_path):
    dreamwaq = write_dreamwaq_policy(tmp_path / "dreamwaq.pt")
    args = DriverArgs().with_driver_found()
    session = _make_session(args)
    choices = page_choices(args, (dreamwaq, SHIPPED_ONNX), session)
    kinds = {
        "go1_mute.pt": (LearnedController, True),
        "dreamwaq.pt": (LearnedController, False),
        "go1_mute.onnx": (OnnxController, True),
        "mpc": (MpcController, False),
    }
    assert list(choices) == list(kinds)
    assert choices["go1_mute.pt"].controller is session.controller
    for name, (kind, quiet_factor) in kinds.items():
        assert isinstance(choices[name].controller, kind)
        assert choices[name].quiet_factor is quiet_factor
        session.drive_with(choices[name].controller)
        session.step()


def test_beside_the_planner_the_policy_that_ships_can_be_chosen():
    assert list(_choices(controller="mpc")) == ["mpc", "go1_mute.pt"]


def test_names_stay_apart_whatever_files_are_called(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "other").mkdir()
    for name in ("mpc", "go1_mute.pt", "other/go1_mute.pt"):
        shutil.copy(SHIPPED_POLICY, tmp_path / name)
    policies = [Path(name) for name in ("mpc", "go1_mute.pt", "other/go1_mute.pt", "mpc")]
    names = list(_choices(*policies))
    assert names[:3] == ["go1_mute.pt", "mpc", "go1_mute.pt (2)"]
    assert names[3] == "other/go1_mute.pt"
    assert names[4:] == ["mpc (2)", "mpc (3)"]


def test_latest_is_the_newest_checkpoint_by_its_name(tmp_path):
    run = tmp_path / "runs" / "go1_mute" / "first"
    run.mkdir(parents=True)
    shutil.copy(SHIPPED_POLICY, run / "model_7.pt")
    assert "model_7.pt" in _choices(Path("latest"), log_dir=tmp_path / "runs")
    first = next(iter(_choices(policy=Path("latest"), log_dir=tmp_path / "runs")))
    assert first == "model_7.pt"


def test_a_policy_that_is_missing_or_of_other_robots_is_refused_before_the_walk(monkeypatch):
    with pytest.raises(MuteError, match=r"no\.pt"):
        _choices(Path("no.pt"))
    monkeypatch.setattr("mute.command_lines.play_choices.misfit", lambda *_: "it differs")
    with pytest.raises(MuteError, match=r"--policies .*\.onnx cannot drive this robot: it differs"):
        _choices(SHIPPED_ONNX)


def test_a_policy_of_other_robots_is_told_by_what_differs():
    ours = make_task("go1_mute_flat").env
    assert misfit(make_task("go1_dreamwaq").env, ours) is None
    stiff = dataclasses.replace(ours, scene=dataclasses.replace(ours.scene, stiffness=28.0))
    assert misfit(stiff, ours) == (
        "it was made for robots with env.scene.stiffness 28.0, these have 20.0"
    )
    # Ten steps of 2 ms are a control step as four of 5 ms are.
    fine = dataclasses.replace(
        ours, decimation=10, scene=dataclasses.replace(ours.scene, timestep=0.002)
    )
    assert misfit(fine, ours) is None
    slow = dataclasses.replace(ours, decimation=8)
    assert "a control step (s) 0.04" in str(misfit(slow, ours))
