"""The model-predictive controller: what is measured goes in, set points of the motors come out.

Each control step: where the robot is (`senses`), which feet stand (`gait`), what forces these are
to push with (`planner`), where the others land (`footholds`), and what all of that means for the
motors, in every physics step of the coming control step (`motors`).
"""

from __future__ import annotations

import dataclasses

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict

from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.scene import LEGS, build_scene

from .body import Body
from .footholds import footholds, ground_height
from .gait import TrotClock
from .motors import JointTargets, set_points, stance_targets, swing_targets
from .planner import ForcePlanner
from .senses import Moment, Senses
from .settings import MpcCfg
from .stand import Stand

__all__ = ["MpcController"]

Array = NDArray[np.floating]


class MpcController:
    """Drives robots by forces that it plans ahead; keeps the past of each."""

    def __init__(self, cfg: QuadrupedEnvCfg, settings: MpcCfg | None = None) -> None:
        """Start with no past.

        Args:
            cfg: The robots' environment, whose observations have the group `sensors`.
            settings: What it is set to.
        """
        num_envs = self.num_envs = cfg.num_envs
        self._cfg = cfg
        self._settings = settings or MpcCfg()
        self._body = Body.of(build_scene(cfg.scene, pictured=False))
        self._senses = Senses(cfg, self._body, self._settings.true_velocity)
        self._planner = ForcePlanner(self._body, self._settings, num_envs)
        self._stand = Stand(self._body, self._settings, num_envs)
        self._clock = TrotClock(num_envs, self._settings.gait_period)
        self._stance = np.ones((num_envs, len(LEGS)), dtype=bool)
        self._landed = np.ones_like(self._stance)
        self._asked = np.zeros((num_envs, 3))
        self._left_at = np.zeros((num_envs, len(LEGS), 3))
        self._ahead = cfg.scene.timestep * (np.arange(cfg.decimation) + 0.5)

    def reset(self, mask: torch.Tensor | None = None) -> None:
        """Forget the past of the masked robots, or of all. Mask shape: (num_envs,)."""
        robots = np.ones(self.num_envs, dtype=bool) if mask is None else mask.cpu().numpy()
        self._clock.reset(robots)
        self._senses.reset(robots)
        self._planner.reset(robots)
        self._stand.reset(robots)
        self._stance[robots] = self._landed[robots] = True
        self._asked[robots] = 0.0

    def act(self, observations: TensorDict) -> torch.Tensor:
        """Return the actions for each physics step of a control step.

        Returns:
            Shape: (num_envs, decimation, 12).
        """
        now = self._senses.update(observations, self._stance)
        self._choose_stance(now)
        now = self._on_the_way(now)
        clock, walks, step_dt = self._clock, self._clock.walks, self._cfg.step_dt
        ground = ground_height(now.feet, self._stance)
        landing = footholds(now, self._body, self._settings, clock.remaining(), ground)
        forces = self._planner.forces(now, clock, self._stance, ground, landing, step_dt)
        forces = self._stand.update(now, walks, forces, step_dt)
        # Once it has landed a foot is on the ground, on hard floors with bounces.
        self._landed = self._stance & (self._landed | now.touching)
        sinking = self._settings.search_speed * (self._stance & ~self._landed & walks[:, None])
        targets = stance_targets(now, self._body, forces, sinking, self._ahead)
        if not walks.all():
            targets = targets.merged(self._stand.targets(targets, self._ahead), ~walks[:, None])
        if not self._stance.all():
            targets = targets.merged(self._swing(now, landing), ~self._stance)
        action = (set_points(targets, self._body) - self._body.stand) / self._cfg.action_scale
        return torch.from_numpy(action.reshape(self.num_envs, len(self._ahead), -1)).float()

    def _choose_stance(self, now: Moment) -> None:
        walks = self._clock.walks
        speed = np.linalg.norm(now.velocity[:, :2], axis=1)
        beside = np.linalg.norm((now.feet.mean(axis=1) - now.place)[:, :2], axis=1)
        settings = self._settings
        unsteady = speed > np.where(walks, settings.still_speed, settings.pushed_speed)
        unsteady |= ~walks & (beside > settings.largest_shift)
        self._clock.advance(self._cfg.step_dt, (now.command != 0.0).any(axis=1) | unsteady)
        stance = self._clock.stance(np.zeros(1))[:, 0]
        lifted = self._stance & ~stance
        self._left_at[lifted] = now.feet[lifted]
        self._stance: NDArray[np.bool_] = stance

    def _on_the_way(self, now: Moment) -> Moment:
        """Return the same with a command that follows the one that was given."""
        share = 1.0 - np.exp(-self._cfg.step_dt / self._settings.command_time)
        self._asked += share * (now.command - self._asked)
        return dataclasses.replace(now, command=self._asked.copy())

    def _swing(self, now: Moment, landing: Array) -> JointTargets:
        clock = self._clock
        return swing_targets(
            now,
            self._body,
            self._left_at,
            landing,
            self._settings.swing_height,
            clock.progress(self._ahead),
            clock.swing_time,
            self._ahead,
        )
