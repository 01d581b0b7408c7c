"""Tests of the benchmark and of the files of a release."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Sequence

import numpy as np
import pytest
import torch
from bare_go1 import BareGo1
from places import REPOSITORY

from mute import tasks
from mute.command_lines import benchmark
from mute.command_lines.arguments import parse, spelled
from mute.command_lines.benchmark_figures import figures_of, ratios, shortfall
from mute.command_lines.benchmark_peers import PeerRate
from mute.command_lines.benchmark_turns import Block, Times, times_of
from mute.envs.batch_simulation import BatchSimulation
from mute.envs.quadruped_env import NUM_ACTIONS
from mute.envs.scene import STAND_JOINT_POS, build_scene
from mute.support import provenance
from mute.support.errors import MuteError
from mute.tasks import FLAT_TASK, make_task

_PARTS = ("engine", "nominal_engine", "environment", "collection", "learning", "loop")


def test_two_versions_take_turns_and_every_part_of_both_is_printed_as_json(capsys):
    against = ["--against", f"{sys.executable}:{REPOSITORY}"]
    peers = ["--peers", "gymnasium,mjlab", "--mjlab-python", "/nowhere/python"]
    argv = ["--num-envs", "4", "--rollouts", "1", "--json", *against, *peers]
    assert benchmark.main(argv) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["stopped"] is None
    assert set(content["parts"]) == set(_PARTS)
    assert content["versions"]["old"] == content["versions"]["new"]
    assert content["versions"]["old"]["torch"] == torch.__version__
    (row,) = content["rates"]
    assert (row["num_envs"], row["blocks"], row["turns"]) == (4, 1, 1)
    for version in (row, row["old"]):
        assert all(version[name] > 0.0 for name in _PARTS)
        # The loop is collection and learning, one after the other.
        apart = 1.0 / version["collection"] + 1.0 / version["learning"]
        assert 1.0 / version["loop"] == pytest.approx(apart)
        of_nominal = version["loop"] / version["nominal_engine"]
        assert version["loop_over_nominal_engine"] == pytest.approx(of_nominal)
        assert version["intervals"]["loop"] == [None, None]  # a block alone has none
        assert version["peak_memory_mb"] > 100.0
    for name in (*_PARTS, "peak_memory_mb"):
        assert row["new_over_old"][name] == pytest.approx(row[name] / row["old"][name])
    assert "1 blocks are too few for 3.0%" in row["not_precise"]
    itself, gymnasium, mjlab = content["peers"]
    assert [peer["name"] for peer in content["peers"]] == ["mute", "gymnasium", "mjlab"]
    assert (itself["num_envs"], itself["task"]) == (4, "go1_mute_flat")
    assert min(itself["environment"], itself["loop"], gymnasium["environment"]) > 0.0
    assert gymnasium["over_mute"]["environment"] > 0.0
    assert gymnasium["version"].startswith("1.")
    assert (gymnasium["num_envs"] % 4, gymnasium["loop"]) == (0, None)
    told = "/nowhere/python does not start: No such file or directory"
    assert (mjlab["environment"], mjlab["note"]) == (None, told)


@pytest.fixture
def _own_task(tmp_path, monkeypatch):
    """Work in a folder with a module that registers a task, and forget both afterwards."""
    (tmp_path / "mute_own_walk.py").write_text(
        "from mute.tasks import make_task, register_task\n"
        "register_task('own_walk', lambda: make_task('go1_mute'))\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(tasks, "_TASKS", dict(tasks._TASKS))
    yield
    sys.modules.pop("mute_own_walk", None)


@pytest.mark.usefixtures("_own_task")
def test_a_task_of_a_users_own_module_is_measured(capsys):
    argv = ["--task", "mute_own_walk:own_walk", "--num-envs", "4", "--rollouts", "1", "--json"]
    assert benchmark.main(argv) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["task"] == "own_walk"
    assert content["rates"][0]["loop"] > 0.0


_READY = {"new": {"control_steps": 48, "peak_memory_mb": 700.0, "engine": "constructed"}}


def _constructed(loops: Sequence[Sequence[float]], engine: float = 0.5) -> list[Block]:
    """Return blocks of turns, s, in which the loop's alone differ."""
    return [
        Block(
            _READY,
            {"new": {name: [engine] * len(own) for name in _PARTS} | {"loop": list(own)}},
        )
        for own in loops
    ]


