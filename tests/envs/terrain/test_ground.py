"""Robots on ground of their own: where they begin, what they touch, and how it goes on."""

from __future__ import annotations

import copy
import dataclasses
import math

import mujoco
import numpy as np
import pytest
import torch

from mute.envs.batch_simulation import BatchSimulation
from mute.envs.quadruped_env import QuadrupedEnv, scene_of
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.randomization import RandomizationCfg
from mute.envs.scene import FOOT_RADIUS, make_spec
from mute.envs.terrain import GROUNDS, KINDS, BoxGround, TerrainCfg, kind_of_robot
from mute.envs.terrain.figures import FIGURES, LEVELS
from mute.envs.terrain.layout import Layout


def _env(kind: str, num_envs: int = 10, **fields) -> QuadrupedEnv:
    cfg = QuadrupedEnvCfg(
        num_envs=num_envs,
        num_threads=1,
        randomization=RandomizationCfg(enabled=False),
        terrain=TerrainCfg(kind=kind, first_levels=(0, 4)),
    )
    return QuadrupedEnv(dataclasses.replace(cfg, **fields))


def _ground(env: QuadrupedEnv) -> BoxGround:
    assert isinstance(env.ground, BoxGround)
    return env.ground


def _walk(env: QuadrupedEnv, steps: int, generator: torch.Generator) -> None:
    for _ in range(steps):
        env.step(2.0 * torch.randn(env.num_envs, 12, generator=generator))


@pytest.mark.parametrize("kind", KINDS)
def test_no_foot_begins_in_the_ground_and_one_stands_on_it(kind):
    env = _env(kind, 60)
    levels = torch.arange(60) % LEVELS
    # Points of the lower half of a foot, all of which have to be above the ground.
    angle, share = torch.meshgrid(
        torch.linspace(0.0, 2.0 * math.pi, 25), torch.linspace(0.0, 1.0, 20), indexing="ij"
    )
    around = FOOT_RADIUS * (share[..., None] * torch.stack((angle.cos(), angle.sin()), dim=-1))
    above = -FOOT_RADIUS * (1.0 - share.square()).sqrt()
    for _ in range(3):
        if isinstance(env.ground, BoxGround):
            env.ground.level = levels.clone()
        env.reset()
        feet = env._sensors.foot_pos
        points = feet[:, :, None, :2] + around.reshape(-1, 2)
        clearance = feet[:, :, 2:] + above.reshape(-1) - env.ground.height(points)
        assert float(clearance.min()) > -1e-5
        lowest = clearance.amin(dim=(1, 2))
        # Beside a higher block a foot may begin as high as that is, in the air.
        highest = torch.tensor(FIGURES["uneven"])[levels] if kind == "uneven" else 1e-5
        assert bool((lowest < highest).all())
        for level in range(LEVELS):
            assert float(lowest[levels == level].median()) < 1e-5
    assert kind == "flat" or torch.equal(_ground(env).level, levels)


@pytest.mark.parametrize("kind", ["stairs", "stairs_down", "slopes"])
def test_robots_begin_along_the_flight(kind):
    env = _env(kind, 200)
    assert float(env.heading[:, 0].abs().min()) >= math.cos(0.25 * math.pi) - 1e-3
    assert (env.heading[:, 0] > 0.0).float().mean() == pytest.approx(0.5, abs=0.15)


def test_each_robot_walks_on_its_own_ground_as_if_it_were_alone():
    both = _env("rough", 6)
    generator = torch.Generator().manual_seed(0)
    actions = [2.0 * torch.randn(6, 12, generator=generator) for _ in range(30)]
    for action in actions:
        both.step(action)
    levels = _ground(both).level.clone()
    other = _env("rough", 6)
    _ground(other).level[0] = (_ground(other).level[0] + 1) % 5  # of one robot alone
    _ground(other).lay(other.simulation.qpos[:, :2], torch.ones(6, dtype=torch.bool))
    for action in actions:
        other.step(action)
    assert torch.equal(both.simulation.qpos[1:], other.simulation.qpos[1:])
    assert torch.equal(levels[1:], _ground(other).level[1:])


def _model_of_its_own(env: QuadrupedEnv, robot: int) -> mujoco.MjModel:
    """Return a model that is compiled with the ground that lies under a robot now."""
    spec = make_spec(scene_of(env.cfg), pictured=False)
    for geom in spec.worldbody.geoms:
        index = env.model.geom(geom.name).id
        for name in ("pos", "size", "quat"):
            setattr(geom, name, env.simulation.field(f"geom_{name}")[robot, index].numpy())
    return spec.compile()


