"""The model-predictive controller as what drives robots, beside trained policies."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field

from mute.config import TaskCfg
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.tasks import FLAT_TASK, make_task

from .controller import MpcController
from .settings import MpcCfg

__all__ = ["MpcDriver"]


def _robots() -> TaskCfg:
    """Return the robots of the flat task, with all that they measure."""
    cfg = make_task(FLAT_TASK)
    observations = dataclasses.replace(cfg.env.observations, sensors=True)
    return dataclasses.replace(cfg, env=dataclasses.replace(cfg.env, observations=observations))


@dataclass
class MpcDriver:
    """Makes model-predictive controllers, see `mute.controllers.driver.Driver`."""

    cfg: TaskCfg = field(default_factory=_robots)
    """The robots, which are those of the flat task."""
    settings: MpcCfg = field(default_factory=MpcCfg)
    """What the controller is set to."""
    task: str = "mpc"
    """Its name."""
    iteration: int = 0
    """It has not been trained."""

    @property
    def quiet_factor(self) -> bool:
        """It knows none."""
        return False

    def controller(self, cfg: QuadrupedEnvCfg) -> MpcController:
        """Return a controller of the robots of an environment, without a past."""
        return MpcController(cfg, self.settings)
