"""Tests of the comparison that takes the recipe's parts away."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from benchmarks import levers
from benchmarks.levers import LEVERS, table
from mute.learning.resumption import flat_fields
from mute.support.errors import MuteError
from mute.support.provenance import REPOSITORY
from mute.tasks import FLAT_TASK, make_task


@pytest.mark.parametrize("lever", [name for name in LEVERS if name != "recipe"])
def test_each_lever_changes_what_the_recipe_has(lever):
    assert LEVERS[lever].flags or LEVERS[lever].task != FLAT_TASK
    fields = flat_fields(make_task(LEVERS[lever].task))
    words = LEVERS[lever].flags.split()
    while words:
        option = words.pop(0).removeprefix("--").replace("-", "_")
        path = re.sub(r"\.no_(?=\w+$)", ".", option)
        taken = False if path != option else type(fields[path])(words.pop(0))
        assert fields[path] != taken, path


def test_a_recipe_with_rare_stops_has_fewer_of_them_and_holds_commands_longer():
    commands = make_task(FLAT_TASK).env.commands
    words = LEVERS["rare_stops"].flags.split()
    told = {option: float(value) for option, value in zip(words[::2], words[1::2], strict=True)}
    assert told["--env.commands.standing-fraction"] < commands.standing_fraction
    assert told["--env.commands.resampling-time"] > commands.resampling_time


_TABLES = {
    "starts": [{"beta": 0.0}],
    "beta": [
        {"speed": speed, "beta": beta, "landing_speed_rms": speed + beta}
        for speed in (0.3, 0.5)
        for beta in (0.0, 0.5, 1.0)
    ],
    "beta_levels": [{"beta": 0.0, "speed": 0.5, "mnl": 70.0}],
}


def _content(met: int, starts: float | None) -> dict[str, Any]:
    names = list(levers._FIGURES.values())
    figures = [{"name": name, "value": 0.5, "met": index < met} for index, name in enumerate(names)]
    figures[0]["value"] = starts
    return {"figures": figures, "tables": _TABLES, "policy": "somewhere"}


class _Programs:
    """Stands in for the project's programs; a training and an evaluation leave their files."""

    def __init__(self) -> None:
        self.commands: list[list[str]] = []
        self.status = 0

    def __call__(self, command: list[str]) -> int:
        self.commands.append(command[1:])
        if "--out" in command:
            found = Path(command[command.index("--out") + 1])
            found.mkdir(parents=True)
            (found / "reliability.json").write_text(json.dumps(_content(2, 1.0)))
        return self.status


@pytest.fixture
def programs(monkeypatch) -> _Programs:
    programs = _Programs()
    monkeypatch.setattr(levers, "run_program", programs)
    return programs


def _recipe() -> str:
    """Return the recipe's name in the names of runs."""
    return levers._conditions("recipe", levers.LeversArgs())["recipe"]


def _main(directory: Path, *words: str) -> int:
    places = ["--log-dir", str(directory / "runs"), "--out", str(directory / "found")]
    return levers.main([*places, "--iterations", "30", *words])


def test_each_is_trained_and_judged_once(programs, tmp_path, capsys):
    words = ("--levers", "no_go_signal", "--seeds", "0", "1", "--json")
    assert _main(tmp_path, *words) == 0
    scripts = [Path(command[0]).name for command in programs.commands]
    assert scripts == ["train.py", "evaluate.py"] * 2
    training = programs.commands[2]
    assert {"--agent.no-go-signal", "--env.scene.timestep"} <= set(training)
    assert training[training.index("--seed") + 1] == "1"
    kept = json.loads((tmp_path / "found/no_go_signal.1.json").read_text())
    assert kept["flags"][0] == "--agent.no-go-signal"
    assert list(kept["tables"]) == ["beta", "beta_levels"]
    capsys.readouterr()
    assert _main(tmp_path, *words) == 0
    assert len(programs.commands) == 4
    [row] = json.loads(capsys.readouterr().out)
    assert (row["seeds"], row["targets met"]) == (2, "2 (2 to 2)")
    assert row["landing speed at 0.5 m/s, m/s, beta 1"] == "1.5 (1.5 to 1.5)"
    assert row["MNL at 0.5 m/s, dBA, beta 0"] == "70 (70 to 70)"
    assert "MNL at 0.5 m/s, dBA, beta 1" not in row  # measured in neither


def test_a_lever_of_another_task_trains_that_one(programs, tmp_path):
    words = ("--levers", "recipe", "quiet_phase", "--seeds", "0")
    assert _main(tmp_path, *words) == 0
    trained = programs.commands[2]
    assert trained[trained.index("--task") + 1] == "go1_quiet_phase"
    first, second = (
        json.loads((tmp_path / f"found/{lever}.0.json").read_text()) for lever in words[1:3]
    )
    assert first["recipe"] != second["recipe"]
    assert _main(tmp_path, *words, "--table") == 0


