"""A bonus on random actions that fades once a training has found out what there is to do.

Where many robots are at the end of what they can, as over ground whose levels follow them, falls
decide over most of an update, and the bonus outweighs what walking more exactly would bring: robots
explore ever more widely, and walk ever worse.
"""

from __future__ import annotations

from dataclasses import dataclass

from mute.config import AgentCfg
from mute.envs.curriculum import ramp

__all__ = ["Exploration"]


@dataclass(frozen=True)
class Exploration:
    """What the entropy of the actions is worth, from iteration to iteration."""

    entropy_coef: float
    """Weight of the entropy bonus at first."""
    late_share: float
    """What is left of it in the end, as a share."""
    iterations: tuple[int, int]
    """Iterations in which it falls, the first and the last."""

    @classmethod
    def of(cls, cfg: AgentCfg) -> Exploration:
        """Return that of a configuration."""
        return cls(cfg.ppo.entropy_coef, cfg.late_entropy_share, cfg.entropy_iterations)

    def weight(self, iteration: int) -> float:
        """Return the weight of the entropy bonus in an iteration: it falls in a straight line."""
        first, last = self.iterations
        fallen = ramp(iteration + 1, (first, last + 1))
        return self.entropy_coef * (1.0 - fallen * (1.0 - self.late_share))
