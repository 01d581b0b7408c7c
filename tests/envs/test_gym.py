"""Tests of the Gymnasium environments."""

from __future__ import annotations

import warnings
from typing import Any

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from mute.envs.commands import CommandsCfg
from mute.envs.gym import Go1Env, Go1VectorEnv
from mute.envs.observations import OBSERVATION_WIDTHS, ObservationsCfg, slices
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.rewards import RewardsCfg

POLICY = slices(OBSERVATION_WIDTHS)
ACTION, COMMAND = POLICY["last_action"], POLICY["command"]


def _make_cfg(**given):
    return QuadrupedEnvCfg(
        num_threads=1,
        rewards=RewardsCfg(phase_source="true"),
        observations=ObservationsCfg(noise_level=0.0),
        **given,
    )


def _make_env(**given):
    return Go1Env(_make_cfg(**given))


def _make_vector_env(num_envs=3, **given: Any):
    return Go1VectorEnv(num_envs, _make_cfg(**given))


def _constant(env, value=0.3):
    return np.full(env.action_space.shape, value, dtype=np.float32)


def _roll(env, steps, seed=None):
    """Return the observations of a reset and some steps."""
    observations = [env.reset(seed=seed)[0]]
    for step in range(steps):
        action = np.random.default_rng(step).uniform(-0.5, 0.5, env.action_space.shape)
        observations.append(env.step(action.astype(np.float32))[0])
    return np.stack(observations)


# -- one robot ---------------------------------------------------------------------------------


def test_gymnasiums_checker_finds_nothing_but_the_widths_of_the_spaces():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        # Pictures need OpenGL, which a test machine may lack.
        check_env(gymnasium.make("MUTE/Go1-v0").unwrapped, skip_render_check=True)
    known = ("minimum value is -infinity", "maximum value is infinity", "symmetric and normalized")
    messages = [str(warning.message) for warning in caught]
    assert [text for text in messages if not any(part in text for part in known)] == []


def test_the_spaces_are_those_of_the_policy():
    env = _make_env(action_clip=3.0)
    assert env.observation_space.shape == (46,)
    assert env.observation_space.dtype == np.float32
    assert env.action_space == gymnasium.spaces.Box(-3.0, 3.0, (12,), np.float32)


def test_the_same_seed_gives_the_same_episode_in_the_same_and_in_another_environment():
    env = _make_env()
    first = _roll(env, 10, seed=5)
    np.testing.assert_array_equal(_roll(env, 10, seed=5), first)
    np.testing.assert_array_equal(_roll(_make_env(), 10, seed=5), first)


def test_another_seed_gives_another_robot():
    env = _make_env()
    physics = [env.reset(seed=seed)[1]["privileged"][-7:-2] for seed in (1, 2)]
    assert (physics[0] != physics[1]).all()


def test_a_reset_without_seed_is_a_fresh_draw():
    env = _make_env()
    assert not np.array_equal(_roll(env, 1, seed=5), _roll(env, 1))


def test_a_seed_decides_the_episodes_after_the_first_too():
    rollouts = []
    for env in (_make_env(), _make_env()):
        env.reset(seed=5)
        rollouts.append(_roll(env, 3))
    np.testing.assert_array_equal(*rollouts)


def test_environments_that_were_never_seeded_differ():
    assert not np.array_equal(_make_env().reset()[0], _make_env().reset()[0])


def test_time_truncates_and_the_last_observation_is_that_of_the_ended_episode():
    env = _make_env(episode_length=0.1)
    env.reset(seed=0)
    observations, rewards, terminated, truncated, _ = zip(
        *[env.step(_constant(env)) for _ in range(5)], strict=True
    )
    assert list(truncated) == [False, False, False, False, True]
    assert not any(terminated)
    assert all(type(reward) is float for reward in rewards)
    # A robot that had begun anew would remember no action.
    np.testing.assert_array_equal(observations[-1][ACTION], _constant(env))
    assert (env.reset()[0][ACTION] == 0.0).all()


