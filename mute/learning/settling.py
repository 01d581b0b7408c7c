"""Learning rates that fall towards zero over a training's last iterations.

At the rates that learn fastest, networks never come to rest: from one iteration to the next the
estimated velocity shifts by some cm/s, and the robot walks that much slower or faster. Which
iteration is the last one would be luck.
"""

from __future__ import annotations

from dataclasses import dataclass

from mute.config import AgentCfg

__all__ = ["Settling"]


@dataclass(frozen=True)
class Settling:
    """When learning rates begin to fall, and how far they have."""

    iterations: int
    """Iterations of the whole training."""
    share: float
    """Share of them, the last ones, over which rates fall; 0 for none."""

    @classmethod
    def of(cls, cfg: AgentCfg) -> Settling:
        """Return that of a configuration."""
        return cls(cfg.iterations, cfg.settling_share)

    def rate(self, iteration: int) -> float:
        """Return the learning rates of an iteration as a share of what they were before.

        It falls in a straight line that would reach zero after the last one; whoever goes on beyond
        that learns at the last one's.
        """
        falling = round(self.share * self.iterations)
        left = max(1, self.iterations - iteration)
        return min(1.0, left / falling) if falling else 1.0
