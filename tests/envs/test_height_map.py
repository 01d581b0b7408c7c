"""The grid of the height map, its scale, and how it turns with the robot."""

from __future__ import annotations

import math

import pytest
import torch

from mute.envs.height_map import HeightMapCfg
from mute.envs.terrain import FlatGround, Ground


class _Slope(Ground):
    """Ground as high as the world's x, plus a hundred times its y."""

    def height(self, points, robots=None):
        return points[..., 0] + 100.0 * points[..., 1]


def _heading(*angles):
    return torch.tensor([[math.cos(angle), math.sin(angle)] for angle in angles])


def test_the_default_grid_spans_90_by_60_centimetres_around_the_trunk():
    grid = HeightMapCfg().grid()
    assert grid.shape == (35, 2)
    torch.testing.assert_close(grid.mean(dim=0), torch.zeros(2))
    torch.testing.assert_close(grid.amax(dim=0), torch.tensor([0.45, 0.30]))
    torch.testing.assert_close(grid.amin(dim=0), torch.tensor([-0.45, -0.30]))


def test_a_robots_map_is_that_of_the_robot_alone_and_exact_where_products_are_not():
    grid, generator = HeightMapCfg().grid(), torch.Generator().manual_seed(0)
    base_pos = torch.randn(200, 3, generator=generator)
    heading = _heading(*(6.0 * torch.rand(200, generator=generator)).tolist())
    before = torch.get_float32_matmul_precision()
    torch.set_float32_matmul_precision("medium")  # as in a training
    try:
        heights = _Slope().height_map(grid, base_pos, heading)
        alone = _Slope().height_map(grid, base_pos[7:8], heading[7:8])
    finally:
        torch.set_float32_matmul_precision(before)
    assert torch.equal(heights[7:8], alone)


def test_the_grid_runs_across_first_and_then_along():
    grid = HeightMapCfg(length=0.4, width=0.8, spacing=0.2).grid()
    expected = [[x, y] for x in (-0.2, 0.0, 0.2) for y in (-0.4, -0.2, 0.0, 0.2, 0.4)]
    torch.testing.assert_close(grid, torch.tensor(expected))


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("spacing", 0.0),
        ("spacing", -0.1),
        ("spacing", math.nan),
        ("spacing", math.inf),
        ("length", -0.1),
        ("length", math.nan),
        ("width", -0.1),
        ("width", math.inf),
        ("scale", 0.0),
        ("scale", math.inf),
        ("offset", math.nan),
    ],
)
def test_a_bad_grid_is_refused_by_name_with_its_value(field, value):
    with pytest.raises(ValueError, match=rf"env\.height_map\.{field} must be .*got {value}"):
        HeightMapCfg(**{field: value})


def test_heights_are_normalised_by_offset_and_scale_and_come_back():
    cfg, heights = HeightMapCfg(offset=0.2, scale=0.5), torch.tensor([0.2, 0.7, 0.0])
    torch.testing.assert_close(cfg.normalised(heights), torch.tensor([0.0, 1.0, -0.4]))
    torch.testing.assert_close(cfg.metres(cfg.normalised(heights)), heights)


@pytest.mark.parametrize(
    ("width", "spacing", "across"),
    [
        (0.45, 0.15, (-0.225, -0.075, 0.075, 0.225)),
        (0.15, 0.15, (-0.075, 0.075)),
        (0.6, 0.2, (-0.3, -0.1, 0.1, 0.3)),
        (0.3, 0.1, (-0.15, -0.05, 0.05, 0.15)),  # 0.3 / 0.1 is not 3 in floating point
    ],
)
def test_a_grid_has_the_extent_that_is_asked_for_also_with_no_point_in_its_middle(
    width, spacing, across
):
    grid = HeightMapCfg(length=0.0, width=width, spacing=spacing).grid()
    torch.testing.assert_close(grid[:, 1], torch.tensor(across))
    along = HeightMapCfg(length=width, width=0.0, spacing=spacing).grid()
    torch.testing.assert_close(along[:, 0], torch.tensor(across))


@pytest.mark.parametrize(("field", "value"), [("width", 0.5), ("length", 0.7), ("width", 0.07)])
def test_an_extent_that_is_no_multiple_of_the_spacing_is_refused(field, value):
    message = rf"env\.height_map\.{field} must be a multiple of .*spacing, 0\.15, got {value}$"
    with pytest.raises(ValueError, match=message):
        HeightMapCfg(**{field: value})


def test_a_grid_without_extent_is_the_point_under_the_trunk():
    assert torch.equal(HeightMapCfg(length=0.0, width=0.0).grid(), torch.zeros(1, 2))


def test_flat_ground_is_at_zero_everywhere():
    points = torch.tensor([[[3.0, -4.0], [0.0, 0.0]]])
    assert torch.equal(FlatGround().height(points), torch.zeros(1, 2))


def test_over_flat_ground_every_height_is_the_trunks_wherever_the_grid_lies():
    base_pos = torch.tensor([[5.0, 1.0, 0.31], [0.0, 0.0, 0.2]])
    where = HeightMapCfg().grid(), base_pos, _heading(0.3, 2.0)
    heights = FlatGround().height_map(*where)
    assert torch.equal(heights, torch.tensor([[0.31], [0.2]]).expand(2, 35))
    assert torch.equal(heights, Ground.height_map(FlatGround(), *where))


@pytest.mark.parametrize(
    ("yaw", "world"),
    [
        (0.0, (0.4, 0.1)),
        (math.pi / 2, (-0.1, 0.4)),  # ahead is +y, left is -x
        (math.pi, (-0.4, -0.1)),
        (-math.pi / 2, (0.1, -0.4)),
    ],
)
def test_the_grid_turns_with_the_heading(yaw, world):
    ahead_and_left = torch.tensor([[0.4, 0.1]])
    base_pos = torch.tensor([[2.0, 3.0, 0.3]])
    heights = _Slope().height_map(ahead_and_left, base_pos, _heading(yaw))
    ground = (2.0 + world[0]) + 100.0 * (3.0 + world[1])
    torch.testing.assert_close(heights, torch.tensor([[0.3 - ground]]))