def test_a_fall_terminates_and_the_last_observation_shows_it():
    env = _make_env(max_tilt=0.05)
    env.reset(seed=0)
    upright, terminated = 1.0, False
    while not terminated:
        observation, _, terminated, truncated, _ = env.step(_constant(env, 2.0))
        upright = -observation[POLICY["projected_gravity"]][2]
        assert truncated is False
    assert upright < np.cos(0.05)


def test_a_command_that_was_asked_for_is_held_to_the_end_of_the_episode():
    env = _make_env(commands=CommandsCfg(resampling_time=0.04, standing_fraction=0.0))
    observation, _ = env.reset(seed=0, options={"command": (0.4, -0.2, 0.1), "beta": 0.9})
    expected = np.array([0.4, -0.2, 0.1, 0.9], dtype=np.float32)
    np.testing.assert_array_equal(observation[COMMAND], expected)
    for _ in range(5):
        np.testing.assert_array_equal(env.step(_constant(env))[0][COMMAND], expected)
    assert (env.reset()[0][COMMAND] != expected).all()


def test_beta_alone_leaves_the_velocities_to_the_draw():
    env = _make_env(commands=CommandsCfg(resampling_time=0.04, standing_fraction=0.0))
    before = env.reset(seed=0, options={"beta": 0.9})[0][COMMAND]
    after = [env.step(_constant(env))[0][COMMAND] for _ in range(2)][-1]
    assert before[3] == after[3] == np.float32(0.9)
    assert (after[:3] != before[:3]).all()


@pytest.mark.parametrize(
    "options",
    [{"speed": 1.0}, {"command": (1.0, 0.0)}, {"command": (np.nan, 0.0, 0.0)}, {"beta": 1.5}],
)
def test_a_bad_option_is_refused(options):
    with pytest.raises(ValueError, match=r"options"):
        _make_env().reset(options=options)


def test_returned_arrays_do_not_change_afterwards():
    env = _make_env()
    observation, info = env.reset(seed=0)
    kept = observation.copy(), info["privileged"].copy()
    env.step(_constant(env))
    np.testing.assert_array_equal(observation, kept[0])
    np.testing.assert_array_equal(info["privileged"], kept[1])


def test_a_step_before_a_reset_is_refused():
    env = _make_env()
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(_constant(env))


def test_actions_of_another_shape_are_refused():
    env = _make_env()
    env.reset(seed=0)
    with pytest.raises(ValueError, match="shape"):
        env.step(np.zeros(11))


def test_a_reward_on_an_estimated_phase_is_refused():
    with pytest.raises(ValueError, match="phase_source"):
        Go1Env(QuadrupedEnvCfg())


def test_an_unknown_render_mode_is_refused():
    with pytest.raises(ValueError, match="human"):
        Go1Env(render_mode="human")


class _Renderer:
    """Stands in for MuJoCo's, which needs OpenGL."""

    made = 0

    def __init__(self, model, height, width):
        type(self).made += 1
        self.frame = np.zeros((height, width, 3), dtype=np.uint8)
        self.closed = False

    def update_scene(self, data, camera):
        self.frame[:] = 0
        self.lookat = camera.lookat.copy()
        self.base_pos = data.qpos[:3].copy()

    def render(self):
        self.frame[:] += 1
        return self.frame

    def close(self):
        self.closed = True


def test_pictures_follow_the_robot_from_one_renderer_made_on_demand(monkeypatch):
    monkeypatch.setattr(mujoco, "Renderer", _Renderer)
    monkeypatch.setattr(_Renderer, "made", 0)
    env = Go1Env(_make_cfg(), render_mode="rgb_array", width=32, height=24)
    env.reset(seed=0)
    assert _Renderer.made == 0
    first = env.render()
    for _ in range(5):
        env.step(_constant(env))
    second = env.render()
    assert first is not None
    assert second is not None
    assert first.shape == (24, 32, 3)
    # The picture is the caller's: the renderer's own is painted over.
    assert not np.shares_memory(first, second)
    renderer: Any = env._camera._renderer
    qpos = env._robots.env.simulation.qpos[0, :3].numpy()
    np.testing.assert_allclose(renderer.lookat, qpos, rtol=1e-6)
    np.testing.assert_allclose(renderer.base_pos, qpos, rtol=1e-6)
    env.close()
    assert _Renderer.made == 1
    assert renderer.closed


