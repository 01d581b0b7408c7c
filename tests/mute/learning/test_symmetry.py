"""The mirror image of what the networks see is what a mirrored robot would see."""

from __future__ import annotations

import dataclasses
import math

import pytest
import torch
from learning_helpers import differences, everything, make_cfg
from tensordict import TensorDict

from mute.checkpoint import CheckpointError
from mute.config import AgentCfg, TaskCfg
from mute.envs.height_map import HeightMapCfg
from mute.envs.observations import OBS_DIM, ObservationsCfg
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.randomization import RandomizationCfg, full_randomization
from mute.envs.terrain import TerrainCfg
from mute.learning.estimated_env import estimate_group, go_group, make_estimator
from mute.learning.runner import MuteRunner
from mute.learning.symmetry import FEET, JOINTS, OBSERVATION, POLAR, groups, heights
from mute.networks.estimator import EstimatorCfg
from mute.networks.reflection import Reflection


def _make_symmetric_runner(log_dir=None, iterations: int = 3) -> MuteRunner:
    cfg = make_cfg(iterations)
    agent = dataclasses.replace(cfg.agent, symmetric=True)
    return MuteRunner("go1_mute", dataclasses.replace(cfg, agent=agent), log_dir)


@pytest.fixture(scope="module")
def runner() -> MuteRunner:
    """A run that has learnt from robots that are each on one side of their commands."""
    runner = _make_symmetric_runner()
    assert runner.train()
    return runner


def _groups(env: QuadrupedEnv) -> dict[str, Reflection]:
    cfg = TaskCfg(env=QuadrupedEnvCfg(height_map=env.cfg.height_map))
    return groups(env, make_estimator(cfg), with_phase=True)


def test_a_mirrored_robot_sees_the_mirror_image():
    calm = {"randomization": RandomizationCfg(enabled=False), "initial_velocity": 0.0}
    noiseless = ObservationsCfg(noise_level=0.0)
    env = QuadrupedEnv(QuadrupedEnvCfg(num_envs=2, observations=noiseless, **calm))
    qpos, qvel = env.simulation.qpos, env.simulation.qvel
    qpos[:] = torch.from_numpy(env.model.key("stand").qpos)
    qvel[:] = 0.0
    qvel[0, :6] = torch.tensor([0.3, 0.2, 0.0, 0.5, 0.3, -0.4])
    qvel[1, :6] = torch.tensor([0.3, -0.2, 0.0, -0.5, 0.3, 0.4])
    env.commands.command[:] = torch.tensor([[0.5, 0.2, -0.7, 0.3], [0.5, -0.2, 0.7, 0.3]])
    torch.manual_seed(0)
    reflections = _groups(env)
    action = torch.randn(1, 12)
    columns = env.privileged_slices
    steps = [env.step(torch.cat((action, JOINTS(action)))) for _ in range(8)]
    assert not any(dones.any() for _, _, dones, _ in steps)
    contacts = [seen["privileged"][:, columns["contact"]] for seen, _, _, _ in steps]
    observations = steps[-1][0]
    # The robot is a little lopsided: its centre of mass lies millimetres off the middle, and a foot
    # may touch down a step before its mirror image.
    contact, image = torch.stack(contacts).unbind(1)
    assert (FEET(contact) == image).float().mean() > 0.9
    assert not torch.equal(contact, image)
    smooth = [
        *range(columns["heights"].stop),
        *range(columns["physics"].start, columns["physics"].stop),
    ]
    for name, shown in (("policy", list(range(OBS_DIM))), ("privileged", smooth)):
        robot, mirrored = observations[name]
        expected = reflections[name](robot)[shown]
        torch.testing.assert_close(mirrored[shown], expected, atol=0.05, rtol=0.05)
        assert (robot - mirrored)[shown].abs().max() > 0.2


@pytest.mark.parametrize(
    "cfg", [HeightMapCfg(), HeightMapCfg(1.05, 0.45), HeightMapCfg(spacing=0.03)]
)
def test_a_height_is_mirrored_to_the_point_on_the_other_side(cfg):
    precision = torch.get_float32_matmul_precision()
    torch.set_float32_matmul_precision("medium")
    try:
        grid = cfg.grid()
        index = heights(grid).index
        mirrored = grid[list(index)]
    finally:
        torch.set_float32_matmul_precision(precision)
    torch.testing.assert_close(mirrored, grid * torch.tensor([1.0, -1.0]))
    assert [index[other] for other in index] == list(range(len(grid)))


