"""Dots of a height map lie where the ground is, and where it is taken to be."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
import torch
from standing import Standing

from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.randomization import RandomizationCfg
from mute.envs.terrain import BoxGround, TerrainCfg
from mute.rendering.height_dots import HeightDots


@pytest.fixture(scope="module")
def env() -> QuadrupedEnv:
    """Two robots, the second of which stands on a flight of stairs."""
    cfg = QuadrupedEnvCfg(
        num_envs=2,
        num_threads=1,
        randomization=RandomizationCfg(enabled=False),
        terrain=TerrainCfg(kind="stairs", first_levels=(4, 4)),
    )
    env = QuadrupedEnv(cfg)
    assert isinstance(env.ground, BoxGround)
    env.simulation.qpos[1, :3] = torch.tensor([2.6, 0.2, 1.0])
    env.ground.lay(env.simulation.qpos[:, :2])
    env._read_state()
    return env


def _drawn(dots: HeightDots, room: int = 200) -> tuple[np.ndarray, np.ndarray]:
    """Return the places and colours of what is added to an empty scene."""
    scene = mujoco.MjvScene(mujoco.MjModel.from_xml_string("<mujoco/>"), maxgeom=room)
    dots.add_to(scene)
    geoms = scene.geoms[: scene.ngeom]
    return np.array([geom.pos for geom in geoms]), np.array([geom.rgba for geom in geoms])


def _controller(heights: torch.Tensor) -> Any:
    return SimpleNamespace(estimate=SimpleNamespace(heights=heights))


def test_green_dots_lie_on_the_stairs_and_orange_ones_where_the_estimate_has_them(env):
    below = torch.full((2, len(env.grid)), 0.25)
    places, colours = _drawn(HeightDots(env, _controller(below), robot=1))
    points = len(env.grid)
    assert len(places) == 2 * points
    true, estimated = torch.from_numpy(places).float().split(points)
    torch.testing.assert_close(env.ground.height(torch.stack((true, true))[..., :2])[1], true[:, 2])
    assert true[:, 2].unique().numel() > 2  # several steps
    torch.testing.assert_close(estimated[:, :2], true[:, :2])
    torch.testing.assert_close(estimated[:, 2], torch.full((points,), 0.75))
    green, orange = colours[0], colours[-1]
    assert green[1] > 2 * green[0]
    assert orange[0] > 2 * orange[1]
    assert (colours == np.repeat([green, orange], points, axis=0)).all()


def test_a_controller_without_an_estimate_has_green_dots_alone(env):
    for controller in (Standing(2), _controller(torch.zeros(2, len(env.grid)))):
        if not isinstance(controller, Standing):
            controller.estimate = None  # one that has not acted yet
        places, colours = _drawn(HeightDots(env, controller, robot=1))
        assert len(places) == len(env.grid)
        assert len(np.unique(colours, axis=0)) == 1


def test_a_scene_that_is_full_takes_no_more_dots(env):
    below = torch.full((2, len(env.grid)), 0.25)
    places, _ = _drawn(HeightDots(env, _controller(below)), room=40)
    assert len(places) == 40
