"""Tests of the benchmark of the physics, on rollouts as short as can be."""

from __future__ import annotations

import json

import mujoco
import numpy as np
import pytest

from benchmarks import physics as benchmark
from benchmarks.physics import Variant
from mute.envs.scene import make_spec
from mute.support.errors import MuteError
from mute.tasks import FLAT_TASK, make_task


def test_it_compares_every_variant_with_the_scene_as_it_is(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(benchmark, "_WARM_UP", 2)
    monkeypatch.setattr(benchmark, "_STEPS", 2)
    monkeypatch.setattr(benchmark, "_FIDELITY_ROBOTS", 1)
    monkeypatch.setattr(benchmark, "_FIDELITY_SECONDS", 1.6)
    out = tmp_path / "new" / "physics.json"
    arguments = ["--num-envs", "3", "--turns", "6", "--json", "--out", str(out)]
    assert benchmark.main(arguments) == 0
    content = json.loads(capsys.readouterr().out)
    assert json.loads(out.read_text()) == content
    assert (content["stopped"], content["turns"]) == (None, 6)
    rates = {row["variant"]: row for row in content["rates"]}
    assert list(rates) == [variant.name for variant in benchmark.VARIANTS]
    reference = rates.pop("as it is")
    assert (reference["speed"], reference["speed_low"], reference["speed_high"]) == (1.0, 1.0, 1.0)
    for row in rates.values():
        assert 0.0 < row["speed_low"] <= row["speed"] <= row["speed_high"]
    walked = {row["variant"] for row in content["fidelity"]}
    assert walked < set(rates) | {"as it is"}
    # Half as many steps, of twice the length, are still the same walk.
    longer = [row for row in content["fidelity"] if row["variant"].startswith("2 steps")]
    assert [row["beta"] for row in longer] == [0.0, 1.0]
    assert all(0.0 < abs(row["force_rms"]) < 0.05 for row in longer)
    touching = {row["shape"]: row for row in content["touching"]}
    assert touching["foot"]["policy"] == 1.0
    assert 0.0 <= touching["shank"]["beginning"] <= 1.0


def _compiled(variant: benchmark.Variant) -> bytes:
    """Return all that a variant's robots are made of: model, control step and randomisation."""
    cfg = variant.cfg(make_task(FLAT_TASK).env)
    spec = make_spec(cfg.scene, pictured=variant.pictured)
    if variant.spec is not None:
        variant.spec(spec)
    model = spec.compile()
    content = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, content)
    settings = cfg.decimation, cfg.randomization, variant.trees
    return content.tobytes() + repr(settings).encode()


def test_every_variant_is_compiled_to_another_one_than_the_scene_as_it_is():
    as_it_is = _compiled(benchmark.AS_IT_IS)
    assert as_it_is == _compiled(benchmark.AS_IT_IS)
    same = Variant("the default", cfg=benchmark._scene(iterations=10))
    assert as_it_is == _compiled(same)  # an edit that edits nothing is found
    compiled = {variant.name: _compiled(variant) for variant in benchmark.VARIANTS}
    assert len(set(compiled.values())) == len(compiled)


def test_turns_before_a_stop_are_kept_and_the_file_says_that_it_was_cut_short(
    capsys, tmp_path, monkeypatch
):
    monkeypatch.setattr(benchmark, "_WARM_UP", 1)
    monkeypatch.setattr(benchmark, "_STEPS", 1)
    out = tmp_path / "physics.json"
    usual, calls, unfinished = benchmark._seconds, [], []

    def interrupted(*arguments) -> float:
        calls.append(arguments)
        if len(calls) > 3 * len(benchmark.VARIANTS):  # in the turn after the second that counts
            unfinished.append(json.loads(out.read_text()))
            raise KeyboardInterrupt
        return usual(*arguments)

    monkeypatch.setattr(benchmark, "_seconds", interrupted)
    with pytest.raises(KeyboardInterrupt):
        benchmark.main(["--num-envs", "2", "--turns", "6", "--json", "--out", str(out)])
    content = json.loads(out.read_text())
    assert (content["stopped"], content["turns"]) == ("interrupted", 2)
    assert len(content["rates"]) == len(benchmark.VARIANTS)
    assert (content["fidelity"], len(content["touching"])) == ([], 4)
    assert json.loads(capsys.readouterr().out) == content
    assert unfinished == [content | {"stopped": "not finished"}]


@pytest.mark.parametrize("option", ["--num-envs", "--turns"])
def test_a_number_that_cannot_be_is_refused(option):
    with pytest.raises(MuteError, match=option):
        benchmark.main([option, "0"])
