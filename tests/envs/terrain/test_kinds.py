"""Heights in closed form are those of the boxes that are laid, wherever one asks."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
import torch
from ground_helpers import make_ground

from mute.envs.batch_simulation import BatchSimulation
from mute.envs.terrain import KINDS, BoxGround
from mute.envs.terrain.figures import FIGURES, LEVELS, TREAD
from mute.envs.terrain.layout import REACH

_ROBOTS = 15
_AWAY = [name for name in KINDS if name != "flat"]


def _ground(name: str, robots: int = _ROBOTS) -> tuple[BoxGround, BatchSimulation]:
    return make_ground(name, robots, seed=3)


def _model_of(simulation: BatchSimulation, robot: int) -> mujoco.MjModel:
    """Return the model that a robot is stepped with."""
    model = simulation.model
    for name in ("geom_pos", "geom_size", "geom_quat"):
        getattr(model, name)[:] = simulation.field(name)[robot].numpy()
    return model


def _seen_from_above(model: mujoco.MjModel, points: torch.Tensor) -> np.ndarray:
    """Return the height at which rays from above meet the ground, m."""
    data = mujoco.MjData(model)
    data.qpos[2] = 50.0
    mujoco.mj_forward(model, data)
    down, found = np.array([0.0, 0.0, -1.0]), np.zeros(1, dtype=np.int32)
    starts = [np.array([x, y, 10.0]) for x, y in points.tolist()]
    return np.array(
        [10.0 - mujoco.mj_ray(model, data, at, down, None, 1, -1, found) for at in starts]
    )


@pytest.mark.parametrize("name", KINDS)
def test_heights_are_those_of_what_is_laid_within_reach(name):
    ground, simulation = _ground(name)
    generator = torch.Generator().manual_seed(0)
    xy = 40.0 * (torch.rand(_ROBOTS, 2, generator=generator) - 0.5)
    ground.lay(xy)
    # Moved on by less than it takes to be laid anew.
    xy = torch.floor(xy / TREAD) * TREAD + TREAD * torch.rand(_ROBOTS, 2, generator=generator)
    ground.lay(xy)
    around = 2.0 * REACH * (torch.rand(_ROBOTS, 60, 2, generator=generator) - 0.5)
    points = xy[:, None] + around
    heights = ground.height(points)
    for robot in range(_ROBOTS):
        seen = _seen_from_above(_model_of(simulation, robot), points[robot])
        np.testing.assert_allclose(heights[robot].numpy(), seen, atol=1e-5)


def _hair(away: float) -> float:
    """Return the least distance that single precision tells apart for sure so far away, m."""
    return max(1e-6, 4.0 * float(np.spacing(np.float32(abs(away) + 3.0))))


def _edges(ground: BoxGround, simulation: BatchSimulation, xy: torch.Tensor) -> torch.Tensor:
    """Return points on the edges and in the corners of all that is laid, m.

    Those out of a robot's reach are somewhere else within it. Shape: (robots, points, 2).
    """
    ids = ground._boxes
    pos, quat = (simulation.field(f"geom_{name}")[:, ids] for name in ("pos", "quat"))
    half = simulation.field("geom_size")[:, ids]
    turn = 2.0 * torch.atan2(quat[..., 2], quat[..., 0])
    # A ramp's upper edge, at both of its ends.
    x = pos[..., 0] + half[..., 2] * turn.sin()
    middle = torch.stack((x, pos[..., 1]), dim=-1)
    reach = torch.stack((half[..., 0] * turn.cos(), half[..., 1]), dim=-1)
    share = torch.rand(pos[..., :2].shape, generator=torch.Generator().manual_seed(2))
    along = torch.stack((1.0 - 2.0 * share[..., 0], torch.ones_like(share[..., 0])), dim=-1)
    ways = torch.stack((along, along.flip(-1), torch.ones_like(along)), dim=2)
    points = middle[:, :, None] + reach[:, :, None] * torch.cat((ways, -ways), dim=2)
    near = xy[:, None] + (points.flatten(1, 2) - xy[:, None]).clamp(-0.9 * REACH, 0.9 * REACH)
    return near.float()


@pytest.mark.parametrize("away", [0.0, -40.0, 320.0])
@pytest.mark.parametrize("name", _AWAY)
def test_an_edge_is_told_where_it_is_laid_and_as_high_as_one_of_its_sides(name, away):
    ground, simulation = _ground(name)
    hair = _hair(away)
    xy = away + 4.0 * (torch.rand(_ROBOTS, 2, generator=torch.Generator().manual_seed(1)) - 0.5)
    ground.lay(xy)
    edges = _edges(ground, simulation, xy)
    signs = torch.tensor([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]])
    beside = edges[:, :, None] + hair * signs
    told, sides = ground.height(edges), ground.height(beside)
    nearest = (sides - told[..., None]).abs().amin(dim=2)
    assert float(nearest.max()) <= hair  # ramps rise by less than that
    for robot in range(_ROBOTS):
        seen = _seen_from_above(_model_of(simulation, robot), beside[robot].flatten(0, 1))
        np.testing.assert_allclose(sides[robot].flatten().numpy(), seen, atol=1e-5 + hair)
    steps = sides.amax(dim=2) - sides.amin(dim=2)
    if name != "slopes":
        assert int((steps > 1e-3).sum()) > 3  # there were edges


@pytest.mark.parametrize("name", ["stairs", "stairs_down"])
def test_a_steps_edge_belongs_to_it(name):
    ground, _ = _ground(name, LEVELS)
    top = 0.0 if name == "stairs_down" else 4.5
    away = 1.2 + TREAD * torch.arange(8, dtype=torch.float64)  # of the edges from a hill's middle
    edges = torch.cat((top - away, top + away))
    steps = torch.arange(8, 0, -1).repeat(2)
    lowest = -8.0 if name == "stairs_down" else 0.0
    height = torch.tensor(FIGURES["riser"])[:, None] * (steps + lowest)
    points = torch.stack((edges, torch.zeros_like(edges)), dim=1).float().expand(LEVELS, -1, -1)
    torch.testing.assert_close(ground.height(points), height)


@pytest.mark.parametrize("forward", [True, False])
@pytest.mark.parametrize("name", _AWAY)
def test_ground_lies_around_robots_from_one_boundary_of_a_cell_to_the_other(name, forward):
    ground, simulation = _ground(name)
    generator = torch.Generator().manual_seed(0)
    near = TREAD * torch.randint(-12, 12, (_ROBOTS, 2), generator=generator).double()
    hair = 1e-6 * torch.tensor([-1.0, 0.0, 1.0]).repeat(_ROBOTS // 3)[:, None]
    ends = [near + hair, near + TREAD - 2e-6]
    around = 2.0 * REACH * (torch.rand(_ROBOTS, 60, 2, generator=generator) - 0.5)
    around[:, :20] = REACH * around[:, :20].sign()
    for xy in ends if forward else reversed(ends):
        xy = xy.float()
        ground.lay(xy)
        points = xy[:, None] + 0.999 * around
        heights = ground.height(points)
        for robot in range(_ROBOTS):
            seen = _seen_from_above(_model_of(simulation, robot), points[robot])
            np.testing.assert_allclose(heights[robot].numpy(), seen, atol=1e-5)


@pytest.mark.parametrize("name", KINDS)
def test_robots_begin_on_level_ground_at_height_zero(name):
    ground, _ = _ground(name)
    within = 0.45 * (2.0 * torch.rand(_ROBOTS, 100, 2) - 1.0)
    if name == "uneven":  # which is level nowhere
        largest = torch.tensor(FIGURES["uneven"])[ground.level]
        assert (ground.height(within).abs().amax(dim=1) <= 0.5 * largest).all()
    else:
        assert float(ground.height(within).abs().max()) == 0.0


@pytest.mark.parametrize("name", _AWAY)
def test_a_higher_level_has_more_between_its_lowest_and_highest_place(name):
    ground, _ = _ground(name, LEVELS)
    ground.key = torch.full((LEVELS,), 77)
    line = torch.linspace(-30.0, 30.0, 4001)
    points = torch.stack((line, torch.full_like(line, 0.3)), dim=1).expand(LEVELS, -1, -1)
    heights = ground.height(points)
    spread = heights.amax(dim=1) - heights.amin(dim=1)
    assert (spread.diff() > 0.0).all()


@pytest.mark.parametrize("name", ["stairs", "stairs_down"])
def test_stairs_have_risers_of_their_level_and_treads_of_30_centimetres(name):
    ground, _ = _ground(name, LEVELS)
    line = torch.arange(0.0, 9.0, 0.01) + 0.005
    points = torch.stack((line, torch.zeros_like(line)), dim=1).expand(LEVELS, -1, -1)
    rises = ground.height(points).diff(dim=1)
    risers = torch.tensor(FIGURES["riser"])
    assert (rises[:, (rises != 0.0).any(dim=0)].abs() - risers[:, None]).abs().max() < 1e-6
    first = 1.0 if name == "stairs" else -1.0
    places = torch.nonzero(rises[0])[:, 0]
    assert float(rises[0, places[0]]) * first > 0.0
    flight = places[:8].diff().float() * 0.01
    torch.testing.assert_close(flight, torch.full((7,), TREAD), atol=0.011, rtol=0.0)


def test_a_slope_rises_by_its_angle():
    ground, _ = _ground("slopes", LEVELS)
    points = torch.tensor([[1.5, 0.0], [2.5, 0.0]]).expand(LEVELS, -1, -1)
    rise = ground.height(points).diff(dim=1)[:, 0]
    torch.testing.assert_close(rise, torch.tan(torch.tensor(FIGURES["slope"])))


@pytest.mark.parametrize("name", ["uneven", "blocks", "rooms"])
def test_ground_follows_from_its_key_and_nothing_else(name):
    ground, _ = _ground(name, 3)
    ground.level[:] = 2
    ground.key = torch.tensor([5, 5, 1234])
    points = (20.0 * torch.rand(1, 500, 2, generator=torch.Generator().manual_seed(1))).expand(
        3, -1, -1
    )
    one, same, other = ground.height(points)
    assert torch.equal(one, same)
    assert not torch.equal(one, other)


@pytest.mark.parametrize("middle", [0.0, -7.3, 1000.0])
@pytest.mark.parametrize("name", _AWAY)
def test_each_of_many_points_has_the_height_that_it_has_alone(name, middle):
    # What is looked up at once is the more the further a robot's points lie apart.
    ground, _ = _ground(name, 4)
    ground.level = torch.tensor([1, 4, 4, 2])
    generator = torch.Generator().manual_seed(2)
    apart = torch.tensor([0.1, 1.0, 3.0, 0.0])[:, None, None]
    points = middle + apart * (torch.rand(4, 50, 2, generator=generator) - 0.5)
    alone = torch.cat([ground.height(points[:, [k]]) for k in range(50)], dim=1)
    assert torch.equal(ground.height(points), alone)


def test_rooms_have_cables_sills_carpets_steps_and_stairs():
    ground, _ = _ground("rooms", 1)
    ground.level[:] = 4
    ground.key[:] = 0
    line = torch.arange(0.0, 128 * 2.4, 0.001)
    points = torch.stack((line, torch.zeros_like(line)), dim=1)[None]
    heights = ground.height(points)[0]
    steps = heights.diff().abs()
    risers = steps[steps > 0.0]
    assert float(risers.max()) == pytest.approx(FIGURES["riser"][4], abs=1e-5)
    assert float(heights.max()) == pytest.approx(3 * FIGURES["riser"][4], abs=1e-5)
    assert float(risers.min()) < FIGURES["carpet"][4]
    runs = torch.nonzero(steps)[:, 0].diff() * 0.001
    assert float(runs.min()) < 0.017  # a cable is 8 to 16 mm wide