def _times(loops: Sequence[Sequence[float]]) -> dict[str, Times]:
    return times_of(_constructed(loops))


def _args(*words: str) -> benchmark.BenchmarkArgs:
    return parse(benchmark.BenchmarkArgs, words, "")


def _turns_until_enough(loops: Sequence[Sequence[float]], *words: str) -> int:
    """Return how many turns are taken, of blocks that would go on."""
    args = _args(*words)
    turns = 0
    for number in range(len(loops)):
        for last in range(1, args.block_turns + 1):
            turns += 1
            taken = [*loops[:number], loops[number][:last]]
            if benchmark._enough(_constructed(taken), args):
                return turns
    raise AssertionError("never enough")


def test_blocks_that_all_say_the_same_are_enough_once_there_are_six():
    assert _turns_until_enough([[1.0] * 3] * 20) == 18
    assert _turns_until_enough([[1.0] * 5] * 20, "--block-turns", "5") == 30


def test_blocks_go_on_until_half_the_interval_of_every_ratio_is_within_the_precision():
    # Of blocks of 0.94, 1.00 and 1.06 s, a third each, it takes many until neither bound is of the
    # outer ones.
    loops = [[seconds] * 3 for seconds in [0.94, 1.0, 1.06] * 30]
    turns = _turns_until_enough(loops, "--max-turns", "270")
    ratios = [0.5 / seconds for seconds, *_ in loops]
    blocks = turns // 3
    assert turns % 3 == 0  # it is looked at after whole blocks alone
    assert blocks > 20
    assert _half_width(sorted(ratios[:blocks])) <= 0.03
    assert _half_width(sorted(ratios[: blocks - 1])) > 0.03
    assert _turns_until_enough(loops, "--precision", "0.07") == 18


