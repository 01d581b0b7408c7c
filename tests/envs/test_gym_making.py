"""Tests of `make` and `make_vec`: registration, usual arguments, ends of episodes, wrappers."""

from __future__ import annotations

import subprocess
import sys
import warnings
from itertools import pairwise
from types import ModuleType
from typing import Any

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import ClipAction, vector
from places import REPOSITORY

from mute.envs.gym import Go1Env, Go1VectorEnv
from mute.envs.observations import OBSERVATION_WIDTHS, ObservationsCfg, slices
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.rewards import RewardsCfg

MODES = (AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP)
ACTION = slices(OBSERVATION_WIDTHS)["last_action"]


def _cfg(**given: Any) -> QuadrupedEnvCfg:
    return QuadrupedEnvCfg(
        num_threads=1,
        rewards=RewardsCfg(phase_source="true"),
        observations=ObservationsCfg(noise_level=0.0),
        **given,
    )


def _make_vec(num_envs: int = 2, **given: Any) -> Any:
    return gymnasium.make_vec("MUTE/Go1-v0", num_envs=num_envs, cfg=_cfg(), **given)


def _constant(env: Any, value: float = 0.3) -> np.ndarray:
    return np.full(env.action_space.shape, value, dtype=np.float32)


def _python(source: str) -> str:
    run = subprocess.run(
        [sys.executable, "-W", "error::UserWarning:gymnasium", "-c", source],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    return run.stdout + run.stderr


# -- registration ------------------------------------------------------------------------------


def test_importing_the_package_registers_the_environment_and_imports_neither_torch_nor_it():
    heavy = "[name for name in sys.modules if name.split('.')[0] in ('torch', 'mujoco', 'rsl_rl')]"
    source = f"import sys, mute, gymnasium; print({heavy}, 'mute.envs' in sys.modules)"
    assert _python(source + "; print(gymnasium.spec('MUTE/Go1-v0').entry_point)").split() == [
        "[]",
        "False",
        "mute.envs.gym:Go1Env",
    ]


@pytest.mark.parametrize(
    "source",
    [
        "import mute, gymnasium; env = gymnasium.make('MUTE/Go1-v0')",
        "import mute, gymnasium; env = gymnasium.make_vec('MUTE/Go1-v0', num_envs=1)",
        "import gymnasium; env = gymnasium.make('mute.envs.gym:MUTE/Go1-v0')",
        "import gymnasium, mute, importlib, mute.envs.gym; importlib.reload(mute)"
        "; env = gymnasium.make('mute.envs.gym:MUTE/Go1-v0')",
    ],
)
def test_the_environment_is_made_after_a_mere_import_and_registered_once(source):
    assert _python(f"{source}; print(env.reset(seed=0)[0].shape[-1])").split() == ["46"]


def test_make_gives_the_environment_without_another_time_limit():
    env = gymnasium.make("MUTE/Go1-v0")
    assert isinstance(env.unwrapped, Go1Env)
    assert "TimeLimit" not in str(env)


def test_make_vec_gives_the_batch():
    env = _make_vec(3)
    assert isinstance(env, Go1VectorEnv)
    assert env.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    assert env.reset(seed=0)[0].shape == (3, 46)


def test_a_batch_is_made_again_from_its_spec():
    env = _make_vec(3, max_episode_steps=7, autoreset_mode="NextStep")
    again = gymnasium.make_vec(env.spec)
    assert isinstance(again, Go1VectorEnv)
    assert again.num_envs == 3
    assert again.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    np.testing.assert_array_equal(again.reset(seed=2)[0], env.reset(seed=2)[0])


@pytest.mark.parametrize("mode", ["sync", "async"])
def test_single_environments_can_be_put_side_by_side_with_wrappers_around_each(mode):
    env = _make_vec(
        2,
        vectorization_mode=mode,
        wrappers=[ClipAction],
        vector_kwargs={"autoreset_mode": AutoresetMode.SAME_STEP},
        max_episode_steps=3,
    )
    try:
        assert env.reset(seed=0)[0].shape == (2, 46)
        ends = [env.step(_constant(env))[3].tolist() for _ in range(4)]
    finally:
        env.close()
    assert ends == [[False] * 2, [False] * 2, [True] * 2, [False] * 2]


# -- the length of an episode ------------------------------------------------------------------


@pytest.mark.parametrize("steps", [1, 3, 7])
def test_max_episode_steps_is_the_length_of_an_episode_alone_and_in_a_batch(steps):
    single = gymnasium.make("MUTE/Go1-v0", cfg=_cfg(), max_episode_steps=steps)
    for env in (single, _make_vec(1, max_episode_steps=steps)):
        env.reset(seed=0)
        ends = [bool(np.all(env.step(_constant(env))[3])) for _ in range(steps)]
        assert ends == [False] * (steps - 1) + [True]


def test_no_number_of_steps_is_rounded_to_another():
    for steps in range(1, 3000):
        env = Go1VectorEnv(1, _cfg(), max_episode_steps=steps)
        cfg = env._robots.cfg
        assert np.ceil(cfg.episode_length / cfg.step_dt) == steps


@pytest.mark.parametrize("steps", [0, -1, 2.5])
def test_a_bad_number_of_steps_is_refused_by_name(steps):
    with pytest.raises(ValueError, match=f"max_episode_steps must be an integer >= 1 .*{steps}"):
        _make_vec(max_episode_steps=steps)


# -- the step in which an episode begins anew --------------------------------------------------


@pytest.mark.parametrize("mode", ["NextStep", AutoresetMode.NEXT_STEP])
def test_the_next_step_begins_anew_and_ignores_the_action(mode):
    env = _make_vec(2, max_episode_steps=3, autoreset_mode=mode)
    assert env.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    env.reset(seed=0)
    for _ in range(2):
        env.step(_constant(env))
    observations, rewards, _, truncated, infos = env.step(_constant(env))
    assert truncated.all()
    assert "final_obs" not in infos
    assert (rewards != 0.0).all()
    assert (observations[:, ACTION] == np.float32(0.3)).all()  # the last of the episode
    actions = _constant(env, np.nan)  # counts for nobody
    observations, rewards, terminated, truncated, infos = env.step(actions)
    assert not (terminated | truncated).any()
    assert rewards.tolist() == [0.0, 0.0]
    assert rewards.dtype == np.float32
    assert (observations[:, ACTION] == 0.0).all()
    assert (env._robots.env.episode_length_buf == 0).all()
    ends = [env.step(_constant(env))[3].all() for _ in range(3)]
    assert ends == [False, False, True]


def test_a_robot_that_begins_anew_in_the_next_step_disturbs_no_other():
    env, twin = (_make_vec(2, autoreset_mode="NextStep") for _ in range(2))
    for each in (env, twin):
        each.reset(seed=0)
    env._robots.env.simulation.qpos[1, 2] = -0.2  # in the ground
    for step in range(4):
        observations, rewards, terminated, truncated, _ = env.step(_constant(env))
        expected, expected_rewards, *_ = twin.step(_constant(twin))
        np.testing.assert_array_equal(observations[0], expected[0])
        assert rewards[0] == expected_rewards[0]
        assert terminated.tolist() == [False, step == 0]
        assert not truncated.any()
        assert (rewards[1] == 0.0) == (step == 1)
        assert (observations[1, ACTION] == 0.0).all() == (step == 1)


def test_a_reset_forgets_whose_turn_it_was_to_begin_anew():
    env = _make_vec(2, max_episode_steps=2, autoreset_mode="NextStep")
    env.reset(seed=0)
    for _ in range(2):
        env.step(_constant(env))
    env.reset()
    observations, rewards, *_ = env.step(_constant(env))
    assert (observations[:, ACTION] == np.float32(0.3)).all()
    assert (rewards != 0.0).all()


@pytest.mark.parametrize("mode", ["Disabled", "later"])
def test_another_way_to_begin_anew_is_refused_with_those_that_there_are(mode):
    with pytest.raises(ValueError, match=f"must be 'SameStep' or 'NextStep', got '{mode}'"):
        _make_vec(autoreset_mode=mode)


# -- Gymnasium's wrappers ----------------------------------------------------------------------


def test_observations_are_normalised_by_gymnasiums_wrapper():
    env = vector.NormalizeObservation(_make_vec(2, max_episode_steps=4, autoreset_mode="NextStep"))
    raw = _make_vec(2, max_episode_steps=4, autoreset_mode="NextStep")
    for each in (env, raw):
        each.reset(seed=0)
    for _ in range(9):
        env.step(_constant(env))
        raw.step(_constant(raw))
    seen, expected = env.step(_constant(env))[0], raw.step(_constant(raw))[0]
    rms = env.obs_rms
    np.testing.assert_allclose(seen, (expected - rms.mean) / np.sqrt(rms.var + 1e-8), rtol=1e-3)


@pytest.mark.parametrize("mode", MODES)
def test_the_statistics_of_episodes_are_those_of_the_steps(mode):
    env = vector.RecordEpisodeStatistics(_make_vec(2, max_episode_steps=4, autoreset_mode=mode))
    env.reset(seed=0)
    returns, lengths, ends = np.zeros(2), [], []
    for step in range(9):
        _, rewards, _, truncated, infos = env.step(_constant(env))
        returns += rewards
        if truncated.any():
            np.testing.assert_allclose(infos["episode"]["r"], returns, rtol=1e-5)
            lengths += infos["episode"]["l"].tolist()
            ends.append(step)
            returns[:] = 0.0
    assert lengths == [4] * 4
    assert ends == ([3, 7] if mode is AutoresetMode.SAME_STEP else [3, 8])


@pytest.mark.parametrize("mode", MODES)
def test_rewards_are_normalised_and_actions_clipped(mode):
    env: Any = _make_vec(2, max_episode_steps=3, autoreset_mode=mode)
    env = vector.ClipAction(vector.NormalizeReward(env))
    env.reset(seed=0)
    for _ in range(8):
        observations, rewards, *_ = env.step(_constant(env, 50.0))
        assert np.isfinite(rewards).all()
        assert observations[:, ACTION].max() <= 10.0


class _Clip:
    """Stands in for moviepy's, and keeps how many frames each film had."""

    films: list[int] = []  # noqa: RUF012

    def __init__(self, frames, fps):
        assert fps == 50
        assert all(frame.shape == (24, 64, 3) for frame in frames)
        self.films.append(len(frames))

    def write_videofile(self, path, logger):
        pass


class _Renderer:
    """Stands in for MuJoCo's, which needs OpenGL."""

    def __init__(self, model, height, width):
        self.frame = np.zeros((height, width, 3), dtype=np.uint8)

    def update_scene(self, data, camera):
        pass

    def render(self):
        return self.frame

    def close(self):
        pass


@pytest.mark.parametrize(
    ("mode", "films"), [(AutoresetMode.SAME_STEP, [4, 4]), (AutoresetMode.NEXT_STEP, [5, 5])]
)
def test_episodes_are_filmed_by_gymnasiums_wrapper(mode, films, tmp_path, monkeypatch):
    for name in ("moviepy", "moviepy.video", "moviepy.video.io"):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    clips: Any = ModuleType("moviepy.video.io.ImageSequenceClip")
    clips.ImageSequenceClip = _Clip
    monkeypatch.setitem(sys.modules, clips.__name__, clips)
    monkeypatch.setattr(mujoco, "Renderer", _Renderer)
    monkeypatch.setattr(_Clip, "films", [])
    picture: dict[str, Any] = {"render_mode": "rgb_array", "width": 32, "height": 24}
    env: Any = _make_vec(2, max_episode_steps=4, autoreset_mode=mode, **picture)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that a film of same-step episodes lacks its last frame
        env = vector.RecordVideo(
            env, str(tmp_path), episode_trigger=lambda _: True, video_aspect_ratio=(2, 1)
        )
    env.reset(seed=0)
    for _ in range(sum(films)):
        env.step(_constant(env))
    env.close()
    assert _Clip.films[:2] == films


@pytest.mark.parametrize("mode", MODES)
def test_a_batch_ends_its_episodes_as_gymnasiums_own_vector_environment_does(mode):
    own = _make_vec(2, max_episode_steps=3, autoreset_mode=mode)
    theirs = SyncVectorEnv(
        [lambda: gymnasium.make("MUTE/Go1-v0", cfg=_cfg(), max_episode_steps=3)] * 2,
        autoreset_mode=mode,
    )
    told = []
    for env in (own, theirs):
        env.reset(seed=0)
        steps = [env.step(_constant(env)) for _ in range(9)]
        told.append(
            [
                (truncated.tolist(), (rewards == 0.0).tolist(), (seen[:, ACTION] == 0.0).tolist())
                for seen, rewards, _, truncated, _ in steps
            ]
        )
    assert told[0] == told[1]
    assert any(one != other for one, other in pairwise(told[0]))
