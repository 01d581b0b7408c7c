"""What beta changes is read off at one actual speed, and judged step by step."""

from __future__ import annotations

import math

import pytest

from mute.evaluation.reliability.beta_acts import beta_figures


def _rows(landing, apex=(0.05,) * 5):
    return [
        {"landing_speed_rms": speed, "apex_mean": lift}
        for speed, lift in zip(landing, apex, strict=True)
    ]


def test_beta_that_acts_at_every_step_meets_all_its_targets():
    figures = beta_figures(0.5, _rows((0.5, 0.45, 0.4, 0.35, 0.3)))
    assert [figure.value for figure in figures] == pytest.approx([0.4, 4.0, 5.0])
    assert all(figure.met for figure in figures)


def test_the_drop_that_is_asked_for_is_larger_at_the_middle_speed():
    landing = (0.5, 0.45, 0.42, 0.38, 0.35)  # 30 % lower
    assert [beta_figures(speed, _rows(landing))[0].met for speed in (0.3, 0.5, 0.8)] == [
        True,
        False,
        True,
    ]


def test_a_step_of_beta_that_lands_no_slower_and_a_low_foot_are_told():
    figures = beta_figures(0.5, _rows((0.5, 0.5, 0.4, 0.45, 0.2), (0.05, 0.05, 0.029, 0.05, 0.05)))
    assert [figure.value for figure in figures] == pytest.approx([0.6, 2.0, 2.9])
    assert [figure.met for figure in figures] == [True, False, False]


def test_of_a_beta_that_does_not_walk_at_the_speed_nothing_is_said():
    figures = beta_figures(0.3, _rows((0.5, 0.45, 0.4, 0.35, math.nan)))
    assert all(math.isnan(figure.value) and not figure.met for figure in figures)
