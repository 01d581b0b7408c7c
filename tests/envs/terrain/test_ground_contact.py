"""What is laid is touched as it is told: its normals, its grip, how deep one sinks into it."""

from __future__ import annotations

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
import torch
from ground_helpers import make_ground

from mute.envs.batch_simulation import BatchSimulation
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.randomization import RandomizationCfg
from mute.envs.terrain import KINDS, BoxGround, TerrainCfg
from mute.envs.terrain.figures import FIGURES, LEVELS, TREAD
from mute.envs.terrain.layout import CAP, REACH


def _laid(kind: str, xy: torch.Tensor) -> tuple[BoxGround, BatchSimulation]:
    """Return ground of all levels in turn that is laid around robots. Places: (robots, 2), m."""
    ground, simulation = make_ground(kind, len(xy), seed=5)
    ground.lay(xy)
    return ground, simulation


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("level", range(LEVELS))
def test_a_ball_that_drops_on_a_slope_bounces_along_its_normal(level, side):
    x = 3.6 - 1.6 * side  # of ramps up and down, from the middle of the hill
    ground, simulation = _laid("slopes", torch.tensor([[x, 0.0]]).repeat(LEVELS, 1))
    spec = mujoco.MjSpec()
    spec.option.timestep = 1e-4
    for index in ground._boxes.tolist():
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=simulation.field("geom_pos")[level, index].tolist(),
            size=simulation.field("geom_size")[level, index].tolist(),
            quat=simulation.field("geom_quat")[level, index].tolist(),
        )
    ball = spec.worldbody.add_body(pos=(x, 0.0, 1.2))
    ball.add_freejoint()
    ball.add_geom(size=(0.05, 0.05, 0.05), friction=(1e-6, 0.0, 0.0), priority=1, solref=(-1e6, 0))
    compiled = spec.compile()
    data = mujoco.MjData(compiled)
    before = data.qvel[:3].copy()
    while not data.ncon:
        before = data.qvel[:3].copy()
        mujoco.mj_step(compiled, data)
    while data.ncon:
        mujoco.mj_step(compiled, data)
    change = data.qvel[:3] - before
    angle = FIGURES["slope"][level]
    normal = np.array([-side * math.sin(angle), 0.0, math.cos(angle)])
    np.testing.assert_allclose(change / np.linalg.norm(change), normal, atol=2e-3)


@pytest.mark.parametrize("kind", [name for name in KINDS if name != "flat"])
def test_the_sphere_around_what_is_laid_holds_it_and_ends_close_above_it(kind):
    generator = torch.Generator().manual_seed(0)
    ground, simulation = _laid(kind, torch.zeros(60, 2))
    ids, plane = ground._boxes, simulation.model.geom("floor").id
    shares = []
    for away in (0.0, 3.0, 300.0):
        xy = away + 9.0 * (torch.rand(60, 2, generator=generator) - 0.5)
        ground.lay(xy)
        pos, half = (simulation.field(f"geom_{name}")[:, ids] for name in ("pos", "size"))
        radius = simulation.field("geom_rbound")[:, ids]
        torch.testing.assert_close(radius, half.norm(dim=-1))
        torch.testing.assert_close(simulation.field("geom_aabb")[:, ids, 3:], half)
        upright = simulation.field("geom_quat")[:, ids, 0] == 1.0
        assert bool(upright.all()) == (kind != "slopes")
        over = radius - half[..., 2]
        assert float(over[upright].max()) <= CAP
        # What is out of reach has sunk, so that the sphere does not come up to the plane.
        beside = ((xy[:, None] - pos[..., :2]).abs() - half[..., :2]).amax(dim=-1)
        far = upright & (beside > REACH + TREAD + 1e-5)
        base = simulation.field("geom_pos")[:, plane, 2, None]
        assert bool((pos[..., 2] + radius < base)[far].all())
        shares.append(float(far.double().mean()))
    assert (max(shares) > 0.0) == (kind not in ("uneven", "blocks"))  # all of these is near


_ALIKE = RandomizationCfg(
    friction_factor=(1.0, 1.0),
    added_mass=(0.0, 0.0),
    com_offset=(0.0, 0.0),
    gain_scale=(1.0, 1.0),
    friction_loss=(0.0, 0.0),
    push_interval=0.0,
)


def _robots(kind: str, physics: RandomizationCfg) -> QuadrupedEnv:
    """Return robots in the stance at rest, one on each level of a kind."""
    env = QuadrupedEnv(
        QuadrupedEnvCfg(
            num_envs=LEVELS,
            num_threads=1,
            initial_joint_noise=0.0,
            initial_velocity=0.0,
            random_heading=False,
            terrain=TerrainCfg(kind=kind),
            randomization=physics,
        )
    )
    if isinstance(env.ground, BoxGround):
        env.ground.level = torch.arange(LEVELS)
        env.reset()
    return env


def _slides(kind: str, factor: float) -> torch.Tensor:
    """Return how far feet slide of a robot that is set going, m. Shape: (num_envs, 4)."""
    env = _robots(kind, replace(_ALIKE, friction_factor=(factor, factor)))
    env.simulation.qvel[:, 0] = 0.5
    before = env.foot_pos[:, :, 0].clone()
    env.simulation.step(20)
    return env.foot_pos[:, :, 0] - before


def _sinks(kind: str, factor: float) -> torch.Tensor:
    """Return how deep feet stand below their radius above the ground, m. Shape: (num_envs, 4)."""
    env = _robots(kind, replace(_ALIKE, floor_stiffness=(factor, factor)))
    start = env.foot_pos[:, :, 2].clone()
    env.simulation.step(200)
    return start - env.foot_pos[:, :, 2]


@pytest.mark.parametrize(("kind", "times"), [("stairs_down", 2.0), ("uneven", 1.2)])
def test_feet_slide_further_on_slippery_boxes_as_on_a_plane(kind, times):
    slippery, usual = (_slides(kind, factor) for factor in (0.2, 1.5))
    assert (slippery.mean(dim=1) > times * usual.mean(dim=1)).all()
    if kind == "stairs_down":  # one box, whose top is level
        torch.testing.assert_close(slippery, _slides("flat", 0.2), atol=1e-5, rtol=0.0)
        torch.testing.assert_close(usual, _slides("flat", 1.5), atol=1e-5, rtol=0.0)


def test_feet_sink_deeper_into_softer_boxes_as_into_a_plane():
    soft, usual = (_sinks("stairs_down", factor) for factor in (0.25, 1.0))
    assert (soft - usual > 1e-4).all()
    torch.testing.assert_close(soft, _sinks("flat", 0.25), atol=1e-5, rtol=0.0)
    torch.testing.assert_close(usual, _sinks("flat", 1.0), atol=1e-5, rtol=0.0)
