"""Tests of the layout, the scales and the noise of observations."""

from __future__ import annotations

import math

import pytest
import torch

from mute.envs.observations import (
    OBS_DIM,
    OBSERVATION_WIDTHS,
    ObservationsCfg,
    noise_amplitude,
    policy_observation,
    slices,
)

COLUMNS = {
    "base_ang_vel": (0, 3),
    "projected_gravity": (3, 6),
    "joint_pos": (6, 18),
    "joint_vel": (18, 30),
    "last_action": (30, 42),
    "command": (42, 46),
}


def _make_parts(num_envs=2):
    """Make parts that are 1, 2, 3, ... throughout, in the order of the layout."""
    return [
        torch.full((num_envs, width), float(i + 1))
        for i, width in enumerate(OBSERVATION_WIDTHS.values())
    ]


def test_the_layout_is_that_of_the_paper():
    assert OBS_DIM == 46
    columns = {name: (part.start, part.stop) for name, part in slices(OBSERVATION_WIDTHS).items()}
    assert list(columns.items()) == list(COLUMNS.items())


def test_every_part_stands_in_its_columns():
    scales = dict.fromkeys(OBSERVATION_WIDTHS, 1.0)
    observation = policy_observation(scales, *_make_parts())
    assert observation.shape == (2, 46)
    for i, (start, stop) in enumerate(COLUMNS.values()):
        assert (observation[:, start:stop] == i + 1).all()


def test_every_part_gets_its_own_scale():
    scales = {name: 10.0 ** -(i + 1) for i, name in enumerate(OBSERVATION_WIDTHS)}
    observation = policy_observation(scales, *_make_parts())
    for i, (start, stop) in enumerate(COLUMNS.values()):
        expected = torch.full((2, stop - start), (i + 1) * 10.0 ** -(i + 1))
        torch.testing.assert_close(observation[:, start:stop], expected)


def test_an_observation_shares_no_memory_with_its_parts():
    parts = _make_parts()
    observation = policy_observation(dict.fromkeys(OBSERVATION_WIDTHS, 1.0), *parts)
    parts[0].fill_(99.0)
    assert (observation[:, :3] == 1.0).all()


def test_noise_is_scaled_as_the_part_that_it_is_added_to():
    amplitude = noise_amplitude(ObservationsCfg(noise_level=2.0))
    assert amplitude.shape == (46,)
    # Twice the noise times the scale of each part; own action and command are known exactly.
    expected = {
        "base_ang_vel": 2 * 0.2 * 0.25,
        "projected_gravity": 2 * 0.05,
        "joint_pos": 2 * 0.01,
        "joint_vel": 2 * 1.5 * 0.05,
        "last_action": 0.0,
        "command": 0.0,
    }
    for name, (start, stop) in COLUMNS.items():
        torch.testing.assert_close(
            amplitude[start:stop], torch.full((stop - start,), expected[name])
        )


def test_noise_level_zero_switches_all_noise_off():
    assert (noise_amplitude(ObservationsCfg(noise_level=0.0)) == 0.0).all()


def test_a_missing_scale_is_refused():
    with pytest.raises(ValueError, match=r"observations.scales"):
        ObservationsCfg(scales={"joint_pos": 1.0})


def test_noise_on_an_unknown_part_is_refused():
    with pytest.raises(ValueError, match="joint_torque"):
        ObservationsCfg(noise={"joint_torque": 1.0})


@pytest.mark.parametrize("value", [math.nan, math.inf, -0.1])
def test_noise_that_is_no_size_is_refused_by_name(value):
    with pytest.raises(ValueError, match=rf"observations\.noise_level must be .*got {value}"):
        ObservationsCfg(noise_level=value)
    with pytest.raises(ValueError, match=rf"observations\.noise\.joint_vel must be .*got {value}"):
        ObservationsCfg(noise={"joint_vel": value})


@pytest.mark.parametrize("value", [math.nan, -math.inf])
def test_a_scale_that_is_not_finite_is_refused_by_name(value):
    scales = dict.fromkeys(OBSERVATION_WIDTHS, 1.0) | {"command": value}
    with pytest.raises(ValueError, match=rf"observations\.scales\.command must be .*got {value}"):
        ObservationsCfg(scales=scales)
