"""The same environment for Gymnasium: one robot, or a batch of them as a `VectorEnv`.

`import mute` registers `MUTE/Go1-v0` for `gymnasium.make` and `gymnasium.make_vec`; without an
import, `gymnasium.make("mute.envs.gym:MUTE/Go1-v0")` does both. Observations are the group `policy`
of `quadruped_env`, and what a critic may see besides stands in `info["privileged"]`. The phase
terms of the reward use the true, causal phase here: nothing estimates it outside of training. A
simulation that blows up truncates its episode, and its robot is seen standing where it started.
"""

from __future__ import annotations

import operator
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from mute.support.ranges import Range, check_number

from .camera import Camera
from .gym_robots import Robots, info_of
from .observations import OBS_DIM
from .quadruped_env import NUM_ACTIONS
from .quadruped_env_cfg import QuadrupedEnvCfg
from .rewards import RewardsCfg

__all__ = ["Go1Env", "Go1VectorEnv"]


class Go1Env(gymnasium.Env[np.ndarray, np.ndarray]):
    """One Go1 on the ground.

    Observation: o_t, scaled and noised, shape (46,). Action: joint offsets over `action_scale`,
    shape (12,). Both float32. A fall terminates and the end of `episode_length` truncates, so no
    time limit needs to be wrapped around; `make`'s `max_episode_steps` may still shorten it. `info`
    holds `privileged` (what a critic may see), `landing_speed` (m/s, of the feet that landed in
    this step, else 0) and `unstable` (whether the simulation blew up, which truncates), in `reset`
    and `step`.

    Options of `reset`, for the episode that begins: `command`, (v_x, v_y, w_z) in the body frame,
    m/s and rad/s, held to its end; `beta`, the quiet factor in [0, 1]. Left out, they are drawn.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 50}  # noqa: RUF012, Gymnasium's

    def __init__(
        self,
        cfg: QuadrupedEnvCfg | None = None,
        render_mode: str | None = None,
        width: int = 640,
        height: int = 480,
    ) -> None:
        """Describe the environment; the robot itself is made by the first `reset`.

        Args:
            cfg: The task, or None for the default one with the true phase; `num_envs`, `seed` and
                `num_threads` are not used: there is one robot, and `reset` takes the seed.
            render_mode: None or "rgb_array".
            width: Width of a frame, pixels.
            height: Height of a frame, pixels.

        Raises:
            ValueError: If the render mode is unknown or the reward asks for an estimated phase.
        """
        # One robot keeps one thread busy; more would only wait.
        self._robots = Robots(replace(_checked(cfg), num_envs=1, num_threads=1))
        _check_render_mode(render_mode, self.metadata)
        self.render_mode = render_mode
        self.metadata = {**self.metadata, "render_fps": self._robots.render_fps}
        self.observation_space = _observation_space()
        self.action_space = _action_space(self._robots.cfg)
        self._camera = Camera(width, height)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode; a seed decides all of it, the robot's randomised physics included.

        Raises:
            ValueError: If an option is unknown, or not as the class says.
        """
        super().reset(seed=seed)
        new = seed is not None or not self._robots.exist
        self._robots.reset(int(self.np_random.integers(2**31)) if new else None, options)
        return self._robots.observations()[0], self._info()

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Advance by one control step.

        Args:
            action: Joint offsets over `action_scale`. Shape: (12,).

        Returns:
            The observation, which at an episode's end is its last, the reward, whether the robot
            fell, whether the time is over, and `info`.

        Raises:
            gymnasium.error.ResetNeeded: If there was no `reset` before.
            ValueError: If the action has another shape, or is not finite.
        """
        rewards, terminated, truncated = self._robots.step(np.asarray(action)[np.newaxis])
        observation = self._robots.observations()[0]
        flags = bool(terminated[0]), bool(truncated[0])
        return observation, float(rewards[0]), *flags, self._info()

    def render(self) -> np.ndarray | None:
        """Return a picture that follows the robot, uint8, shape (height, width, 3), or None.

        Raises:
            gymnasium.error.ResetNeeded: If there was no `reset` before.
        """
        if self.render_mode is None:
            return None
        return self._camera.frame(self._robots.env, 0)

    def close(self) -> None:
        """Release the renderer."""
        self._camera.close()

    def _info(self) -> dict[str, Any]:
        return info_of(self._robots.infos(), 0)


class Go1VectorEnv(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """A batch of Go1 robots in one simulation, far faster than as many `Go1Env`.

    Spaces, info and options are those of `Go1Env`, with an axis of robots in front; the options
    `command` and `beta` may be one for all, too, and hold for the first episode of every robot.

    As in Gymnasium's `SyncVectorEnv`, a robot whose episode ends begins anew in the same step, with
    its last observation and info in `infos["final_obs"]` and `infos["final_info"]`, or, with
    `autoreset_mode="NextStep"`, in the next one, which then ignores its action and rewards nothing.
    Wrappers such as `NormalizeObservation` ask for the latter.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012, Gymnasium's
        "render_modes": ["rgb_array"],
        "render_fps": 50,
        "autoreset_mode": AutoresetMode.SAME_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        cfg: QuadrupedEnvCfg | None = None,
        render_mode: str | None = None,
        width: int = 640,
        height: int = 480,
        max_episode_steps: int | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.SAME_STEP,
    ) -> None:
        """Describe the environment; the robots are made by the first `reset`.

        Args:
            num_envs: Number of robots.
            cfg: The task, or None for the default one with the true phase; its `num_envs` and
                `seed` are not used: `reset` takes the seed.
            render_mode: None or "rgb_array".
            width: Width of a frame, pixels.
            height: Height of a frame, pixels.
            max_episode_steps: Longest episode in control steps, in place of the task's.
            autoreset_mode: When a robot whose episode ended begins anew, "SameStep" or "NextStep".

        Raises:
            ValueError: If an argument is out of its range, or the reward asks for an estimated
                phase.
        """
        num_envs = operator.index(num_envs)
        cfg = replace(_checked(cfg), num_envs=num_envs)
        if max_episode_steps is not None:
            cfg = replace(cfg, episode_length=_episode_length(max_episode_steps, cfg))
        self._robots = Robots(cfg)
        _check_render_mode(render_mode, self.metadata)
        self.num_envs = num_envs
        self.render_mode = render_mode
        self._autoreset_mode = _checked_mode(autoreset_mode)
        self._anew = np.zeros(num_envs, dtype=np.bool_)
        self.metadata = {
            **self.metadata,
            "render_fps": self._robots.render_fps,
            "autoreset_mode": self._autoreset_mode,
        }
        self.single_observation_space = _observation_space()
        self.single_action_space = _action_space(self._robots.cfg)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._camera = Camera(width, height)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode everywhere; a seed decides all that follows, physics included.

        Raises:
            ValueError: If an option is unknown, or not as the class says.
        """
        super().reset(seed=seed)
        new = seed is not None or not self._robots.exist
        self._robots.reset(int(self.np_random.integers(2**31)) if new else None, options)
        self._anew = np.zeros(self.num_envs, dtype=np.bool_)
        return self._robots.observations(), self._infos()

    def step(
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Advance every robot by one control step, or begin anew where its episode has ended.

        Args:
            actions: Joint offsets over `action_scale`. Shape: (num_envs, 12).

        Returns:
            Observations (num_envs, 46), rewards (num_envs,), both float32, whether each robot fell,
            whether its time is over, and `infos`.

        Raises:
            gymnasium.error.ResetNeeded: If there was no `reset` before.
            ValueError: If the actions have another shape, or one that counts is not finite.
        """
        rewards, terminated, truncated = self._robots.step(np.asarray(actions), self._anew)
        finished = terminated | truncated
        ends: dict[str, Any] = {}
        if self._autoreset_mode is AutoresetMode.NEXT_STEP:
            self._anew = finished
        elif finished.any():
            ends = self._final_infos(finished)
            self._robots.reset_finished(finished)
        observations = self._robots.observations()
        return observations, rewards, terminated, truncated, {**ends, **self._infos()}

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Return a picture of each robot, uint8, shape (height, width, 3), or None.

        Raises:
            gymnasium.error.ResetNeeded: If there was no `reset` before.
        """
        if self.render_mode is None:
            return None
        return tuple(self._camera.frame(self._robots.env, i) for i in range(self.num_envs))

    def close_extras(self, **kwargs: Any) -> None:  # noqa: ANN401, Gymnasium's
        """Release the renderer."""
        self._camera.close()

    def _infos(self) -> dict[str, Any]:
        infos: dict[str, Any] = {}
        for name, values in self._robots.infos().items():
            infos |= {name: values, f"_{name}": np.ones(self.num_envs, dtype=np.bool_)}
        return infos

    def _final_infos(self, finished: np.ndarray) -> dict[str, Any]:
        observations, infos = self._robots.observations(), self._robots.infos()
        ends: dict[str, Any] = {}
        for i in finished.nonzero()[0].tolist():
            last = {"final_obs": observations[i], "final_info": info_of(infos, i)}
            ends = self._add_info(ends, last, i)
        return ends


def _checked(cfg: QuadrupedEnvCfg | None) -> QuadrupedEnvCfg:
    """Return the default task for None, and refuse what cannot work here."""
    if cfg is None:
        return QuadrupedEnvCfg(rewards=RewardsCfg(phase_source="true"))
    if cfg.rewards.phase_source != "true":
        raise ValueError(
            "env.rewards.phase_source must be 'true' in a Gymnasium environment, where nothing"
            f" estimates the phase, got {cfg.rewards.phase_source!r}"
        )
    return cfg


def _check_render_mode(render_mode: str | None, metadata: dict[str, Any]) -> None:
    if render_mode is not None and render_mode not in metadata["render_modes"]:
        raise ValueError(
            f"render_mode must be None or one of {metadata['render_modes']}, got {render_mode!r}"
        )


def _checked_mode(mode: str | AutoresetMode) -> AutoresetMode:
    """Return a way to begin anew that there is here."""
    allowed = (AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP)
    for each in allowed:
        if mode in (each, each.value):
            return each
    names = " or ".join(repr(each.value) for each in allowed)
    raise ValueError(f"autoreset_mode must be {names}, got {mode!r}")


def _episode_length(max_episode_steps: int, cfg: QuadrupedEnvCfg) -> float:
    """Return the length of an episode of a number of control steps, s."""
    check_number("max_episode_steps", max_episode_steps, Range(1, 10**9, whole=True))
    # Half a step less, so that no rounding makes it one step more.
    return (max_episode_steps - 0.5) * cfg.step_dt


def _observation_space() -> spaces.Box:
    return spaces.Box(-np.inf, np.inf, (OBS_DIM,), np.float32)


def _action_space(cfg: QuadrupedEnvCfg) -> spaces.Box:
    return spaces.Box(-cfg.action_clip, cfg.action_clip, (NUM_ACTIONS,), np.float32)
