"""All numbers of a configuration, found by walking it, each to be replaced by another."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from typing import Any

Replace = Callable[[Any], object]
"""Makes the dataclass that holds a number anew, with another in its place."""


def number_fields(cfg: Any, place: str) -> Iterator[tuple[str, Replace]]:
    """Yield the whole name of every number of a dataclass, and how to replace it.

    Dataclasses within it, tuples and dictionaries are walked as well; a name ends at the field, to
    which a dictionary's key is added.
    """
    for field in dataclasses.fields(cfg):

        def replace(value: Any, name: str = field.name) -> object:
            return dataclasses.replace(cfg, **{name: value})

        yield from _numbers(getattr(cfg, field.name), f"{place}.{field.name}", replace)


def _numbers(value: Any, place: str, replace: Replace) -> Iterator[tuple[str, Replace]]:
    if dataclasses.is_dataclass(value):
        # What holds the dataclass is made anew as well: not every one checks itself.
        for name, replace_within in number_fields(value, place):

            def replace_field(new: Any, within: Replace = replace_within) -> object:
                return replace(within(new))

            yield name, replace_field
    elif isinstance(value, tuple):
        for index, item in enumerate(value):

            def replace_item(new: Any, index: int = index) -> object:
                return replace((*value[:index], new, *value[index + 1 :]))

            yield from _numbers(item, place, replace_item)
    elif isinstance(value, dict):
        for key, item in value.items():

            def replace_entry(new: Any, key: str = key) -> object:
                return replace({**value, key: new})

            yield from _numbers(item, f"{place}.{key}", replace_entry)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield place, replace
