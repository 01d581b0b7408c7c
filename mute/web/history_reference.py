"""What the page's reading of exports is held to where a policy looks back: a history, no LSTM.

Policies of DreamWaQ's form have one. That none ships does not matter to how a graph is read, so it
is a policy that has learnt nothing, with small networks, and what ONNX Runtime makes of it.
"""

from __future__ import annotations

import dataclasses
import tempfile
from pathlib import Path

import numpy as np
import torch
from tensordict import TensorDict

from mute.checkpoint import save_checkpoint
from mute.config import TaskCfg, to_plain
from mute.controllers import load_policy
from mute.controllers.learned import Policy
from mute.controllers.onnx_export import export_policy
from mute.envs.observations import OBS_DIM
from mute.learning.runner import MuteRunner, policy_part
from mute.support.files import write_file
from mute.tasks import DREAMWAQ_TASK, make_task
from mute.web.reference_walks import OnnxController

__all__ = ["write_history_reference"]

_STEPS = 200
"""Control steps that are acted."""
_HIDDEN = (24, 16)
"""Widths of the networks."""


def write_history_reference(out: Path) -> list[Path]:
    """Export a policy that has learnt nothing, let it act, and write both into a directory.

    - `history.onnx`: the export;
    - `history.bin`: observations, drawn at random, then actions of ONNX Runtime, float32.

    Args:
        out: Where to; it is made if need be.

    Raises:
        MuteError: If a file cannot be written.
    """
    onnx_file, acted_file = out / "history.onnx", out / "history.bin"
    export_policy(_untrained(), onnx_file)
    controller = OnnxController(onnx_file)
    for obs in np.random.default_rng(0).normal(size=(_STEPS, 1, OBS_DIM)).astype(np.float32):
        controller.act(TensorDict({"policy": torch.from_numpy(obs)}, batch_size=1))
    rows = [np.stack(kept) for kept in (controller.seen, controller.done)]
    write_file(acted_file, b"".join(part.astype("<f4").tobytes() for part in rows))
    return [onnx_file, acted_file]


def _untrained() -> Policy:
    task = make_task(DREAMWAQ_TASK)
    network = dataclasses.replace(task.agent.estimation.network, history_hidden=_HIDDEN)
    estimation = dataclasses.replace(task.agent.estimation, network=network, num_mini_batches=1)
    agent = dataclasses.replace(
        task.agent, actor_hidden=_HIDDEN, critic_hidden=_HIDDEN, estimation=estimation
    )
    cfg = TaskCfg(env=dataclasses.replace(task.env, num_envs=2, num_threads=1), agent=agent)
    runner = MuteRunner(DREAMWAQ_TASK, cfg, None)
    payload = runner.alg.save() | {"task": DREAMWAQ_TASK, "config": to_plain(cfg), "iter": 0}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{DREAMWAQ_TASK}.pt"
        save_checkpoint(path, policy_part(payload))
        return load_policy(path)
