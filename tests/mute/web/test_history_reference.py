"""The page's tests read an export that looks back as exports do today."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import onnx
import torch
from places import REPOSITORY
from tensordict import TensorDict

from mute.envs.observations import OBS_DIM
from mute.web.history_reference import write_history_reference
from mute.web.reference_walks import OnnxController

REFERENCE = REPOSITORY / "web" / "test" / "reference"


def test_the_export_that_is_kept_has_a_history_and_the_operators_of_todays(tmp_path: Path):
    files = write_history_reference(tmp_path)
    assert [file.name for file in files] == ["history.onnx", "history.bin"]
    kept, todays = (onnx.load(folder / "history.onnx") for folder in (REFERENCE, tmp_path))
    assert {node.op_type for node in kept.graph.node} == {
        node.op_type for node in todays.graph.node
    }
    for model in (kept, todays):
        about = {entry.key: entry.value for entry in model.metadata_props}
        assert json.loads(about["recurrent_state"]) == {"history_in": "history_out"}


def test_the_actions_that_are_kept_are_those_of_the_export_beside_them():
    numbers = np.frombuffer((REFERENCE / "history.bin").read_bytes(), "<f4")
    steps = len(numbers) // (OBS_DIM + 12)
    seen, done = np.split(numbers, [steps * OBS_DIM])
    controller = OnnxController(REFERENCE / "history.onnx")
    for obs in seen.reshape(steps, 1, OBS_DIM):
        controller.act(TensorDict({"policy": torch.from_numpy(obs.copy())}, batch_size=1))
    np.testing.assert_allclose(controller.done, done.reshape(steps, 12), rtol=0.0, atol=1e-6)
