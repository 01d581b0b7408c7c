"""What a robot is asked to do."""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch

__all__ = ["COMMAND_LIMITS", "Command"]

COMMAND_LIMITS = {"beta": (0.0, 1.0), "vx": (-2.0, 2.0), "vy": (-1.0, 1.0), "wz": (-2.0, 2.0)}
"""Lowest and highest value of each part of a command. Speeds reach twice what is trained."""


@dataclass(frozen=True)
class Command:
    """What the robot is asked to do, in the body frame."""

    vx: float = 0.5
    """Forward velocity, m/s."""
    vy: float = 0.0
    """Velocity to the left, m/s."""
    wz: float = 0.0
    """Yaw rate, rad/s."""
    beta: float = 0.5
    """Quiet factor."""

    @property
    def stands(self) -> bool:
        """Whether it asks to stand."""
        return self.vx == self.vy == self.wz == 0.0

    def changed(self, **steps: float) -> Command:
        """Return a command with steps added to its parts, held within the limits."""
        # Rounded, so that steps of 0.1 come back to exactly 0, which asks to stand.
        return self.with_parts(
            **{name: round(getattr(self, name) + step, 6) for name, step in steps.items()}
        )

    def with_parts(self, **values: float) -> Command:
        """Return a command with other parts, held within the limits."""
        held = {}
        for name, value in values.items():
            low, high = COMMAND_LIMITS[name]
            held[name] = min(max(value, low), high)
        return replace(self, **held)

    def tensor(self) -> torch.Tensor:
        """Return (v_x, v_y, w_z, beta). Shape: (4,)."""
        return torch.tensor((self.vx, self.vy, self.wz, self.beta))
