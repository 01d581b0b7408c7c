"""The table over seeds has every figure's mean and ends, and how many seeds meet its target."""

from __future__ import annotations

import json

import pytest

from mute.command_lines import card
from mute.command_lines.card_reliability import read_seeds, reliability_section
from mute.evaluation.reliability.figures import Figure, Target
from mute.evaluation.tables import write_json
from mute.support.errors import MuteError


def _falls(value: float) -> Figure:
    return Figure("falls", "robots that fall", value, "share", Target(below=0.01))


def _level(value: float) -> Figure:
    return Figure("stands", "level at the trunk", value, "dBA", Target(at_most=56.0))


def _write(folder, seed, *figures):
    content = {"robots": 64, "figures": [figure.as_dict() for figure in figures]}
    write_json(folder / f"seed{seed}.json", content)


def _rows(folder) -> list[str]:
    section = reliability_section(read_seeds(folder))
    return [line for line in section.splitlines() if line.startswith("| ")][2:]


def test_a_figure_has_its_mean_its_ends_and_who_meets_its_target(tmp_path):
    for seed, (share, level) in enumerate([(0.0, 55.0), (0.02, 56.0), (0.004, 57.5)]):
        _write(tmp_path, seed, _falls(share), _level(level))
    assert _rows(tmp_path) == [
        "| falls | robots that fall | 0.8 % | 0.0 % | 2.0 % | < 1.0 % | 2 of 3 |",
        "| stands | level at the trunk | 56.2 dBA | 55 dBA | 57.5 dBA | <= 56 dBA | 2 of 3 |",
    ]


def test_what_a_seed_lacks_is_in_no_mean_and_meets_nothing(tmp_path):
    _write(tmp_path, 0, _level(float("nan")))
    _write(tmp_path, 1, _falls(0.0), _level(55.0))
    _write(tmp_path, 2)
    assert _rows(tmp_path) == [
        "| stands | level at the trunk | 55 dBA | 55 dBA | 55 dBA | <= 56 dBA | 1 of 3 |",
        "| falls | robots that fall | 0.0 % | 0.0 % | 0.0 % | < 1.0 % | 1 of 3 |",
    ]


def test_the_steps_until_a_training_walks_are_read_from_its_progress(tmp_path):
    for seed, steps in enumerate((2_000_000, 4_000_000, None)):
        _write(tmp_path, seed, _falls(0.0))
        checkpoints = [{"steps": 100, "walks": False}]
        checkpoints += [{"steps": steps, "walks": True}] if steps else []
        write_json(tmp_path / f"seed{seed}_progress.json", {"checkpoints": checkpoints})
    assert _rows(tmp_path)[1] == (
        "| walks | million steps until it walks | never | 2 | never | <= 3 | 1 of 3 |"
    )


def test_trainings_that_all_walk_have_the_mean_of_their_steps(tmp_path):
    for seed, steps in enumerate((2_000_000, 4_000_000)):
        _write(tmp_path, seed, _falls(0.0))
        checkpoints = [{"steps": steps, "walks": True}]
        write_json(tmp_path / f"seed{seed}_progress.json", {"checkpoints": checkpoints})
    assert _rows(tmp_path)[1] == (
        "| walks | million steps until it walks | 3 | 2 | 4 | <= 3 | 1 of 2 |"
    )


def test_a_file_of_a_training_with_another_seed_than_its_name_is_refused(tmp_path):
    for trained in (3, 4):
        content = {"robots": 64, "trained_seed": trained, "figures": [_falls(0.0).as_dict()]}
        write_json(tmp_path / "seed3.json", content)
        if trained == 3:
            assert list(read_seeds(tmp_path)) == [3]
    with pytest.raises(MuteError, match=r"seed3\.json is of a policy that was trained with seed 4"):
        read_seeds(tmp_path)


def test_seeds_stand_in_their_order_and_other_files_are_left_alone(tmp_path):
    for seed in (10, 2):
        _write(tmp_path, seed, _falls(0.0))
    (tmp_path / "seed_shipped.json").write_text("no JSON at all")
    assert list(read_seeds(tmp_path)) == [2, 10]
    assert "Over the seeds 2, 10, " in reliability_section(read_seeds(tmp_path))
    assert "with 64 robots" in reliability_section(read_seeds(tmp_path))


def test_a_file_of_another_command_is_refused_by_name(tmp_path):
    (tmp_path / "seed3.json").write_text(json.dumps({"checkpoints": []}))
    with pytest.raises(MuteError, match=r"seed3\.json is nothing that .*reliability.* wrote"):
        read_seeds(tmp_path)


def test_the_page_has_the_table_once_there_are_files(tmp_path, capsys):
    heading = "## Whether one can rely on it"
    card.main(["--reliability", str(tmp_path)])
    assert heading not in capsys.readouterr().out
    _write(tmp_path, 0, _falls(0.0))
    card.main(["--reliability", str(tmp_path)])
    assert heading in capsys.readouterr().out
