"""`evaluate.py paper`: really run in small, stopped and resumed, and its report."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from comparison_rows import make_row
from dreamwaq_helpers import write_dreamwaq_policy
from places import SHIPPED_POLICY
from policy_variants import write_variant

from mute.acoustics import origin
from mute.command_lines import evaluate, evaluate_paper, paper_calibration, paper_measurements
from mute.command_lines.card_comparison import comparison_report
from mute.support.errors import MuteError
from mute.support.provenance import file_sha256


def _row(label: str, part: str, surface: str, beta: float, speed: float) -> dict[str, Any]:
    mnl = {"MPC": 75.0, "DreamWaQ": 72.0}.get(label, 69.0 - 3.0 * beta) + speed
    falls = (label, surface) == ("MPC", "tile")
    return make_row(
        *(label, mnl, surface, speed),
        part=part,
        policy=f"{label}.pt",
        training_seed=3,
        method=label.partition(",")[0],
        beta=beta,
        speed_mean=0.9 * speed,
        mnl_std=0.4,
        pnl_mean=mnl + 4.0,
        pnl_std=1.25,
        velocity_error_sq=0.01 * (1.0 + beta),
        trials_heard=18 if falls else 20,
        fall_rate=0.2 if falls else 0.05,
    )


@pytest.fixture(autouse=True)
def at_commit(monkeypatch) -> Callable[[str], None]:
    """Let the tree be at a commit, a clean one to begin with; return what changes it."""

    def change(commit: str) -> None:
        monkeypatch.setattr(origin, "current_commit", lambda: commit)

    change("a" * 40)
    return change


@pytest.fixture
def measured(monkeypatch) -> list[str]:
    """Take the place of the measurements; return what was measured, in order."""
    done: list[str] = []

    def measure(job, extent, seed, on_step) -> list[dict[str, Any]]:
        done.append(f"{job.part} {job.walker.method} {job.surface}")
        return [
            _row(job.walker.label(each.beta), job.part, job.surface, each.beta, each.command_speed)
            | {"policy": job.walker.name}
            for each in job.settings
        ]

    def fitted(asked, driver) -> dict[str, Any]:
        done.append(f"calibration {driver.task} {asked.floor}")
        levels = {"target_mnl": 73.51, "mnl": 73.51, "mnl_ci95": 0.25}
        return levels | {"transmissibility": 0.06, "floor": asked.floor, "robots": 64}

    monkeypatch.setattr(paper_measurements, "measure", measure)
    monkeypatch.setattr(paper_calibration, "fitted", fitted)
    used = {"transmissibility": 0.03, "label": "MUTE, beta 0", "floor": "wood"}
    used["policy_sha256"] = file_sha256(SHIPPED_POLICY)
    monkeypatch.setattr(evaluate_paper, "constant_in_use", lambda: used)
    return done


def _found(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "comparison.json").read_text())


def test_all_of_it_really_runs_in_small_and_is_read_back_the_second_time(
    tmp_path, capsys, monkeypatch
):
    words = ["paper", "--quick", "--trials", "1", "--out", str(tmp_path)]
    assert evaluate.main(words) == 0
    shown = capsys.readouterr().out
    assert "written to" in shown
    found, report = _found(tmp_path), (tmp_path / "comparison.md").read_text()
    told = {row["label"] for row in found["levels"]}
    assert told == {"MPC", "MUTE, beta 0", "MUTE, beta 1"} | (
        {"DreamWaQ"} if len(found["walkers"]) == 3 else set()
    )
    assert {row["surface"] for row in found["levels"]} == {"wood", "carpet", "tile"}
    assert all(40.0 < row["mnl_mean"] < 90.0 for row in found["levels"] + found["sweep"])
    assert found["walk"]["path_length"] == 3.0
    for name in found["figures"]:
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert f"({name}.png)" in report
    drawn = {name.rpartition("/")[2] for name in found["figures"]}
    assert drawn == {"speed", "front", "sources", "beta", "course_map"}
    assert comparison_report(found) == report

    def never(*_: Any) -> None:
        raise AssertionError("measured again")

    monkeypatch.setattr(paper_measurements, "measure", never)
    monkeypatch.setattr(paper_measurements, "walk", never)
    assert evaluate.main(words) == 0
    assert (tmp_path / "comparison.md").read_text() == report


def _stop_after_two(words: list[str], measured: list[str]) -> None:
    """Run the command, and interrupt it once two measurements are made."""
    measure = paper_measurements.measure

    def stopped(job, *rest: Any) -> list[dict[str, Any]]:
        if len(measured) == 2:
            raise KeyboardInterrupt
        return measure(job, *rest)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(paper_measurements, "measure", stopped)
        with pytest.raises(KeyboardInterrupt):
            evaluate.main(words)


def test_what_was_stopped_goes_on_where_it_was(tmp_path, measured):
    words = ["paper", "--parts", "levels,sweep", "--out", str(tmp_path)]
    _stop_after_two(words, measured)
    assert not (tmp_path / "comparison.json").exists()
    first = list(measured)
    assert evaluate.main(words) == 0
    assert measured[:2] == first == ["levels MPC wood", "levels MPC carpet"]
    assert len(set(measured)) == len(measured)  # none twice
    assert measured[-1] == "sweep MUTE wood"


@pytest.fixture
def walked(monkeypatch) -> list[tuple[Path, float]]:
    """Take the place of the long walk; return its folders and quiet factors, in order."""
    done: list[tuple[Path, float]] = []

    def walk(asked) -> None:
        done.append((asked.out, asked.beta))
        asked.out.mkdir(parents=True, exist_ok=True)
        figures = {"mnl_mean": 66.0, "pnl_mean": 70.0, "arrived": 1, "trials": 1, "end": "fell"}
        figures |= {"path_length": 3.0, "course_speed": 0.5, "beta": asked.beta, "seconds": 9.0}
        (asked.out / "walk.json").write_text(json.dumps(figures | origin.sound_origin()))
        (asked.out / "course_map.png").write_bytes(b"a map")

    monkeypatch.setattr(paper_measurements, "walk", walk)
    return done


def test_what_another_commit_measured_is_taken_with_a_note_or_measured_anew(
    tmp_path, measured, walked, at_commit, capsys
):
    words = ["paper", "--no-mpc", "--parts", "levels,walk", "--out", str(tmp_path)]
    assert evaluate.main(words) == 0
    report = tmp_path / "comparison.md"
    assert "Measured before" not in report.read_text()
    assert "Commit " + "a" * 40 in report.read_text()
    at_commit("b" * 40)
    capsys.readouterr()
    assert evaluate.main(words) == 0
    assert (len(measured), len(walked)) == (3, 1)
    machine = _found(tmp_path)["machine"]
    # 3 quiet factors at 7, 5 and 5 speeds.
    note = f"51 settings at commit {'a' * 40} on {machine}; the long walk at commit {'a' * 40} on "
    assert f"Measured before: {note}{machine}." in report.read_text()
    told = capsys.readouterr().err
    assert f"measured before: {note}{machine}; --anew measures all again" in told
    assert {row["commit"] for row in _found(tmp_path)["levels"]} == {"a" * 40}
    assert evaluate.main([*words, "--anew"]) == 0
    assert (len(measured), len(walked)) == (6, 2)
    assert "Measured before" not in report.read_text()
    assert {row["commit"] for row in _found(tmp_path)["levels"]} == {"b" * 40}


def test_what_a_tree_with_changes_measured_is_never_taken_again(
    tmp_path, measured, walked, at_commit, capsys
):
    words = ["paper", "--no-mpc", "--parts", "levels,walk", "--out", str(tmp_path)]
    at_commit("a" * 40 + "-dirty")
    for count in (1, 2):
        assert evaluate.main(words) == 0
        assert (len(measured), len(walked)) == (3 * count, count)
        assert "what is measured now is not taken again" in capsys.readouterr().err
    at_commit("a" * 40)
    assert evaluate.main(words) == 0
    assert (len(measured), len(walked)) == (9, 3)
    # Nor does it take the place of what was measured without changes.
    at_commit("b" * 40 + "-dirty")
    assert evaluate.main([*words, "--anew"]) == 0
    assert evaluate.main(words) == 0
    assert (len(measured), len(walked)) == (12, 4)
    assert {row["commit"] for row in _found(tmp_path)["levels"]} == {"a" * 40}
    assert _found(tmp_path)["walk"]["commit"] == "a" * 40


def test_a_part_alone_leaves_the_others_in_the_report(tmp_path, measured, walked):
    dreamwaq = write_dreamwaq_policy(tmp_path / "dreamwaq.pt")
    words = ["paper", "--no-mpc", "--dreamwaq", str(dreamwaq), "--out", str(tmp_path)]
    assert evaluate.main(words) == 0
    report, found = (tmp_path / "comparison.md").read_text(), _found(tmp_path)
    for part in ("calibration", "sweep", "walk", "levels"):
        before = len(measured), len(walked)
        assert evaluate.main([*words, "--parts", part]) == 0
        assert (len(measured), len(walked)) == before
        assert (tmp_path / "comparison.md").read_text() == report
        assert _found(tmp_path) == found
    # Measured anew is what is asked for, and no more.
    assert evaluate.main([*words, "--parts", "sweep", "--anew"]) == 0
    assert measured[8:] == ["sweep MUTE wood"]
    assert _found(tmp_path) == found


def test_parts_of_other_settings_or_not_whole_are_not_in_the_report(tmp_path, measured, walked):
    words = ["paper", "--no-mpc", "--out", str(tmp_path)]
    _stop_after_two(words, measured)
    assert evaluate.main([*words, "--parts", "sweep"]) == 0
    assert (_found(tmp_path)["levels"], _found(tmp_path)["walk"]) == ([], None)
    assert evaluate.main([*words, "--parts", "levels,walk"]) == 0
    assert len(_found(tmp_path)["sweep"]) == 11
    assert evaluate.main([*words, "--parts", "walk", "--seed", "2"]) == 0
    found = _found(tmp_path)
    assert (found["levels"], found["sweep"]) == ([], [])
    assert found["command"].endswith("--parts walk --seed 2 --no-mpc")


def test_the_report_of_the_same_figures_is_the_same_byte_for_byte(tmp_path, measured, walked):
    dreamwaq = write_dreamwaq_policy(tmp_path / "dreamwaq.pt")
    for name in ("one", "two"):
        words = ["paper", "--dreamwaq", str(dreamwaq), "--out", str(tmp_path / name)]
        assert evaluate.main(words) == 0
    one, two = (tmp_path / name for name in ("one", "two"))
    for name in ("comparison.md", "comparison.json", "levels.csv", "speed.png", "front.svg"):
        assert (one / name).read_bytes() == (two / name).read_bytes()
    report = (one / "comparison.md").read_text()
    assert "1 of 1 robots arrived; MNL 66.0 dBA" in report
    assert f"({walked[0][0].relative_to(one)}/course_map.png)" in report
    # 69 dBA and half a dBA for the speed; the paper's 68.61.
    assert "| MUTE, beta 0 | wood | 69.5 ± 0.4 (fitted) | 68.6 | +0.9 |" in report
    assert "| DreamWaQ | tile | 72.5 ± 0.4 | 72.3 | +0.2 |" in report
    assert "| 0.45 | 20 of 20 | 5.0 % |\n| MPC | tile | 75.5" in report
    assert "| 0.45 | 18 of 20 | **20.0 %** |\n| DreamWaQ | wood" in report
    assert report.count("(fitted)") == 1
    assert "| MPC > DreamWaQ > MUTE, beta 1 on wood, without MUTE, beta 0, which is fit" in report
    assert "| MPC > DreamWaQ > MUTE, beta 0 > MUTE, beta 1 on carpet | 75.5 > 72.5 >" in report
    assert "the share 0.0300 comes to the robot's shell: fitted such that MUTE, beta 0" in report
    assert f"with the policy of SHA-256 {file_sha256(SHIPPED_POLICY)[:12]}. That level" in report
    found = _found(one)
    found["calibration"]["in_use"]["policy_sha256"] = "5" * 64
    others = comparison_report(found)
    assert "SHA-256 555555555555. No such policy is compared here" in others
    assert "(fitted)" not in others
    # 20 log10(0.06 / 0.03) is 6.02.
    assert "| 0.0600 | +6.0 | ± 0.2 | - |" in report
    assert "| quieter at every step of beta, 0.8 m/s on wood | 10 of 10 steps" in report
    assert "python evaluate.py paper --dreamwaq" in report


def test_several_trainings_come_with_their_smallest_and_largest(tmp_path, measured, monkeypatch):
    measure = paper_measurements.measure

    def louder(job, *rest: Any) -> list[dict[str, Any]]:
        more = 3.0 if job.walker.name.endswith("two.pt") else 0.0
        names = ("mnl_mean", "laeq_impacts")
        return [row | {name: row[name] + more for name in names} for row in measure(job, *rest)]

    monkeypatch.setattr(paper_measurements, "measure", louder)
    two = write_variant(tmp_path / "two.pt", seed=7)
    words = ["paper", "--no-mpc", "--parts", "levels", "--out", str(tmp_path / "out")]
    assert evaluate.main([*words, "--mute", str(SHIPPED_POLICY), str(two)]) == 0
    report = (tmp_path / "out" / "comparison.md").read_text()
    assert "71.0 ± 0.4 (69.5, 72.5)" in report
    assert "| MUTE, beta 0 | wood | 51.5 |" in report  # impacts, the mean of 50 and 53
    assert "their smallest and largest are in brackets" in report


def test_other_policies_are_compared_under_their_names_or_their_tasks(tmp_path, measured):
    bare = write_variant(tmp_path / "a=b.pt", seed=7)  # no name: there is such a file
    others = [f"No LSTM (history)={SHIPPED_POLICY}", str(bare)]
    words = ["paper", "--no-mpc", "--parts", "levels", "--out", str(tmp_path / "out")]
    assert evaluate.main([*words, "--others", *others]) == 0
    found = _found(tmp_path / "out")
    told = {row["label"] for row in found["levels"]}
    assert {"No LSTM (history), beta 0", "go1_mute, beta 0", "MUTE, beta 0"} <= told
    # As one would ask for them on another machine.
    assert "'No LSTM (history)=resources/go1/go1_mute.pt' a=b.pt" in found["command"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({}, "it is the same file, SHA-256 "),
        ({"seed": 7, "symmetric": False}, "it has agent.symmetric False, not True"),
        ({"action_scale": 0.3}, "it has env.action_scale 0.3, not 0.25"),
        ({"gamma": 0.9}, "it has agent.ppo.gamma 0.9, not 0.99; compare it under a name of"),
        ({"num_threads": 3}, "both are of seed "),
        ({"seed": 7, "iteration": 9}, "it has last iteration 9, not 2399"),
    ],
)
@pytest.mark.parametrize("option", ["mute", "others"])
def test_only_trainings_of_one_recipe_are_averaged(tmp_path, measured, option, changes, message):
    other = write_variant(tmp_path / "other.pt", **changes)
    if not changes:
        other.write_bytes(SHIPPED_POLICY.read_bytes())
    words = ["paper", "--no-mpc", "--out", str(tmp_path)]
    name = "MUTE" if option == "mute" else "x"
    files = [f"{'' if option == 'mute' else 'x='}{path}" for path in (SHIPPED_POLICY, other)]
    with pytest.raises(MuteError) as error:
        evaluate.main([*words, f"--{option}", *files])
    assert f"{name}: " in str(error.value)
    assert message in str(error.value)
    assert "\n" not in str(error.value)
    assert measured == []


@pytest.mark.parametrize("word", ["=a.pt", "a|b=a.pt", "a, beta 1=a.pt", "name="])
def test_a_name_that_a_table_could_not_show_is_refused(tmp_path, measured, word):
    with pytest.raises(MuteError, match=r"--others must be FILE or NAME=FILE, .*, got") as error:
        evaluate.main(["paper", "--no-mpc", "--out", str(tmp_path), "--others", word])
    assert repr(word) in str(error.value)


def test_another_policy_cannot_have_the_name_of_a_method_of_the_paper(tmp_path, measured):
    word = f"DreamWaQ={SHIPPED_POLICY}"
    with pytest.raises(MuteError, match="--others must have names other than MPC, DreamWaQ and"):
        evaluate.main(["paper", "--no-mpc", "--out", str(tmp_path), "--others", word])


def test_a_floor_that_nothing_was_heard_on_has_no_level_and_no_figure(
    tmp_path, measured, monkeypatch
):
    measure = paper_measurements.measure
    unheard = dict.fromkeys(("mnl_mean", "mnl_std", "pnl_mean", "pnl_std"), None)

    def silent(*asked: Any) -> list[dict[str, Any]]:
        return [row | unheard for row in measure(*asked)]

    monkeypatch.setattr(paper_measurements, "measure", silent)
    words = ["paper", "--no-mpc", "--parts", "levels,sweep", "--out", str(tmp_path)]
    assert evaluate.main(words) == 0
    assert _found(tmp_path)["figures"] == []
    assert "| MUTE, beta 0 | wood | - | 68.6 | - |" in (tmp_path / "comparison.md").read_text()


def test_a_policy_is_refused_under_the_name_of_another_method(tmp_path, measured):
    dreamwaq = str(write_dreamwaq_policy(tmp_path / "dreamwaq.pt"))
    words = ["paper", "--no-mpc", "--out", str(tmp_path)]
    with pytest.raises(MuteError, match=r"--mute .*dreamwaq\.pt knows no quiet factor"):
        evaluate.main([*words, "--mute", dreamwaq])
    with pytest.raises(MuteError, match=r"--dreamwaq .*go1_mute\.pt knows a quiet factor"):
        evaluate.main([*words, "--dreamwaq", str(SHIPPED_POLICY)])
    assert measured == []


def test_two_walks_that_differ_are_both_kept(tmp_path, walked):
    words = ["paper", "--quick", "--no-mpc", "--parts", "walk", "--out", str(tmp_path)]
    for beta in ("0.5", "1", "0.5"):
        assert evaluate.main([*words, "--beta", beta]) == 0
    assert [beta for _, beta in walked] == [0.5, 1.0]
    assert len({folder for folder, _ in walked}) == 2
    report = (tmp_path / "comparison.md").read_text()
    assert "1 of 1 robots arrived; MNL 66.0 dBA" in report  # the one drawn did not


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--parts", "noise"], "--parts must be of calibration, levels, sweep, walk, got 'noise'"),
        (["--parts", "calibration", "--dreamwaq"], "--parts calibration needs a policy of Dr"),
        (["--mute"], "--mute must name at least one policy, got none"),
        (["--mute", "gone.pt"], "gone.pt"),
        (["--beta", "2"], "--beta must be numbers in"),
        (["--trials", "0"], "--trials must be"),
        (["--seed", "-1"], "--seed must be"),
        (["--others", "a.pt", "a.pt"], "--others must name each but once, got a.pt again"),
    ],
)
def test_bad_input_is_named_and_nothing_measured(tmp_path, measured, options, message):
    with pytest.raises(MuteError) as error:
        evaluate.main(["paper", "--out", str(tmp_path), *options])
    assert message in str(error.value)
    assert measured == []
