"""What is measured to compare, and where it is kept: what has been measured once is read back."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mute.evaluation.comparison.walkers import MUTE, Walker
from mute.evaluation.noise_levels import SETTLE_TIME, NoiseSetting, measure_noise
from mute.evaluation.tables import read_json, write_json
from mute.support.provenance import digest_of

__all__ = [
    "DIRTY",
    "FLOORS_COMPARED",
    "FULL",
    "MADE_WITH",
    "QUICK",
    "Extent",
    "Job",
    "Kept",
    "jobs",
    "measure",
]

FLOORS_COMPARED = ("wood", "carpet", "tile")
"""Floors of the paper's table."""

MADE_WITH = ("commit", "machine")
"""What a measurement was made with, in each of its rows."""

DIRTY = "-dirty"
"""End of a commit that the working tree differs from, and of the names of files made then."""


@dataclass(frozen=True)
class Extent:
    """How much is measured."""

    trials: int
    """Robots for each setting."""
    seconds: float
    """Measured length of a trial, s."""
    speeds: Mapping[str, tuple[float, ...]]
    """Commanded forward speeds by floor, m/s; around 0.5, so that it is met as an actual one."""
    betas: tuple[float, ...]
    """Quiet factors at these speeds."""
    sweep_betas: tuple[float, ...]
    """Quiet factors of the sweep."""
    sweep_speed: float
    """Commanded forward speed of the sweep, m/s."""
    walk_trials: int
    """Robots of the long walk."""
    calibration_trials: int
    """Robots that the constant is fitted on."""
    calibration_seconds: float
    """Length of their trials, s."""

    def with_trials(self, trials: int | None) -> Extent:
        """Return the same with another number of robots; None leaves it."""
        return self if trials is None else dataclasses.replace(self, trials=trials)


_AROUND = (0.4, 0.5, 0.6, 0.7, 0.8)
FULL = Extent(
    trials=20,
    seconds=10.0,
    speeds={
        "wood": (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0),
        "carpet": _AROUND,
        "tile": _AROUND,
    },
    betas=(0.0, 0.5, 1.0),
    sweep_betas=tuple(round(0.1 * tenth, 1) for tenth in range(11)),
    sweep_speed=0.8,
    walk_trials=16,
    calibration_trials=64,
    calibration_seconds=3.0,
)
"""The paper's: 20 trials of 10 s."""
QUICK = Extent(
    trials=2,
    seconds=2.0,
    speeds=dict.fromkeys(FLOORS_COMPARED, (0.5, 0.8)),
    betas=(0.0, 1.0),
    sweep_betas=(0.0, 0.5, 1.0),
    sweep_speed=0.8,
    walk_trials=1,
    calibration_trials=2,
    calibration_seconds=2.0,
)
"""As little as shows that all of it works; its figures mean nothing."""


@dataclass(frozen=True)
class Job:
    """Trials of one walker on one floor, side by side in one batch."""

    part: str
    """`levels`, or `sweep` of the quiet factor."""
    walker: Walker
    """What walks."""
    surface: str
    """Name of the floor."""
    settings: tuple[NoiseSetting, ...]
    """What is asked for."""

    def steps(self, extent: Extent) -> int:
        """Return how many control steps it takes."""
        return round((extent.seconds + SETTLE_TIME) / self.walker.driver.cfg.env.step_dt)


def jobs(walkers: Sequence[Walker], extent: Extent, parts: Sequence[str]) -> list[Job]:
    """Return what is to be measured, in order; the same floor is never measured twice.

    Args:
        walkers: What is compared.
        extent: How much of it.
        parts: Of `levels` and `sweep`.
    """
    wanted = []
    for walker, surface in itertools.product(walkers, FLOORS_COMPARED):
        betas = walker.betas(extent.betas)
        settings = _settings(betas, extent.speeds[surface])
        wanted.append(Job("levels", walker, surface, settings))
    for walker in walkers:
        if walker.method == MUTE:
            settings = _settings(extent.sweep_betas, (extent.sweep_speed,))
            wanted.append(Job("sweep", walker, "wood", settings))
    return [job for job in wanted if job.part in parts]


def _settings(betas: Sequence[float], speeds: Sequence[float]) -> tuple[NoiseSetting, ...]:
    return tuple(NoiseSetting(beta, speed) for beta in betas for speed in speeds)


def measure(
    job: Job, extent: Extent, seed: int, on_step: Callable[[], None] | None = None
) -> list[dict[str, Any]]:
    """Measure, and return a row for each setting: that of `measure_noise`, and what walked.

    Args:
        job: What to measure.
        extent: How much of it.
        seed: Seed of the robots, of initial states and of the noise.
        on_step: Called after each control step.
    """
    walker = job.walker
    rows = measure_noise(
        walker.driver,
        job.surface,
        job.settings,
        extent.trials,
        extent.seconds,
        seed,
        on_step=on_step,
    )
    return [
        {
            "part": job.part,
            "label": walker.label(row.beta),
            "policy": walker.name,
            "training_seed": walker.training_seed,
        }
        | dataclasses.asdict(row)
        | {"method": walker.method}
        for row in rows
    ]


class Kept:
    """Measurements in a folder, each in a file of its own, beside what was asked for.

    Each row has the commit and the kind of machine that it was measured with. Those of other
    commits are read back, as most change nothing that is measured; those of a working tree that
    differs from its commit never are, as nobody can tell what they were measured with.
    """

    def __init__(self, folder: Path, origin: Mapping[str, str]) -> None:
        """Keep them in a folder.

        Args:
            folder: The folder; it is there.
            origin: What is measured now rests on: `calibration_sha256`, `commit` and `machine`.
        """
        self._folder = folder
        self._calibration = origin["calibration_sha256"]
        self._made_with = {name: origin[name] for name in MADE_WITH}

    def asked(self, job: Job, extent: Extent, seed: int) -> dict[str, Any]:
        """Return what decides how a measurement comes out, as plain data."""
        return {
            "part": job.part,
            "sha256": job.walker.sha256,
            "surface": job.surface,
            "settings": [dataclasses.asdict(setting) for setting in job.settings],
            "trials": extent.trials,
            "seconds": extent.seconds,
            "seed": seed,
            "calibration_sha256": self._calibration,
        }

    def read(self, asked: Mapping[str, Any], walker: Walker) -> list[dict[str, Any]] | None:
        """Return the rows of a measurement that was made; None if it was not.

        Args:
            asked: What is asked for.
            walker: What walked, whose names the rows get: the same file may have been elsewhere.
        """
        path = self._path(asked)
        if not path.is_file():
            return None
        saved = read_json(path)
        if saved.get("asked") != asked:
            return None
        named = {"policy": walker.name, "method": walker.method}
        return [row | {"label": walker.label(row["beta"])} | named for row in saved["rows"]]

    def write(
        self, asked: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]
    ) -> list[dict[str, Any]]:
        """Keep the rows of a measurement, and return them with what they were measured with.

        Raises:
            DiskError: If they cannot be written.
        """
        kept = [{**row, **self._made_with} for row in rows]
        suffix = DIRTY if self._made_with["commit"].endswith(DIRTY) else ""
        write_json(self._path(asked, suffix), {"asked": asked, "rows": kept})
        return kept

    def _path(self, asked: Mapping[str, Any], suffix: str = "") -> Path:
        return self._folder / f"{digest_of(asked)}{suffix}.json"