def test_a_training_that_was_stopped_goes_on_from_its_last_checkpoint(programs, tmp_path):
    run = tmp_path / "runs" / FLAT_TASK / f"recipe.0.30.{_recipe()}"
    run.mkdir(parents=True)
    with pytest.raises(MuteError, match=r"recipe\.0\.30\..* before its first checkpoint"):
        _main(tmp_path, "--levers", "recipe", "--seeds", "0")
    for name in ("model_0", "model_9", "model_10", "model_best"):
        (run / f"{name}.pt").touch()
    assert _main(tmp_path, "--levers", "recipe", "--seeds", "0") == 0
    training = programs.commands[0]
    assert training[training.index("--resume") + 1] == str(run / "model_10.pt")
    assert "--seed" not in training and "--run-name" not in training


def test_a_program_that_fails_is_named_and_nothing_is_kept(programs, tmp_path):
    programs.status = 2
    with pytest.raises(MuteError, match=r"train\.py .*status 2"):
        _main(tmp_path, "--levers", "recipe", "--seeds", "0")
    assert not (tmp_path / "found").exists()


def test_the_table_gives_mean_and_ends_and_says_what_is_not_there(tmp_path):
    for seed, (met, starts) in enumerate([(5, 1.0), (2, 0.5), (2, None)]):
        (tmp_path / f"recipe.{seed}.json").write_text(json.dumps(_content(met, starts)))
    [row] = table(tmp_path, ["recipe", "no_pushes"], [0, 1, 2, 3])
    assert row["seeds"] == 3
    assert row["targets met"] == "3 (2 to 5)"
    assert row["starts, beta 1"] == "0.75 (0.5 to 1, 1 without)"


def test_what_was_found_under_other_conditions_is_not_taken_for_this(programs, tmp_path):
    words = ("--levers", "recipe", "--seeds", "0")
    assert _main(tmp_path, *words) == 0
    trained = len(programs.commands)
    for asked in ((), ("--table",)):
        with pytest.raises(MuteError, match=r"recipe\.0\.json has robots 64, not 8"):
            _main(tmp_path, "--levers", "no_pushes", *words[1:], "--robots", "8", *asked)
    assert len(programs.commands) == trained  # nothing was trained before it was refused


def test_files_of_another_recipe_are_not_taken_for_this_one(programs, tmp_path, monkeypatch):
    words = ("--levers", "recipe", "--seeds", "0")
    assert _main(tmp_path, *words) == 0
    changed = make_task(FLAT_TASK)
    changed.agent.init_std = 0.7
    monkeypatch.setattr(levers, "make_task", lambda name: changed)
    with pytest.raises(MuteError, match=r"recipe\.0\.json has recipe "):
        _main(tmp_path, *words)
    # To show them trains nothing, and all are of one recipe; but no other may stand among them.
    assert _main(tmp_path, *words, "--table") == 0
    first = tmp_path / "found" / "recipe.0.json"
    other = json.loads(first.read_text()) | {"recipe": "12345678"}
    (tmp_path / "found" / "recipe.1.json").write_text(json.dumps(other))
    with pytest.raises(MuteError, match=r"recipe\.1\.json has recipe 12345678"):
        _main(tmp_path, "--levers", "recipe", "--seeds", "0", "1", "--table")


def test_a_table_of_nothing_says_so(tmp_path):
    with pytest.raises(MuteError, match="nothing of these levers"):
        _main(tmp_path, "--table")


def test_a_file_that_lacks_a_figure_is_named(tmp_path):
    (tmp_path / "recipe.0.json").write_text(json.dumps({"figures": []}))
    with pytest.raises(MuteError, match=r"recipe\.0\.json lacks the figure 'robots that go"):
        table(tmp_path, ["recipe"], [0])


def test_the_figures_of_the_table_are_figures_of_the_exam():
    files = sorted((REPOSITORY / "docs" / "reliability").rglob("seed?.json"))
    assert files
    for file in files:
        names = {figure["name"] for figure in json.loads(file.read_text())["figures"]}
        assert set(levers._FIGURES.values()) <= names


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--seeds", "1", "1"], r"--seeds.*1 again"),
        (["--levers", "no_legs"], r"--levers.*'no_legs'"),
        (["--seeds", "-1"], r"--seed .*-1"),
        (["--robots", "0"], r"--robots.*0"),
    ],
)
def test_bad_input_is_one_line_that_names_it(words, named, tmp_path):
    with pytest.raises(MuteError, match=named):
        _main(tmp_path, *words)
