"""Levels go up and down by how far robots get along their commands."""

from __future__ import annotations

import pytest
import torch

from mute.envs.terrain.levels import Travelled, next_levels


def _next(level: int, made: float, asked: float, fallen: bool = False, unit: float = 0.5) -> int:
    after = next_levels(
        torch.tensor([level]),
        torch.tensor([made]),
        torch.tensor([asked]),
        torch.tensor([fallen]),
        4.0,
        torch.tensor([unit]),
    )
    return int(after)


@pytest.mark.parametrize(
    ("level", "made", "asked", "fallen", "after"),
    [
        (2, 5.0, 8.0, False, 3),  # crossed
        (2, 5.0, 8.0, True, 2),  # crossed, and fell: far enough not to go down
        (2, 3.0, 8.0, False, 1),  # less than half
        (2, 3.0, 5.0, False, 2),  # not far, as it was not asked to go
        (0, 0.0, 8.0, True, 0),
        (1, -2.0, 3.0, False, 0),
    ],
)
def test_a_robot_goes_up_where_it_crossed_and_down_where_it_made_less_than_half(
    level, made, asked, fallen, after
):
    assert _next(level, made, asked, fallen) == after


@pytest.mark.parametrize(("unit", "after"), [(0.0, 0), (0.39, 1), (0.99, 4)])
def test_who_has_solved_them_all_goes_anywhere(unit, after):
    assert _next(4, 5.0, 8.0, unit=unit) == after
    assert _next(4, 3.0, 4.0, unit=unit) == 4


def test_what_counts_is_the_way_along_the_command():
    travelled = Travelled(4, torch.device("cpu"))
    command = torch.tensor([[1.0, 0.0, 0.0, 0.0], [0.3, 0.4, 0.0, 0.0], [0.0] * 4, [-1.0, 0, 0, 0]])
    velocity = torch.tensor([[0.5, 0.7, 0.0], [0.6, 0.8, 0.0], [0.4, 0.0, 0.0], [0.2, 0.0, 0.0]])
    for _ in range(10):
        travelled.update(command, velocity, 0.02)
    torch.testing.assert_close(travelled.made, torch.tensor([0.1, 0.2, 0.0, -0.04]))
    torch.testing.assert_close(travelled.asked, torch.tensor([0.2, 0.1, 0.0, 0.2]))
    travelled.reset(torch.tensor([True, False, False, False]))
    assert float(travelled.made[0]) == 0.0
    assert float(travelled.asked[1]) > 0.0
