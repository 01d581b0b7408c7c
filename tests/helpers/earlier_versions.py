"""Configurations as earlier versions wrote them."""

from __future__ import annotations

import copy
import dataclasses
from typing import Any

from mute.config import TaskCfg
from mute.config_versions import earlier_terms


def with_terms_of_then(cfg: TaskCfg) -> TaskCfg:
    """Return a task with such terms alone as there were while weights were fields."""
    weights = {name: term.weight for name, term in cfg.env.rewards.terms.items()}
    terms = {
        name: dataclasses.replace(term, weight=weights[name])
        for name, term in earlier_terms().items()
        if name in weights
    }
    rewards = dataclasses.replace(cfg.env.rewards, terms=terms)
    return dataclasses.replace(cfg, env=dataclasses.replace(cfg.env, rewards=rewards))


def flat_rewards(plain: dict[str, Any], **changed: float) -> dict[str, Any]:
    """Return a configuration as it was written while the weights of a reward were fields.

    Args:
        plain: As it is written now, without another parameter than the default.
        changed: Fields of the reward to write otherwise.
    """
    plain = copy.deepcopy(plain)
    rewards = plain["env"]["rewards"]
    weights = {name: term["weight"] for name, term in rewards.pop("terms").items()}
    # All were written, used or not.
    unused = dict.fromkeys(("smoothness", "power_distribution", "foot_clearance"), 0.0)
    constants = {"desired_height": 0.3, "clearance_target": 0.06, "apex_target": 0.04}
    plain["env"]["rewards"] = unused | weights | constants | rewards | changed
    return plain


def estimators_own_heights(plain: dict[str, Any], offset: float, scale: float) -> dict[str, Any]:
    """Return a configuration as it was written while the estimator had a scale of its own."""
    plain = copy.deepcopy(plain)
    for name in ("offset", "scale"):
        del plain["env"]["height_map"][name]
    plain["agent"]["estimation"]["network"] |= {"height_offset": offset, "height_scale": scale}
    return plain
