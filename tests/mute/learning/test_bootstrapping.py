"""Adaptive bootstrapping against what comes out by hand."""

from __future__ import annotations

import math

import pytest
import torch

from mute.learning.bootstrapping import AdaptiveBootstrap

CPU = torch.device("cpu")


def _with_returns(returns: list[float]) -> AdaptiveBootstrap:
    """Return one whose robots have each ended an episode of two steps, and begun another."""
    bootstrap = AdaptiveBootstrap(len(returns), CPU)
    ended = torch.ones(len(returns), dtype=torch.bool)
    bootstrap.record(torch.full((len(returns),), 0.25), ~ended)
    bootstrap.record(torch.tensor(returns) - 0.25, ended)
    bootstrap.record(torch.full((len(returns),), 100.0), ~ended)
    bootstrap.draw()
    return bootstrap


@pytest.mark.parametrize(
    ("returns", "variation"),
    [
        ([1.0, 3.0], 1.0 / 2.0),
        ([2.0, 2.0, 2.0], 0.0),
        ([-1.0, -3.0], 1.0 / 2.0),  # a mean below zero varies as much as one above
        ([0.0, 1.0, 2.0, 5.0], math.sqrt(3.5) / 2.0),
    ],
)
def test_the_probability_is_one_minus_tanh_of_the_coefficient_of_variation(returns, variation):
    expected = 1.0 - math.tanh(variation)
    assert _with_returns(returns).probability == pytest.approx(expected, abs=1e-6)


def test_before_any_episode_has_ended_all_see_the_truth():
    bootstrap = AdaptiveBootstrap(5, CPU)
    assert bool(bootstrap.told.all())
    bootstrap.record(torch.ones(5), torch.zeros(5, dtype=torch.bool))
    bootstrap.draw()
    assert bootstrap.probability == 0.0
    assert bool(bootstrap.told.all())


def test_only_robots_that_have_ended_an_episode_are_counted():
    bootstrap = AdaptiveBootstrap(3, CPU)
    bootstrap.record(torch.tensor([1.0, 3.0, 50.0]), torch.tensor([True, True, False]))
    bootstrap.draw()
    assert bootstrap.probability == pytest.approx(1.0 - math.tanh(0.5), abs=1e-6)


def test_until_half_of_the_robots_have_ended_an_episode_all_see_the_truth():
    bootstrap = AdaptiveBootstrap(5, CPU)
    bootstrap.record(torch.ones(5), torch.tensor([True, True, False, False, False]))
    bootstrap.draw()
    assert bootstrap.probability == 0.0
    assert bool(bootstrap.told.all())


def test_a_robot_counts_by_its_last_episode():
    bootstrap = AdaptiveBootstrap(2, CPU)
    all_end = torch.ones(2, dtype=torch.bool)
    bootstrap.record(torch.tensor([7.0, -2.0]), all_end)
    bootstrap.record(torch.tensor([1.0, 3.0]), all_end)
    bootstrap.draw()
    assert bootstrap.probability == pytest.approx(1.0 - math.tanh(0.5), abs=1e-6)


def test_estimates_are_used_as_often_as_the_probability_says():
    torch.manual_seed(0)
    bootstrap = _with_returns([1.0, 3.0] * 2000)
    estimated = 1.0 - float(bootstrap.told.float().mean())
    assert estimated == pytest.approx(1.0 - math.tanh(0.5), abs=0.03)


def test_where_all_returns_are_alike_nobody_sees_the_truth():
    assert not bool(_with_returns([2.0] * 4).told.any())


def test_episodes_that_begin_anew_lose_what_they_had_earned():
    bootstrap = AdaptiveBootstrap(2, CPU)
    none, both = torch.zeros(2, dtype=torch.bool), torch.ones(2, dtype=torch.bool)
    bootstrap.record(torch.tensor([9.0, 9.0]), none)
    bootstrap.forget_running()
    bootstrap.record(torch.tensor([1.0, 3.0]), both)
    bootstrap.draw()
    assert bootstrap.probability == pytest.approx(1.0 - math.tanh(0.5), abs=1e-6)


def test_a_state_goes_on_where_it_was_saved():
    one, other = _with_returns([1.0, 4.0, 2.0]), AdaptiveBootstrap(3, CPU)
    other.load_state_dict(one.state_dict())
    assert torch.equal(one.told, other.told)
    rewards, dones = torch.tensor([1.0, 2.0, 3.0]), torch.tensor([True, False, True])
    for each in (one, other):
        torch.manual_seed(3)
        each.record(rewards, dones)
        each.draw()
    assert one.probability == other.probability > 0.0
    assert torch.equal(one.told, other.told)
