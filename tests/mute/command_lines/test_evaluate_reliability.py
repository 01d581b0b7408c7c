"""`evaluate.py reliability` writes every figure beside its target, and keeps what is measured."""

from __future__ import annotations

import csv
import dataclasses
import json

import pytest
from exam_helpers import saved_random_policy

from mute.checkpoint import save_checkpoint
from mute.command_lines import evaluate, evaluate_reliability
from mute.evaluation.reliability import beta_acts, falls, follows, stands, starts
from mute.evaluation.reliability.parts import PARTS
from mute.support.errors import MuteError


@pytest.fixture(scope="module")
def policy_path(tmp_path_factory):
    path = tmp_path_factory.mktemp("policy") / "policy.pt"
    save_checkpoint(path, saved_random_policy())
    return path


@pytest.fixture
def short(monkeypatch):
    """Shorten every trial."""
    times = {
        starts: {"STAND_TIME": 0.1, "TRIAL_TIME": 0.6},
        follows: {"_WALK_TIME": 0.1, "_RANGE_TIME": 0.1, "_CHANGE_TIME": 0.1},
        stands: {"_WALK_TIME": 0.1, "SETTLE_TIME": 0.1, "_STAND_TIME": 0.5, "_RECOVERY_TIME": 0.6},
        beta_acts: {"_WALK_TIME": 0.1, "_HEARD_TIME": 0.5},
        falls: {"_EPISODE": 0.1},
    }
    for module, values in times.items():
        for name, value in values.items():
            monkeypatch.setattr(module, name, value)


def _measure(policy_path, out, *words):
    arguments = ["reliability", "--policy", str(policy_path), "--robots", "1", "--out", str(out)]
    return evaluate.main([*arguments, *words])


def test_every_part_is_measured_and_written_with_its_targets(policy_path, tmp_path, short, capsys):
    assert _measure(policy_path, tmp_path) == 0
    content = json.loads((tmp_path / "reliability.json").read_text())
    assert list(dict.fromkeys(figure["part"] for figure in content["figures"])) == list(PARTS)
    names = [(figure["part"], figure["name"]) for figure in content["figures"]]
    assert len(set(names)) == len(names)
    assert all(figure["target"] for figure in content["figures"])
    assert (content["robots"], content["trained_seed"], content["iteration"]) == (1, 0, 0)
    rows = list(csv.DictReader((tmp_path / "reliability.csv").open()))
    assert [(row["part"], row["name"]) for row in rows] == names
    for name, table in content["tables"].items():
        with (tmp_path / f"reliability_{name}.csv").open() as file:
            assert len(list(csv.DictReader(file))) == len(table)
    shown = capsys.readouterr().out
    assert "NOT MET" in shown
    assert "0.3 m/s backward" in shown


def test_the_work_that_is_told_is_the_work_that_was_announced(
    policy_path, tmp_path, short, monkeypatch
):
    told: dict[str, float] = {}

    def noted(name):
        def measure(policy, robots, seed, on_work):
            def note(work):
                told[name] = told.get(name, 0.0) + work
                on_work(work)

            return PARTS[name].measure(policy, robots, seed, note)

        return measure

    spied = {name: dataclasses.replace(part, measure=noted(name)) for name, part in PARTS.items()}
    monkeypatch.setattr(evaluate_reliability, "PARTS", spied)
    assert _measure(policy_path, tmp_path) == 0
    assert told == pytest.approx({name: part.work(1) for name, part in PARTS.items()})


def test_json_prints_one_object_and_a_target_missed_is_status_1_where_asked(
    policy_path, tmp_path, short, capsys
):
    words = ("--parts", "starts,falls", "--json", "--check")
    assert _measure(policy_path, tmp_path, *words) == 1
    printed = json.loads(capsys.readouterr().out)
    assert {figure["part"] for figure in printed["figures"]} == {"starts", "falls"}
    assert printed == json.loads((tmp_path / "reliability.json").read_text())
    assert not all(figure["met"] for figure in printed["figures"])


def test_with_all_targets_met_check_ends_with_status_0(policy_path, tmp_path, short):
    # In a tenth of a second nobody falls.
    assert _measure(policy_path, tmp_path, "--parts", "falls", "--check") == 0


def test_an_interrupt_keeps_the_parts_that_are_whole(
    policy_path, tmp_path, short, monkeypatch, capsys
):
    def interrupt(*arguments):
        raise KeyboardInterrupt

    stopped = dataclasses.replace(PARTS["falls"], measure=interrupt)
    monkeypatch.setattr(evaluate_reliability, "PARTS", PARTS | {"falls": stopped})
    assert _measure(policy_path, tmp_path, "--parts", "starts", "falls") == 130
    content = json.loads((tmp_path / "reliability.json").read_text())
    assert {figure["part"] for figure in content["figures"]} == {"starts"}
    assert "interrupted; measured: starts\n" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--robots", "0"), "--robots must be an integer >= 1 .* got 0"),
        (("--seed", "-1"), "--seed must be .* got -1"),
        (("--parts", "dances"), "--parts must be of starts, .* got 'dances'"),
        (("--parts", "falls,falls"), "--parts must name each but once, got falls again"),
        (("--parts",), "--parts must name at least one, got none"),
        (("--policy", "missing.pt"), "missing.pt"),
    ],
)
def test_bad_input_is_refused_by_name(words, message):
    with pytest.raises(MuteError, match=message):
        evaluate.main(["reliability", *words])
