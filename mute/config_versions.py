"""Configurations written by earlier versions, in the form of this one.

`MOVED` tells where a field went; plain data and the options of the command line follow it alike.
"""

from __future__ import annotations

import copy
from dataclasses import asdict
from typing import Any

from mute.envs.height_map import HeightMapCfg
from mute.envs.rewards import RewardTermCfg, paper_terms, reward_term

__all__ = ["MOVED", "check_resumable", "earlier_terms", "upgraded"]


_EARLIER_NAMES = (
    "lin_vel_tracking",
    "ang_vel_tracking",
    "foot_drop_velocity",
    "foot_raise_velocity",
    "near_ground_drop",
    "landing_speed",
    "lin_vel_z",
    "ang_vel_xy",
    "joint_power",
    "joint_acc",
    "action_rate",
    "collision",
    "base_height",
    "orientation",
    "smoothness",
    "power_distribution",
    "foot_clearance",
    "touchdown_apex",
    "foot_slip",
    "stand_still",
    "tilt",
    "fall",
    "diagonal_support",
)


def earlier_terms() -> dict[str, RewardTermCfg]:
    """Return every term that a reward had while weights were fields, with that field's default."""
    terms = paper_terms()
    for name in _EARLIER_NAMES:
        if name == "tilt":  # it was a function of its own, to stand in another group
            terms[name] = reward_term("orientation", 0.0, group="lift")
        elif name not in terms:
            terms[name] = reward_term(name, 0.0)
    return {name: terms[name] for name in _EARLIER_NAMES}


_WEIGHTS = {f"env.rewards.{name}": f"env.rewards.terms.{name}.weight" for name in _EARLIER_NAMES}
_CONSTANTS = {
    "env.rewards.desired_height": "env.rewards.terms.base_height.params.desired",
    "env.rewards.clearance_target": "env.rewards.terms.foot_clearance.params.target",
    "env.rewards.apex_target": "env.rewards.terms.touchdown_apex.params.target",
}
_HEIGHTS = {
    "agent.estimation.network.height_offset": "env.height_map.offset",
    "agent.estimation.network.height_scale": "env.height_map.scale",
}
MOVED: dict[str, str] = _WEIGHTS | _CONSTANTS | _HEIGHTS
"""Where the fields of earlier configurations are now, as paths."""

_ENGINES = {"mjbatch": "mujoco"}
"""Engines of earlier versions, and those that took their place."""

_FLOOR_FRICTION = 0.8
"""The floor's where a configuration does not name it."""

_CRITICS_HEIGHTS = {"height_offset": 0.30, "height_scale": 0.1}
"""How the critic saw heights while only the estimator could be told otherwise, m."""


def upgraded(data: dict[str, Any]) -> dict[str, Any]:
    """Return a configuration as plain data in the form of this version.

    What is in it already, or fits neither form, stays as it is.
    """
    data = copy.deepcopy(data)
    env = _mapping(data, ["env"])
    if env is not None and env.get("engine") in _ENGINES:
        env["engine"] = _ENGINES[env["engine"]]
    rewards = _mapping(data, ["env", "rewards"])
    flat = rewards is not None and "terms" not in rewards and _holds(rewards, _WEIGHTS | _CONSTANTS)
    _make_friction_a_factor(data)
    for old, new in (MOVED if flat else _HEIGHTS).items():
        _move(data, old.split("."), new.split("."))
    if rewards is not None and flat:
        rewards["terms"] = _filled(rewards["terms"])
        _give_extent_that_was(data)
    return data


def check_resumable(data: dict[str, Any]) -> None:
    """Refuse plain data of a training that cannot go on as it began.

    Raises:
        ValueError: If critic and estimator were given heights in different scales.
    """
    network = data["agent"]["estimation"]["network"]
    for name, value in _CRITICS_HEIGHTS.items():
        if network.get(name, value) != value:
            raise ValueError(
                f"agent.estimation.network.{name} was {network[name]} for the estimator and {value}"
                " for the critic, which now share env.height_map; such a policy can be played and"
                " exported alone"
            )


def _filled(given: dict[str, Any]) -> dict[str, Any]:
    """Return whole terms for what is given of earlier ones, without those that do nothing."""
    terms = {}
    for name, term in earlier_terms().items():
        plain = asdict(term)
        known = given.get(name, {})
        plain["params"] |= known.get("params", {})
        plain["weight"] = known.get("weight", plain["weight"])
        if plain["weight"] != 0.0:
            terms[name] = plain
    return terms


def _make_friction_a_factor(data: dict[str, Any]) -> None:
    """Divide the friction that robots drew, whatever the floor, by that of the floor there was."""
    randomization = _mapping(data, ["env", "randomization"]) or {}
    scene = _mapping(data, ["env", "scene"]) or {}
    drawn, floor = randomization.get("friction"), scene.get("floor_friction", _FLOOR_FRICTION)
    if not isinstance(drawn, list | tuple) or not isinstance(floor, int | float) or floor <= 0.0:
        return
    if "friction_factor" not in randomization and all(
        isinstance(each, int | float) for each in drawn
    ):
        del randomization["friction"]
        randomization["friction_factor"] = [each / floor for each in drawn]


def _give_extent_that_was(data: dict[str, Any]) -> None:
    """Ask for the height map that earlier versions made: an odd number of points each way."""
    grid = _mapping(data, ["env", "height_map"]) or {}
    spacing = grid.get("spacing", HeightMapCfg().spacing)
    for name in ("length", "width"):
        extent = grid.get(name)
        if isinstance(extent, int | float) and isinstance(spacing, int | float) and spacing > 0.0:
            half = round(extent / spacing / 2)
            if round(extent / spacing, 6) != 2 * half:  # else it is what was asked for
                grid[name] = 2 * half * spacing


def _holds(rewards: dict[str, Any], paths: dict[str, str]) -> bool:
    return any(path.removeprefix("env.rewards.") in rewards for path in paths)


def _move(data: dict[str, Any], old: list[str], new: list[str]) -> None:
    """Move a field, unless it is not there or its new place is taken."""
    source = _mapping(data, old[:-1])
    if source is None or old[-1] not in source:
        return
    target = _mapping(data, new[:-1], make=True)
    if target is not None and new[-1] not in target:
        target[new[-1]] = source.pop(old[-1])


def _mapping(data: object, path: list[str], make: bool = False) -> dict[str, Any] | None:
    """Return the mapping at a path, None where there is none; `make` fills in what is missing."""
    for name in path:
        if not isinstance(data, dict):
            return None
        data = data.setdefault(name, {}) if make else data.get(name)
    return data if isinstance(data, dict) else None
