"""What is compared: a controller, or one training of a method that is learnt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from mute.controllers.driver import Driver

__all__ = ["DREAMWAQ", "MPC", "MUTE", "Walker", "label"]

MPC, DREAMWAQ, MUTE = "MPC", "DreamWaQ", "MUTE"
"""Methods of the paper."""


@dataclass(frozen=True)
class Walker:
    """One thing that walks."""

    method: str
    """Name of the method: one of the paper's, or the task that was learnt."""
    driver: Driver
    """What drives the robots."""
    name: str
    """The file of the policy, or the name of the controller."""
    sha256: str
    """Digest of that file, or of the controller's settings."""

    @property
    def training_seed(self) -> int | None:
        """Seed of the training; None of what has learnt nothing."""
        return self.driver.cfg.env.seed if self.method != MPC else None

    def betas(self, of_a_quiet_one: Sequence[float]) -> tuple[float, ...]:
        """Return the quiet factors to measure: one alone where beta changes nothing."""
        return tuple(of_a_quiet_one) if self.driver.quiet_factor else (0.0,)

    def label(self, beta: float) -> str:
        """Return what a row of it is called."""
        return label(self.method, beta if self.driver.quiet_factor else None)


def label(method: str, beta: float | None) -> str:
    """Return what a method is called at a quiet factor, which some do not have."""
    return method if beta is None else f"{method}, beta {beta:g}"