def test_the_critics_physics_are_mirrored_by_the_side_of_the_centre_of_mass():
    wide = full_randomization()
    env = QuadrupedEnv(QuadrupedEnvCfg(num_envs=3, randomization=wide))
    physics = _groups(env)["privileged"](env.get_observations()["privileged"])[
        :, env.privileged_slices["physics"]
    ]
    # Friction, added mass, where the centre of mass lies along x, y, z, strength and delay.
    signs = torch.tensor([1.0, 1.0, 1.0, -1.0, 1.0, 1.0, 1.0])
    torch.testing.assert_close(physics, env.physics * signs)
    assert (env.physics != 0.0).all()


def test_a_robot_on_mirrored_ground_has_the_mirrored_height_map():
    calm = {"randomization": RandomizationCfg(enabled=False), "initial_velocity": 0.0}
    terrain = TerrainCfg(kind="slopes", first_levels=(3, 3))
    env = QuadrupedEnv(QuadrupedEnvCfg(num_envs=2, terrain=terrain, **calm))
    # Slopes are alike on both sides of the x axis: so are the robots put, and what is below them.
    place = torch.tensor([[1.2, 0.3, 0.5], [1.2, -0.3, 0.5]])
    heading = torch.tensor([[math.cos(0.6), math.sin(0.6)], [math.cos(0.6), -math.sin(0.6)]])
    robot, image = env.ground.height_map(env.grid, place, heading)
    torch.testing.assert_close(heights(env.grid)(robot), image)
    assert (robot - image).abs().max() > 0.05


def test_a_centre_of_mass_that_lies_more_on_one_side_is_refused():
    cfg = make_cfg()
    lopsided = RandomizationCfg(com_offset=(0.0, 0.02))
    env = dataclasses.replace(cfg.env, randomization=lopsided)
    dataclasses.replace(cfg, env=env)
    agent = dataclasses.replace(cfg.agent, symmetric=True)
    with pytest.raises(ValueError, match=r"com_offset must be \(-x, x\) for agent.symmetric"):
        dataclasses.replace(cfg, env=env, agent=agent)


def test_all_networks_commute_with_the_mirror_after_learning(runner):
    estimator = runner.alg.trainer.estimator
    hidden = Reflection.swapped(estimator.cfg.lstm_hidden)
    obs = torch.randn(20, 46)
    state = (torch.randn(20, 16), torch.randn(20, 16))
    privileged = torch.randn(20, runner.env.get_observations()["privileged"].shape[1])
    reflections = groups(runner.env.env, estimator, with_phase=True)
    with torch.no_grad():
        estimate, state_after = estimator.step(obs, state)
        image, image_after = estimator.step(OBSERVATION(obs), (hidden(state[0]), hidden(state[1])))
        decoded = estimator.decode(estimate), estimator.decode(image)
        views = []
        for seen, mirror in ((estimate, False), (image, True)):
            parts = {"policy": obs, "privileged": privileged}
            if mirror:
                parts = {name: reflections[name](part) for name, part in parts.items()}
            parts["estimate"] = estimate_group(seen, estimator, with_phase=True)
            parts["go"] = go_group(parts["policy"], runner.env.cfg)
            views.append(TensorDict(parts, batch_size=[20]))
        actions = [runner.alg.actor(view) for view in views]
        values = [runner.alg.critic(view) for view in views]
    grid = heights(runner.env.env.grid)
    close = torch.testing.assert_close
    close(hidden(state_after[0]), image_after[0])
    close(POLAR(estimate.base_lin_vel), image.base_lin_vel)
    close(grid(estimate.heights), image.heights)
    close(FEET(estimate.phase), image.phase)
    close(OBSERVATION(decoded[0]), decoded[1])
    close(reflections["estimate"](views[0]["estimate"]), views[1]["estimate"])
    close(reflections["go"](views[0]["go"]), views[1]["go"])
    close(JOINTS(actions[0]), actions[1], atol=1e-5, rtol=1e-4)
    close(values[0], values[1], atol=1e-5, rtol=1e-4)
    assert actions[0].std() > 0.001
    assert values[0].std() > 0.001