def _half_width(ratios: Sequence[float]) -> float:
    """Return half the interval over the median, by counting the binomial's outcomes."""
    number = len(ratios)
    outside, rank = 0, 0
    while 2 * (outside + math.comb(number, rank)) <= 0.05 * 2**number:
        outside += math.comb(number, rank)
        rank += 1
    middle = 0.5 * (ratios[(number - 1) // 2] + ratios[number // 2])
    return 0.5 * (ratios[number - rank] - ratios[rank - 1]) / middle


def test_turns_that_agree_within_their_block_alone_do_not_make_the_interval_narrow():
    # Sixty turns, ten of each block: were each a value, the interval would be of no width at all.
    loops = [[0.9] * 10, [1.1] * 10, *[[1.0] * 10] * 4]
    loop = figures_of(_times(loops)["new"], _READY["new"])
    assert loop["loop"] == 48.0
    assert loop["intervals"]["loop"] == [48.0 / 1.1, 48.0 / 0.9]


def test_an_interval_of_the_medians_of_dependent_turns_holds_the_true_one_as_often_as_it_says():
    # A process has a speed of its own, and its turns are as an autoregression of 0.5.
    generator = np.random.default_rng(0)
    held, held_by_turns = 0, 0
    for _ in range(300):
        loops = []
        for _ in range(8):
            level = wave = 0.05 * generator.standard_normal()
            turns = []
            for _ in range(3):
                wave = level + 0.5 * (wave - level) + 0.02 * generator.standard_normal()
                turns.append(math.exp(wave))
            loops.append(turns)
        held += _holds(loops, 48.0)
        held_by_turns += _holds([[turn] for turns in loops for turn in turns], 48.0)
    assert held / 300 >= 0.95
    assert held_by_turns / 300 < 0.9  # were each turn a value of its own


def _holds(loops: Sequence[Sequence[float]], rate: float) -> bool:
    low, high = figures_of(_times(loops)["new"], _READY["new"])["intervals"]["loop"]
    return low <= rate <= high


def test_blocks_that_never_agree_end_at_the_most_turns_and_that_is_told_in_one_line():
    loops = [[0.5] * 3, [2.0] * 3] * 20
    assert _turns_until_enough(loops, "--max-turns", "40") == 40
    told = shortfall(_times(loops), 0.03)
    assert told == ("40 blocks are too few for 3.0%: the 95% interval of loop / engine is ±60.0%")


def test_as_many_turns_are_taken_as_asked_for_however_precise():
    assert _turns_until_enough([[1.0] * 3] * 20, "--rollouts", "25") == 25
    assert _turns_until_enough([[0.5] * 3, [2.0] * 3], "--rollouts", "4") == 4


def test_ratios_are_taken_turn_by_turn():
    # Turns say 1/2, 1/6 and 1/2; the medians of the times, 1 and 6, would say 1/6.
    times: Times = {name: [[1.0, 1.0, 3.0]] for name in _PARTS} | {"loop": [[2.0, 6.0, 6.0]]}
    assert ratios({"new": times})["loop_over_engine"].median == 0.5
    both = ratios({"new": times, "old": {name: [[6.0, 6.0, 9.0]] for name in _PARTS}})
    assert both["loop_new_over_old"].median == 1.5
    assert both["engine_new_over_old"].median == 6.0


def test_rates_are_control_steps_over_the_median_over_blocks_of_the_medians_of_turns():
    figures = figures_of(
        _times([[2.0, 2.0, 9.0]] * 5 + [[3.0, 3.0, 0.1]] * 4)["new"], _READY["new"]
    )
    assert (figures["loop"], figures["engine"]) == (24.0, 96.0)
    assert figures["intervals"]["loop"] == [16.0, 24.0]
    assert figures["peak_memory_mb"] == 700.0


def test_memory_is_the_most_of_any_block():
    blocks = _constructed([[1.0], [1.0]])
    blocks[1].ready = {"new": {**_READY["new"], "peak_memory_mb": 800.0}}
    assert benchmark._row(4, blocks, 0.03)["peak_memory_mb"] == 800.0


@pytest.mark.parametrize(
    ("stop", "told"),
    [(KeyboardInterrupt(), "interrupted"), (MuteError("gone"), "--num-envs 8: gone")],
)
def test_what_was_measured_before_a_stop_is_written_and_printed(
    stop, told, tmp_path, monkeypatch, capsys
):
    sizes = iter([False, True])

    def blocks(*_: object):
        stops = next(sizes)
        for number in (1, 2, 3):
            yield _constructed([[2.0] * number])
        if stops:
            raise stop

    monkeypatch.setattr(benchmark, "take_blocks", blocks)
    argv = ["--num-envs", "4", "8", "--out", str(tmp_path / "rates.json")]
    # The first size has its three turns, the second one is cut short after as many.
    rollouts = iter([False, False, True, False, False, False])
    monkeypatch.setattr(benchmark, "_enough", lambda *_: next(rollouts))
    with pytest.raises(type(stop)):
        benchmark.main(argv)
    content = json.loads((tmp_path / "rates.json").read_text())
    assert content["stopped"] == told
    assert [(row["num_envs"], row["turns"]) for row in content["rates"]] == [(4, 3), (8, 3)]
    assert [row["loop"] for row in content["rates"]] == [24.0, 24.0]
    assert "8 environments, medians of 1 blocks" in capsys.readouterr().out


def test_rounds_of_peers_before_a_stop_are_written_as_they_come(tmp_path, monkeypatch, capsys):
    out = tmp_path / "rates.json"
    unfinished = []

    def blocks(*_: object):
        yield _constructed([[2.0]])

    def peers(*_: object, after_round) -> None:
        for rounds in (1, 2):
            after_round(
                [PeerRate("mute", environment=100.0 * rounds, rounds={"environment": rounds})]
            )
            unfinished.append(json.loads(out.read_text()))
        raise KeyboardInterrupt

    monkeypatch.setattr(benchmark, "take_blocks", blocks)
    monkeypatch.setattr(benchmark, "time_peers", peers)
    argv = ["--num-envs", "4", "--rollouts", "1", "--peers", "gymnasium", "--out", str(out)]
    with pytest.raises(KeyboardInterrupt):
        benchmark.main(argv)
    assert [file["stopped"] for file in unfinished] == ["not finished"] * 2
    assert [file["peers"][0]["environment"] for file in unfinished] == [100.0, 200.0]
    content = json.loads(out.read_text())
    assert content["stopped"] == "interrupted"
    assert content["peers"][0]["environment"] == 200.0
    assert "peers, control steps/s" in capsys.readouterr().out


def test_nothing_is_written_over_a_file_when_nothing_was_measured(tmp_path, monkeypatch):
    def blocks(*_: object):
        raise KeyboardInterrupt
        yield

    monkeypatch.setattr(benchmark, "take_blocks", blocks)
    out = tmp_path / "rates.json"
    out.write_text("earlier")
    with pytest.raises(KeyboardInterrupt):
        benchmark.main(["--num-envs", "4", "--out", str(out)])
    assert out.read_text() == "earlier"


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        (["--num-envs", "0"], "--num-envs"),
        (["--rollouts", "0"], "--rollouts"),
        (["--task", "fly"], "--task"),
        (["--peers", "isaac"], "--peers"),
        (["--peers", "mjlab,mjlab"], "--peers"),
        (["--precision", "0"], "--precision must be"),
        (["--max-turns", "17"], "--max-turns must be"),
        (["--block-turns", "11"], "--max-turns must be"),
        (["--block-turns", "0"], "--block-turns must be"),
        (["--seeds", "1", "1"], "--seeds must name each but once"),
        (["--against", "/nowhere/python"], "'/nowhere/python' is no interpreter"),
        (["--against", f"{sys.executable}:/nowhere"], "checkout of MUTE after ':', got '/nowhere'"),
        (["--against", f"{sys.executable}:"], "checkout of MUTE after ':', got ''"),
        (["--until-walking", "--peers", "all"], "--until-walking"),
    ],
)
def test_the_benchmark_refuses_bad_input_by_name(arguments, names):
    with pytest.raises(MuteError, match=names):
        benchmark.main(arguments)


