"""Robots as they are: each a little different, seeing with noise, pushed by nobody.

All that is said of a policy is measured on the same robots, as the project's defaults have them and
not as its task does: one that was trained on tame robots is judged on the same as any.
"""

from __future__ import annotations

import copy
import dataclasses
from typing import TypeVar

from mute.controllers.driver import Driver
from mute.envs.observations import ObservationsCfg
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.randomization import RandomizationCfg
from mute.evaluation.trials import evaluation_cfg

__all__ = ["robots_cfg", "under_conditions"]


_SomeDriver = TypeVar("_SomeDriver", bound=Driver)


def under_conditions(policy: _SomeDriver) -> _SomeDriver:
    """Return a policy, or another driver, with the usual randomisation and noise."""
    env = policy.cfg.env
    usual = ObservationsCfg()
    env = dataclasses.replace(
        env,
        observations=dataclasses.replace(
            env.observations, noise=usual.noise, noise_level=usual.noise_level
        ),
        randomization=RandomizationCfg(push_interval=0.0),
    )
    changed = copy.copy(policy)
    changed.cfg = dataclasses.replace(policy.cfg, env=env)
    return changed


def robots_cfg(
    policy: Driver, robots: int, seconds: float, seed: int, nominal: bool = False
) -> QuadrupedEnvCfg:
    """Return the environment to measure a policy in.

    Args:
        policy: What walks.
        robots: Number of robots.
        seconds: Longest time that they walk, s.
        seed: Of their physics, their first states and the noise.
        nominal: Whether all are the exact model instead, and see without noise.
    """
    env = under_conditions(policy).cfg.env
    return evaluation_cfg(env, robots, seconds, seed, randomized=not nominal)
