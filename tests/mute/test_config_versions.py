"""Configurations of earlier versions mean what they meant."""

from __future__ import annotations

import copy

import pytest

from mute.config import from_plain, to_plain
from mute.config_versions import check_resumable, upgraded
from mute.tasks import make_task, task_names


def _with_old_heights(offset: float, scale: float) -> dict:
    """Return the default task as it was written while the estimator had a scale of its own."""
    plain = to_plain(make_task("go1_mute"))
    for name in ("offset", "scale"):
        del plain["env"]["height_map"][name]
    plain["agent"]["estimation"]["network"] |= {"height_offset": offset, "height_scale": scale}
    return plain


@pytest.mark.parametrize("task", task_names())
def test_what_is_written_now_is_left_as_it_is(task):
    plain = to_plain(make_task(task))
    assert upgraded(plain) == plain


def test_the_estimators_scale_of_heights_becomes_that_of_the_height_map():
    cfg = from_plain(_with_old_heights(0.25, 0.5))
    assert (cfg.env.height_map.offset, cfg.env.height_map.scale) == (0.25, 0.5)
    assert cfg.agent == make_task("go1_mute").agent


def test_a_scale_in_both_places_is_refused():
    plain = _with_old_heights(0.25, 0.5)
    plain["env"]["height_map"]["scale"] = 0.1
    with pytest.raises(ValueError, match="height_scale"):
        from_plain(plain)


def test_what_is_upgraded_is_not_changed_itself():
    plain = _with_old_heights(0.25, 0.5)
    before = copy.deepcopy(plain)
    upgraded(plain)
    assert plain == before


def test_a_training_whose_critic_saw_another_scale_cannot_go_on():
    check_resumable(to_plain(make_task("go1_mute")))
    check_resumable(_with_old_heights(0.30, 0.1))
    with pytest.raises(ValueError, match=r"network\.height_scale was 0\.5 .* and 0\.1"):
        check_resumable(_with_old_heights(0.30, 0.5))


@pytest.mark.parametrize("data", [{}, {"agent": 3}, {"agent": {"estimation": None}}])
def test_data_without_the_place_of_a_field_is_left_as_it_is(data):
    assert upgraded(data) == data