def test_without_a_render_mode_there_is_no_picture():
    env = _make_env()
    env.reset(seed=0)
    assert env.render() is None


# -- a batch -----------------------------------------------------------------------------------


def test_a_batch_returns_arrays_with_an_axis_of_robots_in_float32():
    env = _make_vector_env(3)
    observations, infos = env.reset(seed=0)
    assert observations.shape == env.observation_space.shape == (3, 46)
    assert observations in env.observation_space
    observations, rewards, terminated, truncated, infos = env.step(_constant(env))
    assert observations.dtype == rewards.dtype == np.float32
    assert rewards.shape == terminated.shape == truncated.shape == (3,)
    assert terminated.dtype == truncated.dtype == np.bool_
    assert infos["privileged"].shape == (3, 53)
    assert infos["_privileged"].all()
    assert env.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP


def test_a_batch_of_one_is_the_single_environment():
    single, batch = _roll(_make_env(), 10, seed=4), _roll(_make_vector_env(1), 10, seed=4)
    np.testing.assert_array_equal(batch[:, 0], single)


def test_the_same_seed_gives_the_same_batch():
    first, same, other = (
        _roll(_make_vector_env(episode_length=0.1), 12, seed=seed) for seed in (4, 4, 5)
    )
    np.testing.assert_array_equal(same, first)
    assert not np.array_equal(other, first)


def test_the_final_observation_is_that_of_the_ended_episode():
    env = _make_vector_env(2, episode_length=0.1)
    env.reset(seed=0)
    for _ in range(4):
        infos = env.step(_constant(env))[4]
        assert "final_obs" not in infos
    observations, _, _, truncated, infos = env.step(_constant(env))
    assert truncated.all()
    assert infos["_final_obs"].all()
    for final, first in zip(infos["final_obs"], observations, strict=True):
        assert (final[ACTION] == np.float32(0.3)).all()
        assert (first[ACTION] == 0.0).all()


def test_only_the_robot_that_fell_begins_anew():
    env = _make_vector_env(2)
    env.reset(seed=0)
    # On its back, without touching anything: the lowest foot is far above the floor.
    qpos = env._robots.env.simulation.qpos
    qpos[1, 2] = 3.0
    qpos[1, 3:7] = qpos.new_tensor([0.0, 1.0, 0.0, 0.0])
    observations, _, terminated, truncated, infos = env.step(_constant(env))
    assert terminated.tolist() == [False, True]
    assert not truncated.any()
    assert infos["final_obs"][0] is None
    assert infos["final_obs"][1][POLICY["projected_gravity"]][2] > 0.9
    assert observations[1][POLICY["projected_gravity"]][2] == pytest.approx(-1.0, abs=1e-3)
    heights = slice(3, 38)
    assert infos["final_info"]["privileged"][1, heights].min() > 20.0  # 2 m over the centre
    assert infos["privileged"][1, heights].max() < 1.0
    assert (observations[0][ACTION] == np.float32(0.3)).all()


def _layout(value):
    """Describe infos by their keys, types, shapes and kinds of number."""
    if isinstance(value, dict):
        return {key: _layout(item) for key, item in value.items()}
    if value.dtype == object:
        return [None if item is None else (item.shape, item.dtype) for item in value]
    return value.shape, value.dtype


@pytest.mark.parametrize("mode", [AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP])
def test_the_infos_are_laid_out_as_those_of_gymnasiums_own_vector_environment(mode):
    own = Go1VectorEnv(2, _make_cfg(episode_length=0.1), autoreset_mode=mode)
    theirs = SyncVectorEnv([lambda: _make_env(episode_length=0.1)] * 2, autoreset_mode=mode)
    layouts = []
    for env in (own, theirs):
        layouts.append([_layout(env.reset(seed=0)[1])])
        layouts[-1] += [_layout(env.step(_constant(env))[4]) for _ in range(6)]
    assert layouts[0] == layouts[1]


