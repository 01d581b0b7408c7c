"""Walks in Python that the page's are held to: from the same state, on the same commands.

Each is one robot from the exact stance, driven by ONNX Runtime. What it did goes into files
that are small enough to be kept beside the page's tests.
"""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
import torch
from tensordict import TensorDict

from mute.acoustics.audible_env import listening_cfg
from mute.acoustics.listener import Listener
from mute.controllers.command import Command
from mute.controllers.learned import Policy
from mute.controllers.onnx_export import export_policy
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.terrain import TerrainCfg
from mute.evaluation.trials import evaluation_cfg, from_the_stance, run_trial
from mute.support.files import write_file
from mute.support.plain_data import laid_out, without_nan
from mute.support.provenance import file_sha256

__all__ = ["OnnxController", "write_reference"]

_SECONDS = 20.0
"""Time that is walked, s."""

_SETTLE_TIME = 1.0
"""Time at the start that figures leave out, s."""

_ACTED_STEPS = 500
"""Control steps of the first walk whose observations and actions are kept."""

_FOLLOWED_STEPS = 100
"""Control steps of each walk whose states are kept: 2 s."""


@dataclass(frozen=True)
class _Walk:
    """What is walked."""

    name: str
    command: Command
    terrain: str = "flat"
    level: int = 0
    surface: str = "wood"


_WALKS = (
    _Walk("loud", Command(vx=0.5, beta=0.0)),
    _Walk("quiet", Command(vx=0.5, beta=1.0)),
    _Walk("turning", Command(vx=0.3, vy=0.1, wz=0.5, beta=0.5)),
    _Walk("stairs", Command(vx=0.5, beta=0.0), terrain="stairs"),
    _Walk("carpet", Command(vx=0.4, beta=0.3), surface="carpet"),
)


class OnnxController:
    """Drives one robot by the exported file in ONNX Runtime, and keeps what it saw and did."""

    def __init__(self, path: Path) -> None:
        """Load an exported policy."""
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        self._session = onnxruntime.InferenceSession(
            path.read_bytes(), options, providers=["CPUExecutionProvider"]
        )
        metadata = self._session.get_modelmeta().custom_metadata_map
        self._recurrent: dict[str, str] = json.loads(metadata["recurrent_state"])
        self._shapes = {node.name: node.shape for node in self._session.get_inputs()}
        self.num_envs = 1
        self.reset()

    def reset(self, mask: torch.Tensor | None = None) -> None:
        """Forget the past. Mask shape: (1,)."""
        if mask is None or bool(mask.all()):
            self._state = {
                name: np.zeros(self._shapes[name], np.float32) for name in self._recurrent
            }
            self.seen: list[np.ndarray] = []
            """Observations since then. Shape of each: (OBS_DIM,)."""
            self.done: list[np.ndarray] = []
            """Actions since then. Shape of each: (12,)."""

    def act(self, observations: TensorDict) -> torch.Tensor:
        """Return the action for one control step. Shape: (1, 12)."""
        obs = observations["policy"].numpy()
        names = ["action", *self._recurrent.values()]
        action, *state = self._session.run(names, {"obs": obs, **self._state})
        self._state = dict(zip(self._recurrent, state, strict=True))
        self.seen.append(obs[0].copy())
        self.done.append(np.asarray(action)[0].copy())
        return torch.from_numpy(np.asarray(action))


def write_reference(policy: Policy, policy_file: Path, out: Path) -> list[Path]:
    """Walk, and write what was done into a directory, which is made if need be.

    - `walks.json`: by the name of the walk: command, ground, first state, figures, levels, and the
      positions of the first 2 s;
    - `acted.bin`: observations, then actions, of 500 control steps of the first walk, float32.

    Args:
        policy: What walks.
        policy_file: The file that it is from, whose digest is kept.
        out: Where to.

    Raises:
        MuteError: If a file cannot be written.
    """
    out.mkdir(parents=True, exist_ok=True)
    onnx_file = out / "exported.onnx"
    export_policy(policy, onnx_file)
    walks: dict[str, Any] = {}
    acted = b""
    for walk in _WALKS:
        controller = OnnxController(onnx_file)
        walks[walk.name] = _walk(policy, controller, walk)
        if not acted:
            rows = [np.stack(kept[:_ACTED_STEPS]) for kept in (controller.seen, controller.done)]
            acted = b"".join(part.astype("<f4").tobytes() for part in rows)
    onnx_file.unlink()
    content = {"policy_sha256": file_sha256(policy_file), "walks": without_nan(walks)}
    files = {"walks.json": (laid_out(content) + "\n").encode(), "acted.bin": acted}
    for name, data in files.items():
        write_file(out / name, data)
    return [out / name for name in files]


def _walk(policy: Policy, controller: OnnxController, walk: _Walk) -> dict[str, Any]:
    """Walk and return what is kept of it."""
    env = QuadrupedEnv(_cfg(policy.cfg.env, walk))
    env.reset()
    simulation = env.simulation
    first = {name: getattr(simulation, name)[0].double().tolist() for name in ("qpos", "qvel")}
    positions: list[list[float]] = []

    def follow(_: object, dones: torch.Tensor) -> None:
        listener.listen(dones)
        if len(positions) < _FOLLOWED_STEPS:
            positions.append([round(x, 7) for x in simulation.qpos[0].double().tolist()])

    steps = round(_SECONDS / env.step_dt)
    with Listener(env, [walk.surface], settle_time=_SETTLE_TIME) as listener:
        command = walk.command.tensor()
        meter = run_trial(env, controller, command, steps, follow)
    levels = listener.levels()[0]
    return {
        "command": dataclasses.asdict(walk.command),
        "terrain": walk.terrain,
        "level": walk.level,
        "surface": walk.surface,
        "seconds": _SECONDS,
        "settle_time": _SETTLE_TIME,
        "first_state": first,
        "positions": positions,
        "gait": meter.gait().as_dict(),
        "mnl": levels.mnl,
        "pnl": levels.pnl,
    }


def _cfg(cfg: QuadrupedEnvCfg, walk: _Walk) -> QuadrupedEnvCfg:
    ground = TerrainCfg(kind=walk.terrain, first_levels=(walk.level, walk.level), curriculum=False)
    measured = evaluation_cfg(cfg, 1, _SECONDS, 0, terrain=ground)
    return listening_cfg(from_the_stance(measured), walk.surface)
