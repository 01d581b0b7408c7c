"""Configurations written by earlier versions, in the form of this one.

`MOVED` tells where a field went; plain data and the options of the command line follow it alike.
"""

from __future__ import annotations

import copy
from typing import Any

__all__ = ["MOVED", "check_resumable", "upgraded"]

MOVED: dict[str, str] = {
    "agent.estimation.network.height_offset": "env.height_map.offset",
    "agent.estimation.network.height_scale": "env.height_map.scale",
}
"""Where the fields of earlier configurations are now, as paths."""

_CRITICS_HEIGHTS = {"height_offset": 0.30, "height_scale": 0.1}
"""How the critic saw heights while only the estimator could be told otherwise, m."""


def upgraded(data: dict[str, Any]) -> dict[str, Any]:
    """Return a configuration as plain data in the form of this version.

    What is in it already, or fits neither form, stays as it is.
    """
    data = copy.deepcopy(data)
    for old, new in MOVED.items():
        _move(data, old.split("."), new.split("."))
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
