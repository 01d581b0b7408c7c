"""The table over seeds has every figure's mean and ends, and how many seeds meet its target."""

from __future__ import annotations

import json

import pytest

from mute.command_lines import card
from mute.command_lines.card_reliability import (
    median_seed,
    read_seeds,
    reliability_section,
    unmet,
)
from mute.evaluation.reliability.figures import Figure, Target
from mute.evaluation.tables import read_json, write_json
from mute.support.errors import MuteError
from mute.support.resources import RESOURCES
from mute.tasks import DEFAULT_TASK


def _falls(value: float) -> Figure:
    return Figure("falls", "robots that fall", value, "share", Target(below=0.01))


def _level(value: float) -> Figure:
    return Figure("stands", "level at the trunk", value, "dBA", Target(at_most=56.0))


def _write(folder, seed, *figures):
    content = {"robots": 64, "figures": [figure.as_dict() for figure in figures]}
    write_json(folder / f"seed{seed}.json", content)


def _section(folder) -> str:
    return reliability_section(read_seeds(folder), "python train.py", "docs/here")


def _rows(folder) -> list[str]:
    section = _section(folder)
    return [line for line in section.splitlines() if line.startswith("| ")][2:]


def test_a_figure_has_its_mean_its_ends_and_who_meets_its_target(tmp_path):
    for seed, (share, level) in enumerate([(0.0, 55.0), (0.02, 56.0), (0.004, 57.5)]):
        _write(tmp_path, seed, _falls(share), _level(level))
    assert _rows(tmp_path) == [
        "| falls | robots that fall | 0.8 % | 0.0 % | 2.0 % | < 1.0 % | 2 of 3 |",
        "| stands | level at the trunk | 56.2 dBA | 55 dBA | 57.5 dBA | <= 56 dBA | 2 of 3 |",
    ]


def test_what_could_not_be_had_of_a_seed_is_in_no_mean_and_meets_nothing(tmp_path):
    for seed, level in enumerate((float("nan"), 55.0, float("nan"))):
        _write(tmp_path, seed, _level(level))
    assert _rows(tmp_path) == [
        "| stands | level at the trunk | 55 dBA | 55 dBA | 55 dBA | <= 56 dBA | "
        "1 of 3, 2 without |",
    ]
    missed = unmet(read_seeds(tmp_path))
    assert missed.startswith("level at the trunk <= 56 dBA (stands): seed 0: ")
    assert "seed 2" in missed and "seed 1" not in missed


def test_seeds_that_were_asked_other_things_are_refused(tmp_path):
    _write(tmp_path, 0, _falls(0.0), _level(55.0))
    _write(tmp_path, 1, _falls(0.0))
    with pytest.raises(MuteError, match=r"seed1\.json, .* lacks 'level at the trunk' \(stands\)"):
        read_seeds(tmp_path)
    _write(tmp_path, 1, _falls(0.0), _level(55.0))
    write_json(tmp_path / "seed0_progress.json", {"randomized": True, "checkpoints": []})
    with pytest.raises(MuteError, match=r"seed1\.json, .* lacks 'million steps until it walks'"):
        read_seeds(tmp_path)


def test_seeds_that_were_asked_with_other_robots_are_refused(tmp_path):
    for seed, robots in enumerate((64, 8)):
        content = {"robots": robots, "figures": [_falls(0.0).as_dict()]}
        write_json(tmp_path / f"seed{seed}.json", content)
    with pytest.raises(MuteError, match=r"exams of \[8, 64\] robots"):
        read_seeds(tmp_path)


def test_the_steps_until_a_training_walks_are_read_from_its_progress(tmp_path):
    for seed, steps in enumerate((2_000_000, 4_000_000, None)):
        _write(tmp_path, seed, _falls(0.0))
        checkpoints = [{"steps": 100, "walks": False}]
        checkpoints += [{"steps": steps, "walks": True}] if steps else []
        write_json(
            tmp_path / f"seed{seed}_progress.json", {"randomized": True, "checkpoints": checkpoints}
        )
    assert _rows(tmp_path)[1] == (
        "| walks | million steps until it walks | never | 2 | never | <= 3 | 1 of 3 |"
    )


def test_trainings_that_all_walk_have_the_mean_of_their_steps(tmp_path):
    for seed, steps in enumerate((2_000_000, 4_000_000)):
        _write(tmp_path, seed, _falls(0.0))
        checkpoints = [{"steps": steps, "walks": True}]
        write_json(
            tmp_path / f"seed{seed}_progress.json", {"randomized": True, "checkpoints": checkpoints}
        )
    assert _rows(tmp_path)[1] == (
        "| walks | million steps until it walks | 3 | 2 | 4 | <= 3 | 1 of 2 |"
    )


def test_steps_of_exact_robots_are_said_to_be_theirs(tmp_path):
    _write(tmp_path, 0, _falls(0.0))
    checkpoints = [{"steps": 2_000_000, "walks": True}]
    write_json(tmp_path / "seed0_progress.json", {"checkpoints": checkpoints})
    assert "| walks | million steps until it walks, the exact robot | 2 |" in _rows(tmp_path)[1]


