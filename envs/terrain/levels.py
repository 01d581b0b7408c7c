"""Levels that follow what robots can do: up for who gets ahead, down for who does not."""

from __future__ import annotations

import torch

from .figures import LEVELS

__all__ = ["Travelled", "next_levels"]


class Travelled:
    """How far each robot got in its episode, from its start and along its commands, m."""

    def __init__(self, num_envs: int, device: torch.device) -> None:
        """Begin with nothing, at the origin."""
        self.start = torch.zeros(num_envs, 2, device=device)
        """Where its episode began in the world. Shape: (num_envs, 2)."""
        self.away = torch.zeros(num_envs, device=device)
        """Distance from there. Shape: (num_envs,)."""
        self.across = torch.zeros(num_envs, dtype=torch.bool, device=device)
        """Robots whose ground is crossed along x alone: who walks beside stairs has climbed none.
        Shape: (num_envs,)."""
        self.made = torch.zeros(num_envs, device=device)
        """Distance along the commanded direction. Shape: (num_envs,)."""
        self.asked = torch.zeros(num_envs, device=device)
        """Distance that was commanded. Shape: (num_envs,)."""

    def update(
        self, xy: torch.Tensor, command: torch.Tensor, base_lin_vel: torch.Tensor, step_dt: float
    ) -> None:
        """Add a control step.

        Args:
            xy: Where each robot is in the world, m. Shape: (num_envs, 2).
            command: Commands, (v_x, v_y) first, m/s. Shape: (num_envs, 4).
            base_lin_vel: Velocity in the body frame, m/s. Shape: (num_envs, 3).
            step_dt: Control period, s.
        """
        way = xy - self.start
        self.away = torch.where(self.across, way[:, 0].abs(), way.norm(dim=1))
        speed = command[:, :2].norm(dim=1)
        along = (command[:, :2] * base_lin_vel[:, :2]).sum(dim=1) / speed.clamp(min=1e-6)
        self.made = self.made + step_dt * torch.where(speed > 0.0, along, 0.0)
        self.asked = self.asked + step_dt * speed

    def reset(self, mask: torch.Tensor, xy: torch.Tensor) -> None:
        """Begin anew for the masked robots.

        Args:
            mask: Shape: (num_envs,), bool.
            xy: Where they begin, m. Shape: (num_envs, 2).
        """
        self.start = torch.where(mask[:, None], xy, self.start)
        self.away = self.away.masked_fill(mask, 0.0)
        self.made = self.made.masked_fill(mask, 0.0)
        self.asked = self.asked.masked_fill(mask, 0.0)

    def state_dict(self) -> dict[str, torch.Tensor]:
        """Return all that is needed to continue bit for bit."""
        return {name: getattr(self, name).clone() for name in _STATE}

    def load_state_dict(self, state: dict[str, torch.Tensor]) -> None:
        """Continue from a `state_dict`."""
        for name in _STATE:
            setattr(self, name, state[name].to(self.made.device, copy=True))


_STATE = ("start", "away", "made", "asked")


def next_levels(
    level: torch.Tensor,
    travelled: Travelled,
    fallen: torch.Tensor,
    crossed: float,
    passed_share: float,
    unit: torch.Tensor,
) -> torch.Tensor:
    """Return the levels of the next episodes, nearly as is usual in the field (Rudin et al., 2022).

    Up where a robot got away from its start by more than `crossed`, which no circle does, and made
    its share of the way that it was asked for, without a fall; down where it fell before it had got
    so far, or made less than half of that way. Who has solved the highest level goes to one at
    random, so that none is forgotten.

    Args:
        level: Of the episodes that end. Shape: (n,), int64.
        travelled: How far they got; of n robots.
        fallen: Whether they ended in a fall. Shape: (n,), bool.
        crossed: Distance to get away by, m.
        passed_share: Share of the way that was asked for to have made.
        unit: Random numbers in [0, 1), for those who have solved them all. Shape: (n,).
    """
    far = travelled.away > crossed
    up = far & ~fallen & (travelled.made >= passed_share * travelled.asked)
    down = ~far & (fallen | (travelled.made < 0.5 * travelled.asked))
    changed = level + up.long() - down.long()
    anywhere = (unit * LEVELS).long()
    return torch.where(changed >= LEVELS, anywhere, changed.clamp(min=0))
