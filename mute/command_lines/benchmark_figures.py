"""What is measured of a training, and what the times of its turns say: medians and intervals.

Turns of a block, which are of the same processes, depend on each other. So each block counts as one
value, the median over its turns, and an interval is one of the median over blocks. Whoever stops as
soon as that is narrow stops a little too early: looking is what makes it slightly optimistic.
"""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence
from typing import Any

from mute.command_lines.benchmark_turns import Times
from mute.evaluation.intervals import LEVEL, MedianInterval, median_interval

__all__ = [
    "CAPTIONS",
    "MIN_BLOCKS",
    "PARTS",
    "comparison",
    "figures_of",
    "is_precise",
    "ratios",
    "shortfall",
    "widest",
    "with_interval",
]

MIN_BLOCKS = 6
"""Blocks before an interval counts: of fewer there is none at 95 %."""

PARTS = {
    "engine": (
        "MuJoCo's batch alone: the physics steps of a control step in one call, which fills and "
        "records the same arrays as in training, for the training's own robots. They do its last "
        "rollout again from the same states with the same set points; who has fallen goes on "
        "standing, as in training, and nobody is pushed. Each version does its own training's "
        "rollout again: new / old compares engines on robots that learnt apart from the same seed"
    ),
    "nominal_engine": (
        "the same call for robots without randomisation, which begin every turn standing and are "
        "shaken by noise on their set points"
    ),
    "environment": (
        "the environment alone, which does that rollout again exactly: physics, sensors, rewards, "
        "ends, resets, observations"
    ),
    "collection": (
        "the rollout of one iteration of a training, by its own clock: the environment with "
        "estimator, actor and critic in its loop"
    ),
    "learning": (
        "the update of that iteration, by the same clock: returns, estimator, PPO; its rate counts "
        "the control steps that it learns from"
    ),
    "loop": "collection and learning of one iteration, one after the other",
}
"""What the rates are of, in a sentence each."""

CAPTIONS = {
    "engine": "engine",
    "nominal_engine": "engine, nominal robots",
    "environment": "environment",
    "collection": "collection",
    "learning": "learning",
    "loop": "whole loop",
    "environment_over_engine": "environment / engine",
    "loop_over_engine": "loop / engine",
    "loop_over_nominal_engine": "loop / nominal engine",
}
"""What parts and ratios are called."""

_SHARES = {
    "environment_over_engine": ("environment", "engine"),
    "loop_over_engine": ("loop", "engine"),
    "loop_over_nominal_engine": ("loop", "nominal_engine"),
}
"""How fast a part is as a share of another one."""


def ratios(times: Mapping[str, Times]) -> dict[str, MedianInterval]:
    """Return the ratios of rates, each the median over blocks of the ratios within turns.

    Args:
        times: By version, new or new and old, and part, s.
    """
    found = {
        name: _quotient(times["new"][base], times["new"][part])
        for name, (part, base) in _SHARES.items()
    }
    if "old" in times:
        for part in PARTS:
            found[f"{part}_new_over_old"] = _quotient(times["old"][part], times["new"][part])
    return found


def widest(times: Mapping[str, Times]) -> tuple[str, float]:
    """Return the ratio whose interval is widest, and its half width as a share of the median."""
    widths = {name: interval.half_width for name, interval in ratios(times).items()}
    name = max(widths, key=lambda each: widths[each])
    return name, widths[name]


def is_precise(times: Mapping[str, Times], precision: float) -> bool:
    """Return whether the intervals of all ratios are as narrow as asked for.

    Args:
        times: By version and part, s.
        precision: Half the widest interval, as a share of its median.
    """
    return len(times["new"]["loop"]) >= MIN_BLOCKS and widest(times)[1] <= precision


def shortfall(times: Mapping[str, Times], precision: float) -> str | None:
    """Return what to say of intervals that are wider than asked for; None if none is."""
    blocks = len(times["new"]["loop"])
    name, width = widest(times)
    if width <= precision:
        return None
    how = f"±{width:.1%}" if width < 10.0 else "unknown"
    return (
        f"{blocks} blocks are too few for {precision:.1%}: the {LEVEL:.0%} interval of "
        f"{_spoken(name)} is {how}"
    )


def figures_of(times: Times, ready: Mapping[str, Any]) -> dict[str, Any]:
    """Return a version's figures: medians by name, `intervals` by the same names, memory.

    Args:
        times: Of its parts, s.
        ready: What its worker says of itself.
    """
    steps = ready["control_steps"]
    rates = {
        part: _over_blocks([[steps / each for each in block] for block in times[part]])
        for part in PARTS
    }
    shares = {name: _quotient(times[base], times[part]) for name, (part, base) in _SHARES.items()}
    return {**_plain(rates | shares), "peak_memory_mb": ready["peak_memory_mb"]}


def comparison(times: Mapping[str, Times], memory: Mapping[str, float]) -> dict[str, Any]:
    """Return how much faster the new version's parts are than the old one's, as in `figures_of`.

    Args:
        times: By version and part, s.
        memory: By version, MB.
    """
    quotients = {part: _quotient(times["old"][part], times["new"][part]) for part in PARTS}
    return {**_plain(quotients), "peak_memory_mb": memory["new"] / memory["old"]}


def with_interval(figures: Mapping[str, Any], name: str, form: str) -> str:
    """Return one of `figures_of` or `comparison` as text, with its interval if it has one.

    Args:
        figures: What it is one of.
        name: Which one.
        form: Of each number, as `{:.1%}`.
    """
    low, high = figures["intervals"][name]
    median = form.format(figures[name])
    return median if low is None else f"{median} [{form.format(low)}, {form.format(high)}]"


def _spoken(ratio: str) -> str:
    part = ratio.removesuffix("_new_over_old")
    return CAPTIONS[ratio] if part == ratio else f"{CAPTIONS[part]}, new / old,"


def _quotient(
    numerator: Sequence[Sequence[float]], denominator: Sequence[Sequence[float]]
) -> MedianInterval:
    return _over_blocks(
        [
            [one / two for one, two in zip(above, below, strict=True)]
            for above, below in zip(numerator, denominator, strict=True)
        ]
    )


def _over_blocks(values: Sequence[Sequence[float]]) -> MedianInterval:
    """Return the median, and its interval, of the medians of blocks."""
    return median_interval([statistics.median(block) for block in values])


def _plain(medians: Mapping[str, MedianInterval]) -> dict[str, Any]:
    intervals = {name: [each.low, each.high] for name, each in medians.items()}
    return {name: each.median for name, each in medians.items()} | {"intervals": intervals}
