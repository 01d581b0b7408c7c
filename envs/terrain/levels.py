"""Levels that follow what robots can do: up for who gets ahead, down for who does not."""

from __future__ import annotations

import torch

from .figures import LEVELS

__all__ = ["Travelled", "next_levels"]


class Travelled:
    """How far each robot got along its commands in its episode, and how far it was to get, m."""

    def __init__(self, num_envs: int, device: torch.device) -> None:
        """Begin with nothing."""
        self.made = torch.zeros(num_envs, device=device)
        """Distance along the commanded direction. Shape: (num_envs,)."""
        self.asked = torch.zeros(num_envs, device=device)
        """Distance that was commanded. Shape: (num_envs,)."""

    def update(self, command: torch.Tensor, base_lin_vel: torch.Tensor, step_dt: float) -> None:
        """Add a control step.

        Args:
            command: Commands, (v_x, v_y) first, m/s. Shape: (num_envs, 4).
            base_lin_vel: Velocity in the body frame, m/s. Shape: (num_envs, 3).
            step_dt: Control period, s.
        """
        speed = command[:, :2].norm(dim=1)
        along = (command[:, :2] * base_lin_vel[:, :2]).sum(dim=1) / speed.clamp(min=1e-6)
        self.made = self.made + step_dt * torch.where(speed > 0.0, along, 0.0)
        self.asked = self.asked + step_dt * speed

    def reset(self, mask: torch.Tensor) -> None:
        """Begin anew for the masked robots. Mask shape: (num_envs,), bool."""
        self.made = self.made.masked_fill(mask, 0.0)
        self.asked = self.asked.masked_fill(mask, 0.0)

    def state_dict(self) -> dict[str, torch.Tensor]:
        """Return all that is needed to continue bit for bit."""
        return {"made": self.made.clone(), "asked": self.asked.clone()}

    def load_state_dict(self, state: dict[str, torch.Tensor]) -> None:
        """Continue from a `state_dict`."""
        self.made = state["made"].to(self.made.device, copy=True)
        self.asked = state["asked"].to(self.asked.device, copy=True)


def next_levels(
    level: torch.Tensor,
    made: torch.Tensor,
    asked: torch.Tensor,
    fallen: torch.Tensor,
    crossed: float,
    unit: torch.Tensor,
) -> torch.Tensor:
    """Return the levels of the next episodes, as is usual in the field (Rudin et al., 2022).

    Up where a robot got ahead by more than `crossed` without a fall; down where it made less than
    half of what it was asked for. Who has solved the highest level goes to one at random, so that
    none is forgotten.

    Args:
        level: Of the episodes that end. Shape: (n,), int64.
        made: Distance along the commanded direction, m. Shape: (n,).
        asked: Distance that was commanded, m. Shape: (n,).
        fallen: Whether they ended in a fall. Shape: (n,), bool.
        crossed: Distance to get ahead by, m.
        unit: Random numbers in [0, 1), for those who have solved them all. Shape: (n,).
    """
    up = (made > crossed) & ~fallen
    down = ~up & (made < 0.5 * asked)
    changed = level + up.long() - down.long()
    anywhere = (unit * LEVELS).long()
    return torch.where(changed >= LEVELS, anywhere, changed.clamp(min=0))