@pytest.mark.parametrize("kind", [name for name in KINDS if name != "flat"])
def test_a_robot_moves_to_the_last_bit_as_in_a_model_with_its_ground_alone(kind):
    env = _env(kind, 3)
    simulation, ground = env.simulation, _ground(env)
    assert isinstance(simulation, BatchSimulation)
    qpos = simulation.qpos
    qpos[:, :2] = torch.tensor([[3.1, 0.2], [1.8, 0.1], [2.5, -0.4]])
    ground.lay(qpos[:, :2])
    around = qpos[:, None, :2] + 0.1 * torch.randint(-4, 5, (3, 200, 2))
    qpos[:, 2] = ground.height(around).amax(dim=1) + 0.33
    simulation.ctrl[:] = env.stand
    simulation.step(60)
    assert (env._sensors.foot_contact.sum(dim=1) > 0.0).all()  # they have come down on it
    states = [simulation._state[robot].copy() for robot in range(3)]
    models = [_model_of_its_own(env, robot) for robot in range(3)]
    simulation.step(20)
    for robot, (state, model) in enumerate(zip(states, models, strict=True)):
        alone = BatchSimulation(model, 1)
        alone._state[:] = state
        alone._show()
        alone.step(20)
        np.testing.assert_array_equal(alone._own["qpos"][0], simulation._own["qpos"][robot])
        np.testing.assert_array_equal(alone._own["qvel"][0], simulation._own["qvel"][robot])


