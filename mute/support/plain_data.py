"""Plain data (numbers, text, lists, mappings) as JSON can hold it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

__all__ = ["laid_out", "without_nan"]


def without_nan(value: Any) -> Any:  # noqa: ANN401
    """Return plain data with None for every number that is not finite."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Mapping):
        return {key: without_nan(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [without_nan(item) for item in value]
    return value


def laid_out(value: Any, depth: int = 0) -> str:  # noqa: ANN401
    """Return plain data as JSON whose lines can be read and compared: one for a list of numbers.

    Args:
        value: The data.
        depth: How deep in other data it lies, blanks before its lines.

    Raises:
        ValueError: If a number is not finite.
    """
    if isinstance(value, Mapping):
        parts = [f"{json.dumps(key)}: {laid_out(item, depth + 1)}" for key, item in value.items()]
    elif isinstance(value, list | tuple) and any(map(_holds_more, value)):
        parts = [laid_out(item, depth + 1) for item in value]
    else:
        parts = []
    if not parts:
        return json.dumps(value, allow_nan=False)
    opening, closing = "{}" if isinstance(value, Mapping) else "[]"
    lines = ",\n".join(" " * (depth + 1) + part for part in parts)
    return f"{opening}\n{lines}\n{' ' * depth}{closing}"


def _holds_more(value: object) -> bool:
    return isinstance(value, Mapping | list | tuple)