def test_the_normaliser_knows_the_statistics_of_both_sides():
    runner = _make_symmetric_runner()
    actor = runner.alg.actor
    assert actor.reflection is not None
    batches = [TensorDict({"policy": torch.randn(n, 46) + 1.0}, batch_size=[n]) for n in (30, 50)]
    for batch in batches:
        batch["estimate"] = 2.0 * torch.randn(len(batch), actor.obs_dim - 46) - 3.0
        actor.update_normalization(batch)
    seen = torch.cat([torch.cat((batch["policy"], batch["estimate"]), dim=1) for batch in batches])
    both = torch.cat((seen, actor.reflection(seen)))
    learnt = actor.state_dict()
    torch.testing.assert_close(learnt["obs_normalizer._mean"][0], both.mean(dim=0))
    torch.testing.assert_close(learnt["obs_normalizer._std"][0], both.std(dim=0, correction=0))


def test_both_sides_explore_alike(runner):
    deviation = runner.alg.actor.state_dict()["distribution.std_param"]
    torch.testing.assert_close(JOINTS.unsigned(deviation), deviation)
    assert deviation.std() > 0.0


def test_a_symmetric_run_resumes_bit_for_bit(tmp_path):
    whole = _make_symmetric_runner(tmp_path / "whole")
    assert whole.train()
    resumed = _make_symmetric_runner(tmp_path / "resumed")
    resumed.load(str(tmp_path / "whole" / "model_1.pt"))
    assert resumed.train()
    assert differences(everything(resumed), everything(whole)) == []


def test_what_was_trained_without_is_not_made_symmetric_by_resuming(tmp_path):
    free = MuteRunner("go1_mute", make_cfg(1), tmp_path)
    assert free.train()
    with pytest.raises(CheckpointError, match=r"agent\.symmetric: .* keeps False, got True"):
        _make_symmetric_runner().load(str(tmp_path / "model_0.pt"))


def test_the_first_rollout_of_a_symmetric_run_reproduces_its_estimates():
    runner = _make_symmetric_runner(iterations=1)
    estimator, first = runner.env.estimator, runner.env.get_observations()
    estimate, _ = estimator.step(first["policy"], runner.env.state_before)
    group = estimate_group(estimate, estimator, with_phase=True)
    # Estimated with gradients now and without them then: equal up to rounding.
    torch.testing.assert_close(group, first["estimate"], rtol=0.0, atol=1e-5)


@pytest.mark.parametrize(
    ("field", "value"), [("actor_hidden", (16, 7)), ("critic_hidden", (5,)), ("latent_dim", 3)]
)
def test_odd_widths_are_refused(field, value):
    agent = AgentCfg()
    if field == "latent_dim":
        network = EstimatorCfg(latent_dim=value)
        estimation = dataclasses.replace(agent.estimation, network=network)
        changes = {"estimation": estimation}
    else:
        changes = {field: value}
    dataclasses.replace(agent, **changes)
    with pytest.raises(ValueError, match=rf"agent\.(.*\.)?{field} must be even for agent.symmetr"):
        dataclasses.replace(agent, symmetric=True, **changes)


def test_a_leading_side_needs_symmetric_networks():
    AgentCfg(symmetric=True, leading_side=True)
    with pytest.raises(ValueError, match=r"agent\.leading_side must be false unless agent\.symm"):
        AgentCfg(leading_side=True)


@pytest.mark.parametrize("leading", [False, True])
def test_a_leading_side_alone_keeps_a_mirrored_robot_from_a_mirrored_answer(leading):
    cfg = make_cfg(1)
    agent = dataclasses.replace(cfg.agent, symmetric=True, leading_side=leading)
    torch.manual_seed(0)
    runner = MuteRunner("go1_mute", dataclasses.replace(cfg, agent=agent), None)
    reflections = groups(runner.env.env, runner.env.estimator, with_phase=True)
    seen = runner.env.get_observations()
    names = runner.alg.actor.obs_groups
    image = {name: reflections[name](seen[name]) for name in names}
    with torch.no_grad():
        mirrored = runner.alg.actor(TensorDict(image, batch_size=seen.batch_size))
        answer = JOINTS(runner.alg.actor(seen))
    assert torch.allclose(mirrored, answer, atol=1e-5) is not leading
