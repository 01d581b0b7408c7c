"""The section of `docs/benchmark.md` on what was aimed at: each figure beside its target."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from mute.command_lines.benchmark_figures import with_interval
from mute.command_lines.card_tables import markdown

__all__ = ["targets_section"]

_RATIOS = {
    "engine": ("engine, new / old", 1.2),
    "loop": ("whole loop, new / old", 1.25),
}
_SHARES = {
    "loop_over_engine": ("whole loop / engine", 0.65),
    "loop_over_nominal_engine": ("whole loop / engine with nominal robots", 0.60),
}
_MEMORY = 1200.0
"""The most that a training of the largest number of robots may hold, MB."""
_SOONER = 3.7 / 3.0
"""How many times as soon a training should walk."""


def targets_section(training: Mapping[str, Any], walking: Mapping[str, Any]) -> str:
    """Return the section.

    Args:
        training: What `mute.benchmark` wrote of two versions.
        walking: What it wrote `--until-walking`.
    """
    own = list(_rows(training["rates"], walking))
    columns = {name: (name, "{}") for name in dict.fromkeys(key for row in own for key in row)}
    rows = [{name: row.get(name) for name in columns} for row in own]
    return (
        "## What was aimed at\n\n"
        f"{markdown(rows, columns)}\n\n"
        "What keeps the whole loop from its share of the bare engine are the networks: "
        f"{_shares_of_an_iteration(training['rates'])}; the rest is acting, estimating and what "
        "the environment adds. The batches and passes of PPO are the recipe's, of which cheaper "
        "ones were tried and walk worse ([recipes.md](recipes.md)); and a quicker engine makes "
        "the share smaller."
    )


def _rows(
    rates: list[Mapping[str, Any]], walking: Mapping[str, Any]
) -> Iterator[dict[str, str | None]]:
    for name, (caption, target) in _RATIOS.items():
        cells = {_of(row): with_interval(row["new_over_old"], name, "{:.2f}") for row in rates}
        yield {"figure": caption, "aimed at": f">= {target:g}", **cells}
    for name, (caption, target) in _SHARES.items():
        cells = {_of(row): with_interval(row, name, "{:.0%}") for row in rates}
        yield {"figure": caption, "aimed at": f">= {target:.0%}", **cells}
    last = rates[-1]
    memory = {_of(last): f"{last['peak_memory_mb']:.0f} MB"}
    yield {"figure": "memory", "aimed at": f"< {_MEMORY:.0f} MB", **memory}
    median = walking["median_old_over_new"]
    sooner = f"{median:.2f}" if isinstance(median, float) else None
    caption = "time until a training walks, old / new, median over seeds"
    yield {"figure": caption, "aimed at": f">= {_SOONER:.2f}", _of(rates[0]): sooner}


def _of(row: Mapping[str, Any]) -> str:
    return f"at {row['num_envs']} robots"


def _shares_of_an_iteration(rates: list[Mapping[str, Any]]) -> str:
    """Return how much of an iteration the engine and learning take, in words."""
    told = [
        f"at {row['num_envs']} robots the engine takes {row['loop'] / row['engine']:.0%} of an "
        f"iteration and learning {row['loop'] / row['learning']:.0%}"
        for row in rates
    ]
    return ", ".join(told)
