"""A controller that holds the stance, for tests of what drives or measures a walk."""

from __future__ import annotations

import torch
from tensordict import TensorDict

from mute.envs.quadruped_env import NUM_ACTIONS


class Standing:
    """Holds the stance, and notes which robots were reset."""

    def __init__(self, num_envs: int = 1) -> None:
        self.num_envs = num_envs
        self.resets: list[torch.Tensor | None] = []

    def reset(self, mask: torch.Tensor | None = None) -> None:
        self.resets.append(mask)

    def act(self, observations: TensorDict) -> torch.Tensor:
        return torch.zeros(self.num_envs, NUM_ACTIONS)
