"""Tests of the benchmark of hearing, on a walk as short as can be."""

from __future__ import annotations

import json

import pytest

from benchmarks import sound as benchmark
from mute.support.errors import MuteError


def test_it_tells_time_and_memory_of_the_whole_and_the_time_of_each_part(capsys, tmp_path):
    out = tmp_path / "new" / "sound.json"
    arguments = ["--trials", "2", "--seconds", "1.1", "--json", "--out", str(out)]
    assert benchmark.main(arguments) == 0
    content = json.loads(capsys.readouterr().out)
    assert json.loads(out.read_text()) == content
    assert (content["floor"], content["trials"], content["seconds"]) == ("wood", 2, 1.1)
    parts = {part["name"]: part for part in content["parts"]}
    assert {name: part["robots"] for name, part in parts.items()} == {
        "whole": 2, "recorder": 2, "sound": 2,
        "lone recorder": 1, "lone energies": 1, "lone walk": 1, "lone live sound": 1,
    }  # fmt: skip
    for part in parts.values():
        assert part["simulated"] == pytest.approx(2.1)
        assert part["real_time"] == pytest.approx(part["simulated"] / part["wall"])
    lone = parts["lone recorder"]["wall"] + parts["lone energies"]["wall"]
    assert 0.0 < lone < parts["lone walk"]["wall"]
    # Walks of one and two seconds in processes of their own: either holds much the same.
    assert content["memory_mb"] > 100.0
    assert abs(content["memory_growth_mb"]) < 0.1 * content["memory_mb"]


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        (["--trials", "0"], "--trials"),
        (["--seconds", "1"], "--seconds"),
        (["--policy", "nobody.pt"], "nobody.pt"),
    ],
)
def test_it_refuses_bad_input_by_name(arguments, names):
    with pytest.raises(MuteError, match=names):
        benchmark.main(arguments)