def _contacts(model: mujoco.MjModel, qpos: np.ndarray) -> np.ndarray:
    """Return which shape of the robot touches, how deep, where, along which normal; in order."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    found = data.contact
    shape = found.geom.max(axis=1, keepdims=True)  # the robot's, after the ground's
    rows = np.hstack((shape, found.dist[:, None], found.pos, found.frame[:, :3])).round(6) + 0.0
    return rows[np.lexsort(rows.T[::-1])]


def _drawn_as(model: mujoco.MjModel, boxes: np.ndarray, laid: Layout) -> mujoco.MjModel:
    """Return a model with boxes as a kind lays them for a picture, of one robot."""
    model = copy.copy(model)
    turn = 0.5 * laid.pitch[0].double().numpy()
    model.geom_pos[boxes], model.geom_size[boxes] = laid.pos[0].numpy(), laid.half[0].numpy()
    model.geom_rbound[boxes] = laid.half[0].norm(dim=-1).numpy()
    model.geom_aabb[boxes, 3:] = laid.half[0].numpy()
    model.geom_quat[boxes] = np.stack((np.cos(turn), 0 * turn, np.sin(turn), 0 * turn), axis=-1)
    return model


@pytest.mark.parametrize("kind", [name for name in KINDS if name != "flat"])
def test_a_robot_that_comes_down_on_what_is_laid_touches_what_is_drawn(kind):
    env, draws = _env(kind, 10), np.random.default_rng(0)
    ground, qpos = _ground(env), env.simulation.qpos
    ground.level[:] = torch.arange(10) % 5
    qpos[:, :2] = 3.0 + 2.0 * torch.rand(10, 2, generator=torch.Generator().manual_seed(4))
    ground.lay(qpos[:, :2], torch.ones(10, dtype=torch.bool))
    boxes, shapes = ground._boxes[: KINDS[kind].boxes].numpy(), set()
    for robot in range(10):
        own = slice(robot, robot + 1)
        laid = KINDS[kind].lay(qpos[own, :2], ground.level[own], ground.key[own])
        model = _model_of_its_own(env, robot)
        drawn = _drawn_as(model, boxes, laid)
        pose = qpos[robot].double().numpy().copy()
        if robot % 2:
            pose[3:7] = draws.normal(size=4)  # as one who has fallen
            pose[3:7] /= np.linalg.norm(pose[3:7])
        found = np.empty((0, 8))
        for pose[2] in np.arange(1.5, -1.5, -0.005):
            found = _contacts(model, pose)
            if len(found):
                break
        assert len(found)
        np.testing.assert_allclose(found, _contacts(drawn, pose), atol=3e-6)
        shapes |= set(found[:, 0])
    assert len(shapes) > 4  # not the feet alone


@pytest.mark.parametrize("kind", ["indoor", "rough"])
def test_a_walk_over_ground_goes_on_bit_for_bit(kind):
    one, other = (_env(kind, 6, episode_length=0.3, seed=seed) for seed in (1, 2))
    generator = torch.Generator().manual_seed(0)
    _walk(one, 10, generator)
    other.load_state_dict(one.state_dict())
    state, key = generator.get_state(), _ground(one).key.clone()
    _walk(one, 20, generator)
    generator.set_state(state)
    _walk(other, 20, generator)
    assert (_ground(one).key != key).all()  # all have begun anew, on other ground
    assert torch.equal(one.simulation.qpos, other.simulation.qpos)
    assert torch.equal(_ground(one).level, _ground(other).level)
    assert torch.equal(_ground(one).key, _ground(other).key)


def test_a_state_of_an_earlier_version_goes_on_upon_ground_that_is_laid_anew():
    one, other = (_env("indoor", 12, episode_length=0.3, seed=seed) for seed in (1, 2))
    _walk(one, 10, torch.Generator().manual_seed(0))
    state = one.state_dict()
    for name in ("kinds", "kind"):
        del state["ground"][name]
    other.load_state_dict(state)
    other.step(torch.zeros(12, 12))
    ground, fields = _ground(other), ("geom_pos", "geom_size", "geom_quat")
    laid = [other.simulation.field(name).clone() for name in fields]
    ground.lay(other.simulation.qpos[:, :2], torch.ones(12, dtype=torch.bool))
    for name, before in zip(fields, laid, strict=True):
        torch.testing.assert_close(other.simulation.field(name), before)


def test_robots_that_had_other_kinds_of_ground_do_not_go_on():
    one, other = _env("indoor", 6), _env("rough", 6)
    with pytest.raises(ValueError, match=r"ground of the kinds .* than now: "):
        _ground(other).load_state_dict(_ground(one).state_dict())


def test_heights_around_a_robot_are_those_of_its_ground():
    env = _env("stairs", 5)
    _ground(env).level = torch.arange(5)
    env.simulation.qpos[:, 0] = 3.0  # on the flight
    _ground(env).lay(env.simulation.qpos[:, :2], torch.ones(5, dtype=torch.bool))
    env._read_state()
    heights = env.ground.height_map(env.grid, env.base_pos, env.heading)
    assert (heights.amax(dim=1) - heights.amin(dim=1)).diff().min() > 0.0


def test_heights_are_told_of_some_robots_alone():
    env = _env("indoor", 12)
    generator = torch.Generator().manual_seed(0)
    points = 20.0 * torch.rand(12, 30, 2, generator=generator)
    whole = env.ground.height(points)
    for some in ([3, 1, 8], [0]):
        robots = torch.tensor(some, dtype=torch.long)
        assert torch.equal(env.ground.height(points[robots], robots), whole[robots])


@pytest.mark.parametrize("name", GROUNDS)
def test_kinds_are_shared_out_as_the_table_says(name):
    cfg = TerrainCfg(kind=name)
    kinds = kind_of_robot(cfg, 1000)
    for kind, share in cfg.shares.items():
        assert kinds.count(kind) / 1000 == pytest.approx(share, abs=0.01)


def test_a_kind_that_there_is_not_is_refused_with_those_that_there_are():
    with pytest.raises(ValueError, match=r"env\.terrain\.kind must be .*indoor.*got 'moon'"):
        TerrainCfg(kind="moon")
    with pytest.raises(ValueError, match=r"env\.terrain\.first_levels"):
        TerrainCfg(first_levels=(0, 5))
    with pytest.raises(ValueError, match=r"env\.terrain\.first_levels"):
        TerrainCfg(first_levels=(3, 1))


def test_the_highest_ground_near_a_foot_is_the_step_that_it_is_about_to_meet():
    env = _env("stairs", 1, terrain=TerrainCfg(kind="stairs", first_levels=(2, 2)))
    risers = torch.tensor([[1.2, 1.5, 1.8]])  # where the first steps of a flight begin
    before = torch.stack((risers - 0.1, torch.zeros(1, 3)), dim=-1)
    below = env.ground.below(before, torch.tensor([[1.6, 0.0]]))
    torch.testing.assert_close(below.feet, torch.tensor([[0.0, 0.08, 0.16]]))
    torch.testing.assert_close(below.near_feet, below.feet + 0.08)
    torch.testing.assert_close(below.trunk, torch.tensor([0.16]))
    far = env.ground.below(before - torch.tensor([0.1, 0.0]), torch.zeros(1, 2))
    torch.testing.assert_close(far.near_feet, far.feet)
    level = _env("flat", 1).ground.below(before, torch.zeros(1, 2))
    assert not any(bool(heights.any()) for heights in level)
