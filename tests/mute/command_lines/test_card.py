"""The pages of figures are what the command makes of the files, and the front page agrees."""

from __future__ import annotations

import dataclasses
import json
import re

import pytest
from comparison_rows import floors
from places import REPOSITORY

from mute.command_lines import card
from mute.command_lines.card_reliability import SeedFiles, median_seed
from mute.command_lines.card_results import results_page, summary
from mute.command_lines.card_tables import markdown, mean_and_spread
from mute.command_lines.card_trainings import policy_figures
from mute.support.errors import MuteError

_MPC = ["# The model-predictive controller"]


@pytest.fixture(scope="module")
def files():
    return card.read_results(card.CardArgs())


def _with(files, seeds):
    return dataclasses.replace(files, ships=dataclasses.replace(files.ships, seeds=seeds))


@pytest.mark.parametrize("name", ["results.md", "sound.md", "terrain.md", "mpc.md", "benchmark.md"])
def test_a_committed_page_is_what_the_command_makes(name, tmp_path):
    assert card.main(["--out", str(tmp_path)]) == 0
    made, committed = (folder / name for folder in (tmp_path, REPOSITORY / "docs"))
    assert made.read_text() == committed.read_text(), "python -m mute.card --out docs"


def test_the_front_page_has_the_table_of_the_results_and_says_what_it_is_of(files):
    words = " ".join((REPOSITORY / "README.md").read_text().split())
    assert " ".join(summary(files).split()) in words


def test_without_a_directory_all_pages_are_printed(capsys):
    assert card.main([]) == 0
    headings = re.findall("^# .*$", capsys.readouterr().out, re.MULTILINE)
    assert headings == ["# Results", "# The sound model", "# Ground", *_MPC, "# Speed"]


def test_a_spread_is_that_of_the_trainings(files):
    gaits = {}
    for seed, (error, landing) in {0: (0.01, 0.5), 1: (0.02, 0.6), 2: (0.06, 0.7)}.items():
        gait = files.ships.card["figures"]
        first, *others = gait["range"]
        slow, *rest = gait["at_speed"]
        gaits[seed] = gait | {
            "range": [first | {"velocity_error_sq": error, "fall_rate": 0.0}, *others],
            "at_speed": [slow | {"landing_speed_mean": landing, "apex_mean": 0.05}, *rest],
        }
    seeds = {seed: SeedFiles({}, gait=gait) for seed, gait in gaits.items()}
    [row] = re.findall(r"^\| 0 \|.*$", summary(_with(files, seeds)), re.MULTILINE)
    robots = 3 * files.ships.card["figures"]["trials"]
    told = f"| 0 | 0 of {robots} | 0.030 ± 0.026 | 0.60 ± 0.10 | 5.0 ± 0.0 |"
    assert row.startswith(told)


def test_a_mean_has_the_sample_standard_deviation_beside_it():
    assert mean_and_spread([1.0, 2.0, 3.0], "{:.2f}") == "2.00 ± 1.00"
    assert mean_and_spread([1.5], "{:.2f}") == "1.50"


def test_a_robot_that_fell_in_one_training_is_counted(files):
    seed, run = next(iter(files.ships.seeds.items()))
    gaits = [each["range"][0]["fall_rate"] * each["trials"] for each in files.ships.gaits.values()]
    robots = sum(each["trials"] for each in files.ships.gaits.values())
    first, *others = run.gait["range"]
    worse = [first | {"fall_rate": first["fall_rate"] + 2.0 / run.gait["trials"]}, *others]
    fallen = files.ships.seeds | {seed: dataclasses.replace(run, gait=run.gait | {"range": worse})}
    changed = summary(_with(files, fallen))
    assert f"| 0 | {round(sum(gaits)) + 2} of {robots} |" in changed


