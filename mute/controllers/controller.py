"""The interface between an environment and what drives it."""

from __future__ import annotations

from typing import Protocol

import torch
from tensordict import TensorDict

__all__ = ["Controller"]


class Controller(Protocol):
    """Turns observations into actions, for a fixed number of robots."""

    num_envs: int
    """Number of robots."""

    def reset(self, mask: torch.Tensor | None = None) -> None:
        """Forget the past of the masked robots, or of all. Mask shape: (num_envs,)."""
        ...

    def act(self, observations: TensorDict) -> torch.Tensor:
        """Return the actions for one control step. Shape: (num_envs, 12)."""
        ...