def test_a_batch_takes_commands_for_all_or_for_each():
    env = _make_vector_env(2)
    each = np.array([[0.1, 0.0, 0.0], [0.2, 0.0, 0.0]])
    observations, _ = env.reset(options={"command": each, "beta": 0.5})
    np.testing.assert_allclose(observations[:, COMMAND][:, 0], [0.1, 0.2], rtol=1e-6)
    assert (observations[:, COMMAND][:, 3] == 0.5).all()
    observations, _ = env.reset(options={"command": (0.3, 0.0, 0.0), "beta": [0.0, 1.0]})
    assert (observations[:, COMMAND][:, 0] == np.float32(0.3)).all()
    assert observations[:, COMMAND][:, 3].tolist() == [0.0, 1.0]


def test_a_held_command_ends_with_the_episode_of_its_robot():
    env = _make_vector_env(2, commands=CommandsCfg(standing_fraction=0.0))
    env.reset(seed=0, options={"command": (0.4, -0.2, 0.1)})
    env._robots.env.simulation.qpos[1, 2] = -0.2
    observations, _, terminated, _, _ = env.step(_constant(env))
    assert terminated.tolist() == [False, True]
    expected = np.array([0.4, -0.2, 0.1], dtype=np.float32)
    for later in (observations, env.step(_constant(env))[0]):
        np.testing.assert_array_equal(later[0, COMMAND][:3], expected)
        assert (later[1, COMMAND][:3] != expected).all()


def test_a_batch_renders_every_robot(monkeypatch):
    monkeypatch.setattr(mujoco, "Renderer", _Renderer)
    env = Go1VectorEnv(2, _make_cfg(), render_mode="rgb_array", width=32, height=24)
    env.reset(seed=0)
    frames = env.render()
    assert frames is not None
    assert [frame.shape for frame in frames] == [(24, 32, 3)] * 2
    env.close()


# -- what went wrong ---------------------------------------------------------------------------


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_an_action_that_is_no_number_is_refused_with_its_place(value):
    env = _make_vector_env(2)
    env.reset(seed=0)
    actions = _constant(env)
    actions[1, 3] = value
    with pytest.raises(ValueError, match=f"must be finite, got {value} for joint 3 of robot 1"):
        env.step(actions)
    single = _make_env()
    single.reset(seed=0)
    with pytest.raises(ValueError, match=f"must be finite, got {value} for joint 3 of robot 0"):
        single.step(actions[1])


def test_a_simulation_that_blows_up_truncates_and_its_robot_is_seen_standing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its log of warnings into the working directory
    env = _make_env()
    env.reset(seed=0)
    assert env.step(_constant(env))[4]["unstable"] is False
    env._robots.env.simulation.qpos[0, 2] = np.nan
    observation, reward, terminated, truncated, info = env.step(_constant(env))
    assert (reward, terminated, truncated, info["unstable"]) == (0.0, False, True, True)
    assert np.isfinite(observation).all()
    assert np.isfinite(info["privileged"]).all()
    np.testing.assert_allclose(observation[POLICY["projected_gravity"]], (0.0, 0.0, -1.0))
    assert env.reset()[1]["unstable"] is False


@pytest.mark.parametrize("mode", [AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP])
def test_of_a_batch_the_robot_alone_whose_simulation_blew_up_is_told(mode, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    env = Go1VectorEnv(2, _make_cfg(), autoreset_mode=mode)
    env.reset(seed=0)
    env._robots.env.simulation.qpos[1, 2] = np.nan
    _, _, terminated, truncated, infos = env.step(_constant(env))
    assert not terminated.any()
    assert truncated.tolist() == [False, True]
    same = mode is AutoresetMode.SAME_STEP
    told = infos["final_info"]["unstable"] if same else infos["unstable"]
    assert told.tolist() == [False, True]
    assert not env.step(_constant(env))[4]["unstable"].any()
