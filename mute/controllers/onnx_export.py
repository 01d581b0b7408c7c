"""A policy as one ONNX file.

Estimator, normaliser and actor become one graph whose recurrent state goes in and comes out, so
that whoever runs it keeps the state. The metadata says how to make its input and what its output
means; `examples/run_onnx.py` is a program that knows nothing else.
"""

from __future__ import annotations

import contextlib
import json
import logging
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path

import mujoco
import onnx
import torch
from torch import nn

from mute.controllers.heading_hold import heading_hold
from mute.controllers.learned import Policy
from mute.envs.observations import OBS_DIM, OBSERVATION_WIDTHS
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.scene import JOINT_NAMES, build_scene
from mute.learning.estimated_env import actor_groups, policy_group
from mute.support.errors import MuteError
from mute.support.files import replace_file

__all__ = ["export_policy"]

_OPSET = 18
"""Version of the operators: the oldest that torch's exporter writes."""
_IR_VERSION = 8
"""Version of the file format: the one of the first ONNX that had this opset. torch writes a newer
one, which ONNX Runtime refuses up to 1.17, while nothing in the graph needs it."""
_SHORT_NAMES = {"hidden": "h", "cell": "c"}
"""What parts of an estimator's state are called in the file, where not as in the estimator."""
_COMMAND_NAMES = ("lin_vel_x", "lin_vel_y", "ang_vel_z", "beta")


def export_policy(policy: Policy, out: Path) -> None:
    """Write a policy as one self-contained ONNX file, atomically.

    Inputs: `obs` (1, 46), the scaled observation, and what the estimator remembers, zero at the
    start: the LSTM state `h_in` and `c_in`, each (1, lstm_hidden), or the last observations
    `history_in`; and `turned_in` (1, 1), the angle in rad that the robot has turned by unasked,
    where the policy holds its heading. Outputs: `action` (1, 12), the mean action in units of
    `action_scale`; `phase` (1, 4), in [0, 1], feet in the order FR, FL, RR, RL, where it is
    estimated; `base_lin_vel` (1, 3), in m/s in the body frame; and the new state, each part named
    `_out` for `_in`.

    The metadata has the keys of mjlab's exports, numbers in full precision, and some more:

    - `joint_names`, `joint_stiffness` (N m/rad), `joint_damping` (N m s/rad), `default_joint_pos`
      (rad), `action_scale` (rad): one entry per joint, comma-separated. The set point of a joint
      is `default_joint_pos + action_scale * action`.
    - `observation_names`, `command_names`: comma-separated, in the order of the columns.
    - `observation_scales` and `recurrent_state`: JSON, name to factor and input to output.
    - `control_dt` (s) and `action_clip`, the bound on an action's magnitude.

    Args:
        policy: What to export; it is not changed.
        out: File to write or replace; its directory is made if need be.

    Raises:
        MuteError: If the file cannot be written.
    """
    model = _graph(policy)
    state = dict(zip(_state_names(policy, "in"), _state_names(policy, "out"), strict=True))
    metadata = _metadata(policy.cfg.env) | {"recurrent_state": json.dumps(state)}
    onnx.helper.set_model_props(model, metadata)
    onnx.checker.check_model(model)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        replace_file(out, model.SerializeToString())
    except OSError as error:
        raise MuteError(f"cannot write {out}: {error.strerror}") from error


