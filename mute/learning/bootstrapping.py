"""Adaptive bootstrapping: how often a policy learns from estimated velocities, not from true ones.

A policy that learns from estimates alone learns from a bad estimator at first; one that learns from
the truth is not robust against what it gets in use. Estimates are used with a probability that
grows as the returns of the robots, which all have physics of their own, come to be alike.

Source: Nahrendra et al., "DreamWaQ: learning robust quadrupedal locomotion with implicit terrain
imagination via deep reinforcement learning", ICRA 2023 (arXiv 2301.10602).
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from mute.learning.distributed import Ranks

__all__ = ["AdaptiveBootstrap"]


class AdaptiveBootstrap:
    """Draws for each rollout which robots' networks see the true velocity in place of the estimate.

    The probability of estimates is 1 - tanh(CV), with CV the coefficient of variation (standard
    deviation over mean) of the robots' last returns. The paper draws once for all robots; here each
    robot has a draw of its own, of the same probability.
    """

    def __init__(self, num_envs: int, device: torch.device, ranks: Ranks | None = None) -> None:
        """Begin with the truth for all: no episode has ended yet.

        Args:
            num_envs: Number of robots.
            device: Device of the networks.
            ranks: Processes that learn together, over whose robots the returns vary.
        """
        self._ranks = ranks or Ranks()
        self._running = torch.zeros(num_envs, device=device)
        self._returns = torch.zeros(num_envs, device=device)
        self._known = torch.zeros(num_envs, dtype=torch.bool, device=device)
        self.probability = 0.0
        """Probability of estimates at the last draw."""
        self.told = torch.ones(num_envs, 1, dtype=torch.bool, device=device)
        """Which robots' networks see the true velocity. Shape: (num_envs, 1)."""

    def record(self, rewards: Tensor, dones: Tensor) -> None:
        """Add a control step's rewards to the returns, and close those of the episodes that end.

        Args:
            rewards: Shape: (num_envs,).
            dones: Which episodes end with it. Shape: (num_envs,).
        """
        ended = dones.bool()
        running = self._running + rewards
        self._returns = torch.where(ended, running, self._returns)
        self._known = self._known | ended
        self._running = running.masked_fill(ended, 0.0)

    def forget_running(self) -> None:
        """Drop what episodes that go on have earned: all of them begin anew."""
        self._running = torch.zeros_like(self._running)

    def draw(self) -> None:
        """Draw anew who sees the truth, by the returns so far."""
        self.probability = 1.0 - float(torch.tanh(self._variation()))
        draw = torch.rand(self.told.shape, device=self.told.device)
        self.told = draw >= self.probability

    def state_dict(self) -> dict[str, Any]:
        """Return all that is needed to continue bit for bit."""
        return {
            "running": self._running,
            "returns": self._returns,
            "known": self._known,
            "told": self.told,
            "probability": self.probability,
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from a `state_dict`."""
        device = self.told.device
        self._running = state["running"].to(device)
        self._returns = state["returns"].to(device)
        self._known = state["known"].to(device)
        self.told = state["told"].to(device)
        self.probability = state["probability"]

    def _variation(self) -> Tensor:
        """Return the coefficient of variation of the returns.

        Infinite until half of the robots have ended an episode: a few alike would have all learn
        from an estimator that has learnt nothing.
        """
        returns = self._returns.double() * self._known
        sums = torch.stack((self._known.sum().double(), returns.sum(), returns.square().sum()))
        count, total, squares = self._ranks.mean(sums)
        mean = total / count
        variance = (squares / count - mean.square()).clamp(min=0.0)
        variation = torch.nan_to_num(variance.sqrt() / mean.abs(), nan=torch.inf)
        return torch.where(count < 0.5 * len(self._known), torch.inf, variation)
