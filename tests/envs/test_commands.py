"""Tests of the command sampler."""

from __future__ import annotations

import dataclasses
import math

import pytest
import torch

from mute.envs.commands import CommandSampler, CommandsCfg

RANGES = {
    "lin_vel_x": (0.5, 1.5),
    "lin_vel_y": (-0.4, -0.2),
    "ang_vel_z": (-1.0, 1.0),
    "beta": (0.25, 0.75),
}


def _make_sampler(num_envs=4, **given):
    generator = torch.Generator().manual_seed(0)
    return CommandSampler(CommandsCfg(**given), num_envs, generator, torch.device("cpu"))


def _resample_all(sampler, with_beta=True):
    sampler.resample(torch.ones(len(sampler.command), dtype=torch.bool), with_beta=with_beta)


def test_commands_fill_their_ranges_and_stay_within():
    sampler = _make_sampler(2000, standing_fraction=0.0, **RANGES)
    _resample_all(sampler)
    for column, (low, high) in enumerate(RANGES.values()):
        values, margin = sampler.command[:, column], 0.02 * (high - low)
        assert low <= values.min() < low + margin
        assert high - margin < values.max() <= high


def test_the_asked_share_of_the_robots_stands():
    sampler = _make_sampler(4000, standing_fraction=0.3)
    _resample_all(sampler)
    # Standard deviation of the share: sqrt(0.3 0.7 / 4000) = 0.007.
    assert sampler.standing.float().mean().item() == pytest.approx(0.3, abs=0.03)


def test_a_standing_robot_has_no_velocity_but_a_beta():
    sampler = _make_sampler(4, standing_fraction=1.0, **RANGES)
    _resample_all(sampler)
    assert sampler.standing.all()
    assert (sampler.command[:, :3] == 0.0).all()
    assert (sampler.beta >= 0.25).all()


@pytest.mark.parametrize("fraction", [0.4, 1.0])
def test_the_asked_share_of_the_betas_is_an_end_of_their_range(fraction):
    sampler = _make_sampler(4000, beta_end_fraction=fraction, **RANGES)
    _resample_all(sampler)
    for end in (0.25, 0.75):
        # Standard deviation of the share: at most sqrt(1 / 4 / 4000) = 0.008.
        share = (sampler.beta == end).float().mean().item()
        assert share == pytest.approx(0.5 * fraction, abs=0.03)
    between = sampler.beta[(sampler.beta > 0.25) & (sampler.beta < 0.75)]
    if fraction < 1.0:
        # Even between the ends: mean 0.5, deviation 0.5 / sqrt(12); of the mean 0.003.
        assert between.mean().item() == pytest.approx(0.5, abs=0.015)
        assert between.std().item() == pytest.approx(0.5 / math.sqrt(12.0), abs=0.01)


def test_the_asked_share_of_the_commands_has_a_single_axis_each_as_often_as_any():
    sampler = _make_sampler(6000, standing_fraction=0.0, single_axis_fraction=0.6)
    _resample_all(sampler)
    alone = (sampler.command[:, :3] != 0.0).sum(dim=1) == 1
    # Standard deviations: of the share 0.006, of each axis' number sqrt(3600 2/9) = 28.
    assert alone.float().mean().item() == pytest.approx(0.6, abs=0.025)
    each = (sampler.command[alone, :3] != 0.0).sum(dim=0) / alone.sum()
    torch.testing.assert_close(each, torch.full((3,), 1.0 / 3.0), atol=0.03, rtol=0.0)


def test_the_asked_share_of_the_commands_is_slow():
    sampler = _make_sampler(6000, standing_fraction=0.0, slow_fraction=0.5, slow_share=0.2)
    _resample_all(sampler)
    forward = sampler.command[:, 0].abs()
    assert forward.max() > 0.98
    # All of the slow ones are below 0.2 m/s, and a fifth of the others.
    assert (forward < 0.2).float().mean().item() == pytest.approx(0.6, abs=0.025)
    sideways, turning = sampler.command[:, 1].abs() / 0.5, sampler.command[:, 2].abs()
    slow = forward.maximum(sideways).maximum(turning) < 0.2
    assert slow.float().mean().item() == pytest.approx(0.5 + 0.5 * 0.2**3, abs=0.025)


