"""A policy that was exported as ONNX, as what drives robots; needs ONNX Runtime.

The file says what robots it is for and how to make its input (`onnx_export`); nothing else of its
training is known. Its recurrent state is kept here, robot by robot, as the graph takes one.
"""

from __future__ import annotations

import dataclasses
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict

from mute.checkpoint import CheckpointError, first_line
from mute.config import TaskCfg
from mute.envs.observations import OBS_DIM, OBSERVATION_WIDTHS
from mute.envs.quadruped_env import NUM_ACTIONS
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.scene import JOINT_NAMES, STAND_JOINT_POS
from mute.support.errors import MuteError
from mute.tasks import FLAT_TASK, make_task

__all__ = ["OnnxController", "OnnxPolicy", "load_onnx_policy"]

_COMMAND_NAMES = ("lin_vel_x", "lin_vel_y", "ang_vel_z", "beta")
_State = dict[str, NDArray[np.float32]]


@dataclass
class OnnxPolicy:
    """An exported policy, see `mute.controllers.driver.Driver`."""

    task: str
    """Name of the file: what it was trained for is not in it."""
    cfg: TaskCfg
    """The robots that it is for: those of the default task, with its gains, scales and rate."""
    session: Any
    """ONNX Runtime's session of the graph."""
    recurrent_state: dict[str, str]
    """Inputs of the recurrent state, and the outputs that they are next."""
    iteration: int = 0
    """It is not known."""

    @property
    def quiet_factor(self) -> bool:
        """Whether the action of a robot that stands still depends on beta."""
        obs = np.zeros((2, OBS_DIM), np.float32)
        obs[1, -1] = self.cfg.env.observations.scales["command"]
        loud, quiet = (self.step(one, self.initial_state())[0] for one in obs)
        return not np.array_equal(loud, quiet)

    def controller(self, cfg: QuadrupedEnvCfg) -> OnnxController:
        """Return what drives the robots of an environment with it, without a past."""
        return OnnxController(self, cfg.num_envs)

    def initial_state(self) -> _State:
        """Return the state of a robot without a past."""
        shapes = {node.name: node.shape for node in self.session.get_inputs()}
        return {name: np.zeros(shapes[name], np.float32) for name in self.recurrent_state}

    def step(self, obs: NDArray[np.float32], state: _State) -> tuple[NDArray[np.float32], _State]:
        """Return the action of one robot, and its next state.

        Args:
            obs: The group `policy` of its observation. Shape: (46,).
            state: What it remembers.

        Returns:
            The mean action. Shape: (12,). And the state.
        """
        names = ["action", *self.recurrent_state.values()]
        action, *parts = self.session.run(names, {"obs": obs[None], **state})
        return action[0], dict(zip(self.recurrent_state, parts, strict=True))


class OnnxController:
    """Drives robots with an exported policy; keeps the recurrent state of each."""

    def __init__(self, policy: OnnxPolicy, num_envs: int) -> None:
        """Start with no past.

        Args:
            policy: What to drive with.
            num_envs: Number of robots.
        """
        self.policy = policy
        self.num_envs = num_envs
        self._states = [policy.initial_state() for _ in range(num_envs)]

    def reset(self, mask: torch.Tensor | None = None) -> None:
        """Forget the past of the masked robots, or of all. Mask shape: (num_envs,)."""
        robots = range(self.num_envs) if mask is None else mask.nonzero().flatten().tolist()
        for robot in robots:
            self._states[robot] = self.policy.initial_state()

    def act(self, observations: TensorDict) -> torch.Tensor:
        """Return the mean actions for one control step. Shape: (num_envs, 12)."""
        actions = np.empty((self.num_envs, NUM_ACTIONS), np.float32)
        for robot, obs in enumerate(observations["policy"].float().numpy(force=True)):
            actions[robot], self._states[robot] = self.policy.step(obs, self._states[robot])
        return torch.from_numpy(actions)


