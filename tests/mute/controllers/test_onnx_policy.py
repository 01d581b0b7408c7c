"""An exported policy drives robots as its checkpoint does, and a file that cannot is refused."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import onnx
import pytest
import torch
from dreamwaq_helpers import write_dreamwaq_policy
from places import RESOURCES

from mute.checkpoint import CheckpointError
from mute.command_lines.policy_options import DriverArgs
from mute.controllers import Controller, load_policy
from mute.controllers.onnx_export import export_policy
from mute.controllers.onnx_policy import load_onnx_policy
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.evaluation.trials import evaluation_cfg

SHIPPED = RESOURCES / "go1" / "go1_mute.onnx"


def _actions(
    first: Controller, second: Controller, cfg: QuadrupedEnvCfg, steps: int = 40
) -> Iterator[tuple[torch.Tensor, torch.Tensor]]:
    """Yield the actions of two controllers of the same robots, which the first one drives."""
    env = QuadrupedEnv(cfg)
    env.set_command(torch.tensor((0.8, 0.0, 0.2, 0.6)).repeat(cfg.num_envs, 1))
    for step in range(steps):
        if step == steps // 2:  # one robot has no past from here on
            forgotten = torch.arange(cfg.num_envs) == 1
            first.reset(forgotten)
            second.reset(forgotten)
        observations = env.get_observations()
        actions = first.act(observations)
        yield actions, second.act(observations)
        env.step(actions)


def _with_metadata(path: Path, **changed: str | None) -> Path:
    """Write the policy that ships with other metadata; None leaves an entry out."""
    model = onnx.load(str(SHIPPED))
    entries = {entry.key: entry.value for entry in model.metadata_props} | changed
    del model.metadata_props[:]
    onnx.helper.set_model_props(model, {k: v for k, v in entries.items() if v is not None})
    onnx.save(model, str(path))
    return path


def test_it_does_what_its_checkpoint_does_with_recurrent_states_of_each_robot():
    learned, exported = load_policy(SHIPPED.with_suffix(".pt")), load_onnx_policy(SHIPPED)
    cfg = evaluation_cfg(learned.cfg.env, 2, seconds=5.0, seed=0)
    moved = 0.0
    for ours, theirs in _actions(learned.controller(cfg), exported.controller(cfg), cfg):
        torch.testing.assert_close(theirs, ours, atol=1e-4, rtol=1e-4)
        moved = max(moved, float(ours.abs().max()))
    assert moved > 0.5
    assert exported.quiet_factor


def test_one_with_a_history_and_without_beta_does_so_too(tmp_path):
    learned = load_policy(write_dreamwaq_policy(tmp_path / "dreamwaq.pt"))
    export_policy(learned, tmp_path / "dreamwaq.onnx")
    exported = load_onnx_policy(tmp_path / "dreamwaq.onnx")
    cfg = evaluation_cfg(learned.cfg.env, 2, seconds=5.0, seed=0)
    for ours, theirs in _actions(learned.controller(cfg), exported.controller(cfg), cfg, 12):
        torch.testing.assert_close(theirs, ours, atol=1e-4, rtol=1e-4)
    assert not exported.quiet_factor


def test_it_is_for_the_robots_that_it_was_trained_on(tmp_path):
    path = _with_metadata(
        tmp_path / "stiff.onnx",
        joint_stiffness=",".join(["28.0"] * 12),
        action_scale=",".join(["0.5"] * 12),
        control_dt="0.01",
    )
    robots = load_onnx_policy(path).cfg.env
    assert (robots.scene.stiffness, robots.action_scale, robots.step_dt) == (28.0, 0.5, 0.01)


def test_a_command_line_takes_it_for_a_checkpoint():
    driver = DriverArgs(policy=SHIPPED).with_driver_found().driver()
    assert driver.task == "go1_mute.onnx"


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"recurrent_state": None}, "it has no 'recurrent_state'"),
        ({"recurrent_state": json.dumps({"h_in": "h_out"})}, "cannot be run"),
        ({"joint_names": "hip,knee"}, "its joint_names are hip,knee, not FR_hip_joint,"),
        ({"joint_damping": "0.5,0.4"}, "its joint_damping differs between joints: 0.5,0.4"),
        ({"joint_stiffness": "stiff"}, "could not convert string to float: 'stiff'"),
        ({"default_joint_pos": ",".join(["0.0"] * 12)}, "its default_joint_pos is"),
        ({"control_dt": "0.0213"}, "its control_dt is 0.0213 s, no multiple of 0.005 s"),
        ({"action_clip": "-1"}, "env.action_clip must be"),
        ({"observation_scales": "1"}, "no policy for this robot"),
    ],
)
def test_a_file_that_does_not_fit_is_refused_by_what_differs(tmp_path, changed, message):
    path = _with_metadata(tmp_path / "other.onnx", **changed)
    with pytest.raises(CheckpointError, match=message) as caught:
        load_onnx_policy(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", [None, b"", b"no graph"])
def test_a_missing_or_damaged_file_is_refused_in_one_line(tmp_path, content):
    path = tmp_path / "damaged.onnx"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(CheckpointError, match=r"damaged\.onnx") as caught:
        load_onnx_policy(path)
    assert "\n" not in str(caught.value)
