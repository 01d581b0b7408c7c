"""One Go1 in plain MuJoCo, with nothing but physics: what `peer_program` gives Gymnasium."""

from __future__ import annotations

from typing import Any

import gymnasium
import mujoco
import numpy as np
from gymnasium import spaces

from mute.envs.batch_simulation import as_stepped
from mute.envs.quadruped_env import NUM_ACTIONS
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.scene import STAND_JOINT_POS, build_scene

__all__ = ["BareGo1"]


class BareGo1(gymnasium.Env[np.ndarray, np.ndarray]):
    """One Go1 whose episode never ends and whose reward is 0.

    Observation: qpos and qvel, shape (37,), float64. Action: offsets from the standing pose in rad,
    shape (12,), float32. The scene and the physics steps of a control step are the task's.
    """

    def __init__(self, cfg: QuadrupedEnvCfg) -> None:
        """Compile the scene.

        Args:
            cfg: The task.
        """
        self._decimation = cfg.decimation
        self._model = as_stepped(build_scene(cfg.scene, pictured=False))
        self._data = mujoco.MjData(self._model)
        size = self._model.nq + self._model.nv
        self.observation_space = spaces.Box(-np.inf, np.inf, (size,), np.float64)
        self.action_space = spaces.Box(-np.inf, np.inf, (NUM_ACTIONS,), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Put the robot into the standing pose; `options` are not used."""
        super().reset(seed=seed)
        stand = self._model.key("stand").id
        mujoco.mj_resetDataKeyframe(self._model, self._data, stand)
        return self._observation(), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Advance by one control step.

        Args:
            action: Offsets from the standing pose, rad. Shape: (12,).

        Returns:
            The observation, a reward of 0, that no episode ends, and an empty `info`.
        """
        self._data.ctrl[:] = np.add(STAND_JOINT_POS, action)
        mujoco.mj_step(self._model, self._data, nstep=self._decimation)
        return self._observation(), 0.0, False, False, {}

    def _observation(self) -> np.ndarray:
        return np.concatenate((self._data.qpos, self._data.qvel))