def load_onnx_policy(path: Path) -> OnnxPolicy:
    """Load an exported policy.

    Raises:
        MuteError: If ONNX Runtime is not installed.
        CheckpointError: If the file is missing, damaged, foreign, or is for other robots.
    """
    session = _open(path)
    metadata = session.get_modelmeta().custom_metadata_map
    try:
        cfg = make_task(FLAT_TASK)
        cfg = dataclasses.replace(cfg, env=_robots(cfg.env, metadata))
        policy = OnnxPolicy(path.name, cfg, session, json.loads(metadata["recurrent_state"]))
    except KeyError as error:
        raise CheckpointError(f"{path} is no exported policy: it has no {error}") from error
    except (ValueError, TypeError, AttributeError) as error:
        raise CheckpointError(f"{path} is no policy for this robot: {first_line(error)}") from error
    _check_graph(path, policy)
    return policy


def _check_graph(path: Path, policy: OnnxPolicy) -> None:
    try:
        action, _ = policy.step(np.zeros(OBS_DIM, np.float32), policy.initial_state())
    except Exception as error:  # ONNX Runtime's own errors have no common class
        raise CheckpointError(f"{path} cannot be run: {first_line(error)}") from error
    if action.shape != (NUM_ACTIONS,):
        raise CheckpointError(f"{path} gives actions of shape {action.shape}, not ({NUM_ACTIONS},)")


def _open(path: Path) -> Any:  # noqa: ANN401
    try:
        import onnxruntime
    except ImportError as error:
        raise MuteError(
            f"{path} needs ONNX Runtime: pip install 'mute[onnx]', or in a checkout "
            "pip install -e '.[onnx]'"
        ) from error
    if not path.is_file():
        raise CheckpointError(f"there is no file {path}")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1  # the graph is too small to share
    try:
        content = path.read_bytes()
        return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # as above
        raise CheckpointError(f"{path} cannot be read: {first_line(error)}") from error


def _robots(cfg: QuadrupedEnvCfg, metadata: dict[str, str]) -> QuadrupedEnvCfg:
    """Return an environment of the robots that an exported policy is for.

    Raises:
        KeyError: If an entry is missing.
        ValueError: If one does not fit a Go1 as it is modelled here.
    """
    for name, ours in (
        ("joint_names", JOINT_NAMES),
        ("observation_names", tuple(OBSERVATION_WIDTHS)),
        ("command_names", _COMMAND_NAMES),
    ):
        if tuple(metadata[name].split(",")) != ours:
            raise ValueError(f"its {name} are {metadata[name]}, not {','.join(ours)}")
    stand = _numbers(metadata["default_joint_pos"])
    if not np.allclose(stand, STAND_JOINT_POS, atol=1e-4):
        raise ValueError(f"its default_joint_pos is {stand}, not {list(STAND_JOINT_POS)}")
    step_dt, timestep = float(metadata["control_dt"]), cfg.scene.timestep
    decimation = round(step_dt / timestep)
    if decimation < 1 or not math.isclose(decimation * timestep, step_dt, rel_tol=1e-6):
        raise ValueError(f"its control_dt is {step_dt} s, no multiple of {timestep} s")
    gains = {
        name: _common(f"joint_{name}", metadata[f"joint_{name}"])
        for name in ("stiffness", "damping")
    }
    scales = json.loads(metadata["observation_scales"])
    return dataclasses.replace(
        cfg,
        decimation=decimation,
        action_scale=_common("action_scale", metadata["action_scale"]),
        action_clip=float(metadata["action_clip"]),
        scene=dataclasses.replace(cfg.scene, **gains),
        observations=dataclasses.replace(cfg.observations, scales=scales),
    )


def _numbers(text: str) -> list[float]:
    return [float(number) for number in text.split(",")]


def _common(name: str, text: str) -> float:
    """Return the number that all joints share.

    Raises:
        ValueError: If they do not.
    """
    numbers = set(_numbers(text))
    if len(numbers) != 1:
        raise ValueError(f"its {name} differs between joints: {text}")
    return numbers.pop()