def test_commands_too_small_to_follow_are_made_zero_and_no_others_change():
    whole, clear = (
        _make_sampler(4000, standing_fraction=0.0, slow_fraction=0.5, deadband=deadband)
        for deadband in (0.0, 0.2)
    )
    for sampler in (whole, clear):
        _resample_all(sampler)
    small = whole.command[:, :3].norm(dim=1) < 0.2
    assert 0.02 < small.float().mean().item() < 0.5
    assert (clear.command[small, :3] == 0.0).all()
    assert torch.equal(clear.command[~small], whole.command[~small])
    assert torch.equal(clear.beta, whole.beta)


def test_turning_on_the_spot_is_not_standing():
    sampler = _make_sampler(2)
    sampler.command[:] = torch.tensor([[0.0, 0.0, 0.1, 0.0], [0.0, 0.0, 0.0, 1.0]])
    assert sampler.standing.tolist() == [False, True]


def test_beta_stays_where_only_velocities_are_drawn():
    sampler = _make_sampler(4, standing_fraction=0.0)
    _resample_all(sampler)
    before = sampler.command.clone()
    _resample_all(sampler, with_beta=False)
    assert torch.equal(sampler.beta, before[:, 3])
    assert (sampler.command[:, :3] != before[:, :3]).all()


def test_beta_is_drawn_anew_with_an_episode():
    sampler = _make_sampler(4)
    _resample_all(sampler)
    before = sampler.beta.clone()
    _resample_all(sampler)
    assert (sampler.beta != before).all()


def test_robots_outside_the_mask_keep_their_command():
    sampler = _make_sampler(4, standing_fraction=0.0)
    _resample_all(sampler)
    before = sampler.command.clone()
    sampler.resample(torch.tensor([False, True, False, True]), with_beta=True)
    assert torch.equal(sampler.command[::2], before[::2])
    assert (sampler.command[1::2] != before[1::2]).all()


def test_commands_are_written_in_place():
    sampler = _make_sampler(4)
    reference = sampler.command
    _resample_all(sampler)
    assert reference is sampler.command
    assert (reference != 0.0).any()


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("lin_vel_x", (1.0, -1.0)),
        ("lin_vel_x", (-math.inf, math.inf)),
        ("lin_vel_y", (0.1, 0.0)),
        ("ang_vel_z", (0.1, 0.0)),
        ("beta", (0.6, 0.5)),
        ("beta", (-0.1, 0.5)),
        ("beta", (0.0, 1.1)),
        ("standing_fraction", 1.5),
        ("standing_fraction", -0.5),
        ("resampling_time", 0.0),
        ("resampling_time", math.inf),
    ],
)
def test_a_bad_field_is_refused_by_name(field, value):
    with pytest.raises(ValueError, match=f"commands.{field}"):
        CommandsCfg(**{field: value})


def test_the_ranges_of_the_velocities_grow_with_the_training_and_beta_does_not():
    asked = {}
    for progress in (0.0, 0.5, 1.0):
        sampler = _make_sampler(2000, standing_fraction=0.0, initial_share=0.4)
        everywhere = torch.ones(2000, dtype=torch.bool)
        sampler.resample(everywhere, with_beta=True, progress=progress)
        asked[progress] = sampler.command
    torch.testing.assert_close(asked[0.0][:, :3], 0.4 * asked[1.0][:, :3])
    torch.testing.assert_close(asked[0.5][:, :3], 0.7 * asked[1.0][:, :3])
    assert torch.equal(asked[0.0][:, 3], asked[1.0][:, 3])


@pytest.mark.parametrize(
    ("field", "value"), [("initial_share", 1.5), ("initial_share", -0.1), ("ramp", (2.0, 1.0))]
)
def test_a_bad_growth_is_refused_by_name(field, value):
    with pytest.raises(ValueError, match=f"commands.{field}"):
        CommandsCfg(**{field: value})


def test_commands_that_are_drawn_evenly_keep_nothing_of_a_task_but_its_ranges():
    evenly = CommandsCfg(
        lin_vel_x=(-0.4, 0.8),
        lin_vel_y=(-0.1, 0.2),
        ang_vel_z=(-0.3, 0.3),
        beta=(0.2, 0.9),
        standing_fraction=0.2,
    )
    shaped = dataclasses.replace(
        evenly,
        beta_end_fraction=0.4,
        standing_fraction=0.3,
        single_axis_fraction=0.3,
        slow_fraction=0.4,
        slow_share=0.2,
        deadband=0.06,
        resampling_time=2.0,
        initial_share=0.5,
        ramp=(1.0, 2.0),
    )
    assert shaped.drawn_evenly(0.2) == evenly
