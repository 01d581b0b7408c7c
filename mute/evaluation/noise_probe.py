"""How loud the policy that is being learnt walks: a short trial between two iterations of training.

A few robots walk on wood in an environment of their own, at the physics steps that sound needs, and
their levels come from the energies of all sources, without audio. So these curves are forecasts of
`evaluate.py noise`. Nothing of the training is touched: neither its robots nor its random numbers.
"""

from __future__ import annotations

import math
from typing import Any

import torch

from mute.acoustics.audible_env import listening_cfg
from mute.controllers.learned import Policy, make_policy
from mute.evaluation.noise_levels import NoiseSetting, measure_noise
from mute.support.precision import full_precision

__all__ = ["NoiseProbe"]

_SURFACE = "wood"
_SPEED = 0.5
"""Commanded forward speed, m/s: the paper's for its noise table."""
_TRIALS = 4
_SECONDS = 2.0
_SEED = 1


class NoiseProbe:
    """Measures the modelled level of a policy at beta 0 and 1, quickly."""

    def __call__(self, saved: dict[str, Any]) -> dict[str, float]:
        """Return the mean noise levels at the microphone on the trunk by curve, dBA.

        Args:
            saved: What `runner.policy_part` returns; see `measure`.
        """
        with torch.random.fork_rng(devices=[]):  # networks are born with random weights
            policy = make_policy(saved)
        return self.measure(policy)

    def measure(self, policy: Policy) -> dict[str, float]:
        """Return the mean noise levels at the microphone on the trunk by curve, dBA.

        Robots that keep falling have no level, and no entry; nor has a policy that acts at times
        which lie between the physics steps.

        Args:
            policy: What walks; its networks are on the CPU.
        """
        try:
            listening_cfg(policy.cfg.env)
        except ValueError:
            return {}
        settings = [NoiseSetting(beta, _SPEED) for beta in (0.0, 1.0)]
        with full_precision():
            rows = measure_noise(
                policy,
                _SURFACE,
                settings,
                _TRIALS,
                _SECONDS,
                _SEED,
                from_energies=True,
            )
        levels = {f"Noise/level_beta_{row.beta:g}": row.mnl_mean for row in rows}
        return {name: level for name, level in levels.items() if not math.isnan(level)}