class _PolicyGraph(nn.Module):
    """Estimator and actor as a function of the observation and the estimator's state."""

    def __init__(self, policy: Policy) -> None:
        super().__init__()
        self.estimator = policy.estimator
        self.actor = policy.actor.as_onnx(verbose=False)
        self.groups = policy.actor.obs_groups
        self.env_cfg = policy.cfg.env
        self.with_phase = policy.cfg.agent.estimation.actor_uses_phase
        self.hold = heading_hold(policy.cfg)

    def forward(self, obs: torch.Tensor, *state: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Take one control step; shapes as in `export_policy`."""
        turned = ()
        if self.hold is not None:
            state, turned = state[:-1], state[-1:]
            obs, *turned = self.hold.step(obs, *turned)
        obs = policy_group(obs, self.estimator)
        estimate, state = self.estimator.step(obs, state)
        groups = actor_groups(obs, estimate, self.estimator, self.env_cfg, self.with_phase)
        action = self.actor(torch.cat([groups[name] for name in self.groups], dim=-1))
        phase = [estimate.phase] if self.estimator.num_feet else []
        return action, *phase, estimate.base_lin_vel, *state, *turned


def _state_names(policy: Policy, end: str) -> list[str]:
    """Return what the parts of the estimator's state are called where they go `in` or `out`."""
    parts = [_SHORT_NAMES.get(part, part) for part in policy.estimator.encoder.state_sizes]
    holds = heading_hold(policy.cfg) is not None
    return [f"{part}_{end}" for part in (*parts, *(["turned"] if holds else []))]


def _graph(policy: Policy) -> onnx.ModelProto:
    """Trace the policy with zeros; the graph has no branch that they could hide."""
    turned = () if heading_hold(policy.cfg) is None else (torch.zeros(1, 1),)
    arguments = (torch.zeros(1, OBS_DIM), *policy.estimator.initial_state(1, "cpu"), *turned)
    phase = ["phase"] if policy.estimator.num_feet else []
    with torch.no_grad(), _quiet_exporter():
        program = torch.onnx.export(
            _PolicyGraph(policy).eval(),
            arguments,
            input_names=["obs", *_state_names(policy, "in")],
            output_names=["action", *phase, "base_lin_vel", *_state_names(policy, "out")],
            opset_version=_OPSET,
            dynamo=True,
            external_data=False,
            verbose=False,
        )
    if program is None:
        raise RuntimeError("torch.onnx.export returned no program")
    model = program.model_proto
    _strip_notes(model.graph)
    model.ir_version = _IR_VERSION
    return model


@contextlib.contextmanager
def _quiet_exporter() -> Iterator[None]:
    """Hold back what torch's exporter says of itself; its errors are exceptions."""
    logger = logging.getLogger("torch.onnx")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.setLevel(level)


def _strip_notes(graph: onnx.GraphProto) -> None:
    """Drop the exporter's notes, which name paths on the machine that it ran on."""
    del graph.metadata_props[:]
    for parts in (graph.node, graph.input, graph.output, graph.value_info, graph.initializer):
        for part in parts:
            del part.metadata_props[:]
            part.doc_string = ""


def _metadata(cfg: QuadrupedEnvCfg) -> dict[str, str]:
    """Return what a program must know to run the graph, see `export_policy`."""
    # The look is no part of the physics, and may need meshes that are not here.
    model = build_scene(cfg.scene, pictured=False)
    joints = [model.joint(name) for name in JOINT_NAMES]
    servos = [_servo_of(model, joint.id) for joint in joints]
    stand = model.key("stand").qpos
    return {
        "joint_names": _comma_separated(JOINT_NAMES),
        "joint_stiffness": _comma_separated(model.actuator_gainprm[servos, 0].tolist()),
        "joint_damping": _comma_separated((-model.actuator_biasprm[servos, 2]).tolist()),
        "default_joint_pos": _comma_separated([float(stand[joint.qposadr[0]]) for joint in joints]),
        "action_scale": _comma_separated([cfg.action_scale] * len(joints)),
        "action_clip": repr(cfg.action_clip),
        "observation_names": _comma_separated(list(OBSERVATION_WIDTHS)),
        "observation_scales": json.dumps(
            {name: cfg.observations.scales[name] for name in OBSERVATION_WIDTHS}
        ),
        "command_names": _comma_separated(_COMMAND_NAMES),
        "control_dt": repr(cfg.step_dt),
    }


def _servo_of(model: mujoco.MjModel, joint: int) -> int:
    """Return the actuator that drives a joint."""
    return model.actuator_trnid[:, 0].tolist().index(joint)


def _comma_separated(values: Sequence[str | float]) -> str:
    return ",".join(value if isinstance(value, str) else repr(value) for value in values)