def test_what_is_not_met_is_told_with_the_seeds_that_miss_it(tmp_path):
    _write(tmp_path, 0, _falls(0.0), _level(55.0))
    assert unmet(read_seeds(tmp_path)) == ""
    _write(tmp_path, 1, _falls(0.02), _level(57.0))
    _write(tmp_path, 2, _falls(0.0), _level(56.5))
    assert unmet(read_seeds(tmp_path)) == (
        "robots that fall < 1.0 % (falls): seed 1: 2.0 %; "
        "level at the trunk <= 56 dBA (stands): seed 1: 57 dBA, seed 2: 56.5 dBA"
    )


def test_a_file_of_another_training_beside_is_refused(tmp_path):
    content = {"robots": 64, "policy_sha256": "a", "figures": [_falls(0.0).as_dict()]}
    write_json(tmp_path / "seed0.json", content)
    gait = {"at_speed": [], "range": [], "trials": 1, "seconds": 1.0, "policy_sha256": "b"}
    write_json(tmp_path / "seed0_gait.json", gait)
    with pytest.raises(MuteError, match=r"seed0_gait\.json .*policy_sha256"):
        read_seeds(tmp_path)
    # Files of earlier versions do not tell; what only one tells is no difference.
    del content["policy_sha256"]
    write_json(tmp_path / "seed0.json", content)
    assert read_seeds(tmp_path)[0].gait == gait


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
    assert "Over the seeds 2, 10, " in _section(tmp_path)
    assert "with 64 robots" in _section(tmp_path)


def test_a_file_of_another_command_is_refused_by_name(tmp_path):
    (tmp_path / "seed3.json").write_text(json.dumps({"checkpoints": []}))
    with pytest.raises(MuteError, match=r"seed3\.json is nothing that .*reliability.* wrote"):
        read_seeds(tmp_path)


def test_a_page_without_the_training_that_ships_is_refused(tmp_path):
    seed = read_json(RESOURCES / "go1" / "go1_mute.json")["seed"]
    with pytest.raises(MuteError, match=rf"no seed{seed}\.json, of what ships"):
        card.main(["--reliability", str(tmp_path)])
    (tmp_path / DEFAULT_TASK).mkdir()
    _write(tmp_path / DEFAULT_TASK, seed, _falls(0.0))  # but no gait
    with pytest.raises(MuteError, match=rf"no file at .*seed{seed}_gait\.json"):
        card.main(["--reliability", str(tmp_path)])


@pytest.mark.parametrize(
    ("changed", "named"),
    [({"iteration": 3}, "is of iteration 3, what ships of"), ({"range": []}, r"has betas \[\]")],
)
def test_a_training_that_is_not_as_what_ships_is_refused(changed, named, tmp_path):
    shipped, folder = read_json(RESOURCES / "go1" / "go1_mute.json"), tmp_path / DEFAULT_TASK
    folder.mkdir()
    for seed in (shipped["seed"], shipped["seed"] + 1):
        _write(folder, seed, _falls(0.0))
        write_json(folder / f"seed{seed}_gait.json", shipped["figures"])
    write_json(folder / f"seed{seed}_gait.json", shipped["figures"] | changed)
    with pytest.raises(MuteError, match=rf"seed{seed}_gait\.json {named}"):
        card.main(["--reliability", str(tmp_path)])


def _slower(share: float) -> Figure:
    return Figure("beta", "landings slower at beta 1, at 0.5 m/s", share, "share", Target(0.35))


def test_the_seed_in_the_middle_is_so_by_targets_met_and_then_by_how_much_slower_it_lands(
    tmp_path,
):
    for seed, (falls, share) in enumerate([(0.0, 0.5), (0.0, 0.36), (0.5, 0.6), (0.0, 0.4)]):
        _write(tmp_path, seed, _falls(falls), _slower(share))
    assert median_seed(read_seeds(tmp_path)) == 3  # of 2, 1, 3, 0 the better in the middle
    assert "is seed 3, the better of two." in _section(tmp_path)
    _write(tmp_path, 4, _falls(0.0), _slower(float("nan")))
    assert median_seed(read_seeds(tmp_path)) == 1  # of 4, 2, 1, 3, 0
    section = _section(tmp_path)
    assert "Of 2 targets they meet 2, 2, 1, 2 and 1; in the middle" in section
    assert "is seed 1." in section


def test_what_was_measured_of_a_gait_is_read_and_must_be_that(tmp_path):
    _write(tmp_path, 2, _falls(0.0))
    path = tmp_path / "seed2_gait.json"
    write_json(path, {"at_speed": [], "range": [], "trials": 1, "seconds": 1.0})
    assert read_seeds(tmp_path)[2].gait == {
        "at_speed": [],
        "range": [],
        "trials": 1,
        "seconds": 1.0,
    }
    write_json(path, {"range": []})
    with pytest.raises(MuteError, match=r"seed2_gait\.json is nothing that `evaluate\.py gait`"):
        read_seeds(tmp_path)
