"""Several trainings under one name: of one recipe, and told apart by their seeds alone.

The mean over them is that of a method only if nothing else differs; a part that is left out, or
other gains, make another method, and the same file twice makes no second training.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mute.evaluation.comparison.walkers import Walker
from mute.learning.resumption import flat_fields
from mute.support.errors import MuteError

__all__ = ["check_trainings"]

_MAY_DIFFER = ("env.seed", "env.num_threads", "agent.save_interval", "agent.noise_interval")
"""Fields of a configuration that make no other recipe."""

_MOST_TOLD = 3
"""How many fields that differ are named."""


def check_trainings(walkers: Sequence[Walker]) -> None:
    """Check that those of one method are trainings of one recipe.

    Raises:
        MuteError: If two are the same file, of one seed, or of recipes that differ.
    """
    earlier: dict[str, list[Walker]] = {}
    for walker in walkers:
        others = earlier.setdefault(walker.method, [])
        for other in others:
            _check_pair(other, walker)
        others.append(walker)


def _check_pair(first: Walker, second: Walker) -> None:
    who = f"{second.method}: {second.name} is no further training beside {first.name}"
    if first.sha256 == second.sha256:
        raise MuteError(f"{who}: it is the same file, SHA-256 {first.sha256[:12]}")
    one, two = _recipe(first), _recipe(second)
    differing = [name for name in dict.fromkeys((*one, *two)) if one.get(name) != two.get(name)]
    if differing:
        told = [f"{name} {two.get(name)!r}, not {one.get(name)!r}" for name in differing]
        more = len(told) - _MOST_TOLD
        rest = f" and {more} more" if more > 0 else ""
        raise MuteError(
            f"{who}: it has {', '.join(told[:_MOST_TOLD])}{rest}; compare it under a name of its "
            "own, --others NAME=FILE"
        )
    if first.training_seed == second.training_seed:
        raise MuteError(f"{who}: both are of seed {first.training_seed}")


def _recipe(walker: Walker) -> Mapping[str, Any]:
    """Return what trainings of one recipe share: task, configuration, and where they ended."""
    fields = flat_fields(walker.driver.cfg)
    shared = {name: value for name, value in fields.items() if name not in _MAY_DIFFER}
    return {"task": walker.driver.task, "last iteration": walker.driver.iteration} | shared
