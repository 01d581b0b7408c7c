"""What drives robots, whatever it is: a trained policy, or a controller that plans."""

from __future__ import annotations

from typing import Protocol

from mute.config import TaskCfg
from mute.controllers.controller import Controller
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg

__all__ = ["Driver"]


class Driver(Protocol):
    """Makes controllers, and knows what robots they are for."""

    task: str
    """Name of the task, or of the controller where it was trained for none."""
    cfg: TaskCfg
    """The task: robots, and what they measure."""
    iteration: int
    """Last finished iteration of its training, 0 without one."""

    @property
    def quiet_factor(self) -> bool:
        """Whether beta changes how it walks."""
        ...

    def controller(self, cfg: QuadrupedEnvCfg) -> Controller:
        """Return what drives robots, without a past.

        Args:
            cfg: The environment of these robots, which may have other physics than `cfg`.
        """
        ...