def test_what_was_compared_has_a_section_of_its_own_on_the_page(files):
    alone = dataclasses.replace(files, comparison=None)
    assert "## Beside other controllers" not in results_page(alone)
    in_use = {"label": None, "floor": None, "policy_sha256": None, "transmissibility": 0.1}
    compared = {
        "command": "python evaluate.py paper",
        "walkers": [{"method": "MPC", "sha256": None}, {"method": "MUTE", "sha256": "ab"}],
        "levels": floors("MPC", 78.0, 77.0, 76.0) + floors("MUTE, beta 0", 70.0, 68.0, 77.0),
        "sweep": [],
        "walk": None,
        "calibration": {"in_use": in_use, "fits": []},
        "figures": ["front"],
    }
    page = results_page(dataclasses.replace(alone, comparison=compared))
    own = page.split("## Beside other controllers")[1].split("\n## ")[0]
    assert "MPC (1 training), MUTE (1 training), on the same robot" in own
    assert "| MPC > MUTE, beta 0 on wood | 78.0 > 70.0 dBA | yes |" in own
    assert "| MPC > MUTE, beta 0 on tile | 76.0 > 77.0 dBA | **no** |" in own
    assert "| MUTE, beta 0 | carpet | 68.0 ± 0.5 | 67.4 |" in own
    assert "(paper/comparison.md)" in own and "![front](paper/front.png)" in own


def test_the_recipe_of_flat_ground_has_a_section_of_its_own_where_another_ships(files):
    assert "## On flat ground alone" not in results_page(dataclasses.replace(files, flat=None))
    page = results_page(files)
    own = page.split("## On flat ground alone")[1].split("\n## ")[0]
    assert "python train.py --task go1_mute_flat --seed SEED" in own
    assert own.count("(the task was called `go1_mute` then)") == 1
    assert "docs/reliability/go1_mute_flat/" in own
    assert page.count("Not every training of `go1_mute_flat`") == 1


@pytest.mark.parametrize(("times", "told"), [(1, "1 time on"), (2, "2 times on")])
def test_the_page_tells_whether_a_training_was_stopped_and_where_it_is_told_more(
    files, times, told
):
    recipe = files.flat
    assert "was stopped" not in policy_figures(recipe)
    card = recipe.card | {"resumed": ["python train.py --resume model_3.pt"] * times}
    page = policy_figures(dataclasses.replace(recipe, card=card))
    assert f"It was stopped {told} the way" in page
    assert "`resources/go1/go1_mute_flat.json`" in page


def test_the_policies_that_ship_are_the_ones_in_the_middle(files):
    for recipe, seeds in ((files.ships, [0, 1]), (files.flat, [0, 1, 2, 3, 4])):
        assert sorted(recipe.seeds) == seeds
        assert recipe.card["seed"] == median_seed(recipe.seeds)


def test_how_each_seed_is_trained_is_the_command_of_the_one_that_ships(files):
    card = files.ships.card | {"seed": 3, "command": "python train.py --task t --seed 3 --plain"}
    assert dataclasses.replace(files.ships, card=card).training == (
        "python train.py --task t --seed SEED"
    )


def test_what_the_level_loses_with_beta_is_compared_at_equal_actual_speed(files):
    def row(beta, command, speed, level):
        own = {"beta": beta, "command_speed": command, "speed_mean": speed, "mnl_mean": level}
        return {"robots": "different"} | own

    # Level rises by 10 dB per 1 m/s; beta 1 is 20 % slower, and 3 dB quieter at the same speed.
    sweep = [
        row(beta, command, share * command, 60.0 + 10.0 * share * command - quieter)
        for beta, share, quieter in ((0.0, 1.0, 0.0), (1.0, 0.8, 3.0))
        for command in (0.4, 0.7, 1.0)
    ]
    exact = [each | {"robots": "nominal", "mnl_mean": 90.0} for each in sweep]
    page = results_page(dataclasses.replace(files, sweep_speed=[*sweep, *exact]))
    assert "by 3 dB at the same actual speed, 0.4 to 0.8 m/s" in page
    assert "by 4 to 5 dB at the same command" in page
    slow = [each | {"speed_mean": 0.9 * float(each["speed_mean"])} for each in sweep]
    page = results_page(dataclasses.replace(files, sweep_speed=slow))
    assert "at the same actual speed, 0.4 to 0.7 m/s" in page  # beta 1 gets to 0.72


