"""A figure has its target beside it, and what was not to be had does not meet it."""

from __future__ import annotations

import math

import pytest

from mute.evaluation.reliability.figures import Figure, Target, shown, worst


@pytest.mark.parametrize(
    ("target", "met", "not_met"),
    [
        (Target(at_least=0.98), (0.98, 1.0), (0.979, math.nan)),
        (Target(at_most=56.0), (56.0, -math.inf), (56.1, math.nan)),
        (Target(below=0.01), (0.0, 0.0099), (0.01, math.nan)),
        (Target(at_least=0.9, at_most=1.1), (0.9, 1.1), (0.89, 1.11)),
    ],
)
def test_a_target_is_met_up_to_its_bound_and_never_by_what_was_not_to_be_had(target, met, not_met):
    assert all(target.met(value) for value in met)
    assert not any(target.met(value) for value in not_met)


@pytest.mark.parametrize("first", [True, False])
def test_the_worst_of_values_of_which_one_was_not_to_be_had_is_not_to_be_had(first):
    values = [math.nan, 1.0, 2.0] if first else [1.0, 2.0, math.nan]
    assert math.isnan(worst(values, Target(at_least=0.9)))
    assert math.isnan(worst(values, Target(at_most=2.1)))


def test_the_worst_value_is_the_least_of_what_is_to_be_large_and_the_most_of_what_is_not():
    assert worst([1.0, 3.0, 2.0], Target(at_least=0.9)) == 1.0
    assert worst([1.0, 3.0, 2.0], Target(at_most=0.9)) == 3.0
    assert worst([1.0, 3.0, 2.0], Target(below=0.9)) == 3.0


def test_a_figure_as_plain_data_has_its_target_in_words_and_its_verdict():
    figure = Figure("falls", "robots that fall", 0.0125, "share", Target(below=0.01))
    assert figure.as_dict() == {
        "part": "falls",
        "name": "robots that fall",
        "value": 0.0125,
        "unit": "share",
        "target": "< 1.0 %",
        "met": False,
    }


def test_shares_are_read_in_per_cent_and_what_is_missing_is_a_dash():
    assert shown(0.984, "share") == "98.4 %"
    assert shown(55.21, "dBA") == "55.2 dBA"
    assert shown(8.0, "") == "8"
    assert (shown(math.nan, "dBA"), shown(None, "share")) == ("-", "-")
