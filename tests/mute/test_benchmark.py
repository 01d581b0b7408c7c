"""Tests of the benchmark and of the files of a release."""

from __future__ import annotations

import json

import pytest

from mute import benchmark, provenance
from mute.errors import MuteError


def test_the_benchmark_prints_the_rates_of_every_part_as_json(capsys):
    assert benchmark.main(["--num-envs", "4", "--rollouts", "1", "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    (rates,) = content["rates"]
    assert rates["num_envs"] == 4
    parts = [rates[name] for name in ("engine", "environment", "collection", "learning", "loop")]
    assert all(rate > 0.0 for rate in parts)
    # The loop is collection and learning, one after the other.
    assert 1.0 / rates["loop"] == pytest.approx(1.0 / rates["collection"] + 1.0 / rates["learning"])
    assert rates["loop_over_engine"] == pytest.approx(rates["loop"] / rates["engine"])
    assert rates["peak_memory_mb"] > 100.0


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        (["--num-envs", "0"], "--num-envs"),
        (["--rollouts", "0"], "--rollouts"),
        (["--task", "fly"], "--task"),
    ],
)
def test_the_benchmark_refuses_bad_input_by_name(arguments, names):
    with pytest.raises(MuteError, match=names):
        benchmark.main(arguments)


def test_the_machine_is_told_with_its_cores():
    assert "cores" in provenance.machine_kind()