def test_what_decides_on_the_measurement_is_kept_as_it_is_typed():
    args = _args("--num-envs", "8", "16", "--max-turns", "18", "--json")
    assert spelled(args, benchmark._MEASURING) == " --num-envs 8 16 --max-turns 18"
    assert spelled(_args(), benchmark._MEASURING) == ""


def test_a_version_that_changes_while_it_is_measured_is_refused():
    about = {"control_steps": 24, "peak_memory_mb": 500.0, "commit": "a"}
    blocks = [Block({"new": about | {"peak_memory_mb": float(size)}}, {}) for size in (5, 6)]
    assert benchmark._same_versions(blocks) == {"new": {"commit": "a"}}
    blocks.append(Block({"new": about | {"commit": "b"}}, {}))
    with pytest.raises(MuteError, match=r"the new version has changed .* from .*'a'.* to .*'b'"):
        benchmark._same_versions(blocks)


def test_the_robots_of_gymnasium_move_as_those_of_the_engine():
    cfg = make_task(FLAT_TASK).env
    simulation = BatchSimulation(build_scene(cfg.scene, pictured=False), 1)
    model, batch = simulation.model, simulation._batch
    ctrl, qpos = batch.bind("ctrl"), batch.bind("qpos")
    batch.reset(keyframe=model.key("stand").id)
    robot = BareGo1(cfg)
    assert robot._model.opt.disableflags == model.opt.disableflags
    start, _ = robot.reset(seed=0)
    observation = start
    for action in 0.1 * np.random.default_rng(0).standard_normal((20, NUM_ACTIONS)):
        ctrl[:] = np.add(STAND_JOINT_POS, action)
        batch.step(nstep=cfg.decimation)
        observation, *_ = robot.step(action)
    np.testing.assert_allclose(observation[: model.nq], qpos[0], atol=1e-9)
    assert np.abs(observation - start).max() > 0.05


def test_the_machine_is_told_with_its_cores():
    assert " core" in provenance.machine_kind()
