"""The benchmark of ground compares every choice of it with flat ground."""

import json

import pytest

from benchmarks.terrain import VARIANTS, main
from mute.support.errors import MuteError


def test_every_ground_is_compared_with_flat_ground_and_kept(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("benchmarks.terrain._WARM_UP", 2)
    monkeypatch.setattr("benchmarks.terrain._STEPS", 2)
    out = tmp_path / "terrain.json"
    assert main(["--num-envs", "12", "--turns", "1", "--out", str(out), "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content == json.loads(out.read_text())
    assert (content["num_envs"], content["turns"]) == (12, 1)
    rows = {row["ground"]: row for row in content["rates"]}
    assert list(rows) == list(VARIANTS)
    assert rows["flat"]["speed"] == 1.0
    for row in rows.values():
        assert row["speed"] > 0.0
        assert row["steps_per_second"] > 0.0
        assert 0.0 < row["map_share"] < 1.0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--turns", "0"], "--turns must be an integer >= 1"),
        (["--num-envs", "0"], "--num-envs must be an integer >= 1"),
        (["--policy", "missing.pt"], r"missing\.pt"),
    ],
)
def test_a_bad_argument_is_told_by_name(words, message):
    with pytest.raises(MuteError, match=message):
        main(words)
