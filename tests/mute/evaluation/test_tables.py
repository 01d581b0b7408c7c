"""Tables are read back as they were written."""

from __future__ import annotations

import csv
import math

from mute.evaluation.tables import print_table, read_json, write_csv, write_json


def test_tables_read_back_as_they_were_written(tmp_path):
    rows = [{"beta": 0.5, "speed": 0.25}, {"beta": 1.0, "speed": math.nan}]
    write_csv(tmp_path / "rows.csv", rows)
    write_json(tmp_path / "rows.json", rows)
    with (tmp_path / "rows.csv").open() as file:
        assert [float(row["beta"]) for row in csv.DictReader(file)] == [0.5, 1.0]
    assert read_json(tmp_path / "rows.json") == [
        {"beta": 0.5, "speed": 0.25},
        {"beta": 1.0, "speed": None},
    ]


def test_what_there_is_none_of_is_shown_as_a_dash(capsys):
    print_table("walks", [{"name": "mjlab", "minutes": None, "speed": 0.5}], ["name", "minutes"])
    (row,) = [line for line in capsys.readouterr().out.splitlines() if "mjlab" in line]
    assert row.strip("\u2502").split("\u2502")[1].strip() == "-"
