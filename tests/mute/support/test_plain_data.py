"""Tests of plain data as JSON."""

from __future__ import annotations

import json

import numpy as np
import pytest
from places import REPOSITORY

from mute.support.plain_data import laid_out, without_nan


def test_a_list_of_numbers_has_one_line_and_everything_else_a_line_for_each_part():
    data = {"name": "a", "rows": [[1, 2.5], (3, None)], "none": [], "deep": {"x": {}, "y": [{}]}}
    assert laid_out(data).splitlines() == [
        "{",
        ' "name": "a",',
        ' "rows": [',
        "  [1, 2.5],",
        "  [3, null]",
        " ],",
        ' "none": [],',
        ' "deep": {',
        '  "x": {},',
        '  "y": [',
        "   {}",
        "  ]",
        " }",
        "}",
    ]


def test_what_is_laid_out_is_read_back_to_the_last_bit():
    generator = np.random.default_rng(0)
    data = {'quote"': generator.normal(size=(3, 4)).tolist(), "text": "é\n", "true": True}
    assert json.loads(laid_out(data)) == data


def test_what_json_cannot_hold_is_refused_unless_it_is_taken_out_first():
    with pytest.raises(ValueError, match="not JSON compliant"):
        laid_out({"level": [float("nan")]})
    assert laid_out(without_nan({"level": float("-inf")})) == '{\n "level": null\n}'


@pytest.mark.parametrize("name", ["sound/reference/references.json", "reference/walks.json"])
def test_references_of_the_page_are_laid_out_to_be_compared(name: str):
    text = (REPOSITORY / "web" / "test" / name).read_text()
    assert text == laid_out(json.loads(text)) + "\n"