def test_a_level_counts_as_fitted_only_where_it_is_of_the_policy_of_the_fit(files):
    row = ("mute beta 0", "wood")
    policy = {"task": "someones", "sha256": files.walk["policy_sha256"]}
    same = dataclasses.replace(files, fitted=row, fitted_policy=policy)
    assert same.fitted_here == row
    other = dataclasses.replace(same, fitted_policy=policy | {"sha256": "0" * 64})
    assert other.fitted_here is None
    assert "to a level on wood, with the policy of `someones`" in summary(other)


def test_levels_of_an_earlier_calibration_are_told_with_their_seeds(files):
    files = dataclasses.replace(files, flat=None)

    def changed(seed, run):
        calibration = "another" if seed == 1 else files.calibration
        return dataclasses.replace(
            run, reliability=run.reliability | {"calibration_sha256": calibration}
        )

    seeds = {seed: changed(seed, run) for seed, run in files.ships.seeds.items()}
    assert "model of the sound (seeds 1)" in results_page(_with(files, seeds))
    same = {seed: changed(0, run) for seed, run in files.ships.seeds.items()}
    assert "earlier model" not in results_page(_with(files, same))


def test_markdown_formats_each_column_and_leaves_a_dash_for_what_is_missing():
    columns = {"beta": ("beta", "{:g}"), "fall_rate": ("falls", "{:.1%}")}
    rows = [{"beta": 0.5, "fall_rate": 0.25}, {"beta": 1.0, "fall_rate": None}]
    assert markdown(rows, columns).splitlines() == [
        "| beta | falls |",
        "| --- | --- |",
        "| 0.5 | 25.0% |",
        "| 1 | - |",
    ]


def test_a_file_that_is_missing_is_named(tmp_path):
    with pytest.raises(MuteError, match="nowhere"):
        card.main(["--card", str(tmp_path / "nowhere.json")])


@pytest.mark.parametrize(
    ("name", "key"), [("noise", "robots"), ("sweep_beta", "mnl_ci95"), ("walk", "mnl_mean")]
)
def test_levels_of_an_earlier_version_are_refused_by_what_they_lack(name, key, tmp_path):
    for source in (REPOSITORY / "docs" / "noise").glob("*.json"):
        (tmp_path / source.name).write_bytes(source.read_bytes())
    path = tmp_path / f"{name}.json"
    content = json.loads(path.read_text())
    for row in content if isinstance(content, list) else [content]:
        del row[key]
    path.write_text(json.dumps(content))
    with pytest.raises(MuteError, match=rf"{name}\.json lacks '{key}'"):
        card.main(["--noise", str(tmp_path / "noise.json")])


def test_a_page_that_cannot_be_written_is_told_in_one_line_and_leaves_nothing_beside(tmp_path):
    (tmp_path / "results.md").mkdir()
    with pytest.raises(MuteError, match=r"cannot write .*results\.md"):
        card.main(["--out", str(tmp_path)])
    assert [path.name for path in tmp_path.iterdir()] == ["results.md"]


def test_the_card_tells_levels_without_spread_and_how_many_trials_have_one(tmp_path, capsys):
    for source in (REPOSITORY / "docs" / "noise").glob("*.json"):
        (tmp_path / source.name).write_bytes(source.read_bytes())
    path = tmp_path / "noise.json"
    rows = json.loads(path.read_text())
    rows[0] |= {"trials_heard": 1, "mnl_mean": 68.0, "mnl_std": None}
    rows[1] |= {"trials_heard": 0, "mnl_mean": None, "mnl_std": None}
    path.write_text(json.dumps(rows))
    card.main(["--noise", str(path)])
    shown = capsys.readouterr().out
    assert f"| wood | 0 | 68.0 (1 of {rows[0]['trials']} trials) |" in shown
    assert "| wood | 1 | - |" in shown
