"""The measurements of `evaluate.py paper`: made, or taken from before, and from which commits."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mute.acoustics.origin import policy_origin
from mute.command_lines.card_comparison import measured_before
from mute.command_lines.evaluate_walk import WalkArgs, walk
from mute.command_lines.sound_options import progress_bar, tell
from mute.evaluation.comparison.measurements import DIRTY, Extent, Job, Kept, measure
from mute.support.files import write_file
from mute.support.plain_data import without_nan
from mute.support.provenance import digest_of, file_sha256

__all__ = ["kept_walk", "measured_rows", "tell_of_others", "walked_folder"]


def measured_rows(
    wanted: Sequence[Job], parts: Sequence[str], extent: Extent, seed: int, kept: Kept, anew: bool
) -> list[dict[str, Any]]:
    """Return the rows of all jobs, those read back that were measured before.

    Args:
        wanted: What is compared, of all parts.
        parts: What to measure of it; of other parts, what is there whole is read back.
        extent: How much of it.
        seed: Seed of the robots, of initial states and of the noise.
        kept: What was measured before, and where what is measured now goes.
        anew: Whether to measure what is there, too.
    """
    asked = [kept.asked(job, extent, seed) for job in wanted]
    known = [
        None if anew and job.part in parts else kept.read(each, job.walker)
        for job, each in zip(wanted, asked, strict=True)
    ]
    missing = [job for job, rows in zip(wanted, known, strict=True) if rows is None]
    left_out = {job.part for job in missing if job.part not in parts}
    left = sum(job.steps(extent) for job in missing if job.part in parts)
    done = itertools.count(1)
    rows: list[dict[str, Any]] = []
    with progress_bar("levels", max(left, 1)) as advance:
        for job, each, before in zip(wanted, asked, known, strict=True):
            if job.part in left_out:
                continue
            if before is None:
                measured = measure(job, extent, seed, lambda: advance(next(done)))
                before = without_nan(kept.write(each, measured))
            rows += before
    return rows


def walked_folder(asked: WalkArgs, origin: Mapping[str, str], anew: bool) -> Path:
    """Return the folder of a long walk, made before or now.

    Args:
        asked: The walk; its folder is one in that of its `out`.
        origin: What it rests on if it is made now, see `sound_origin`.
        anew: Whether to make it again.
    """
    before = None if anew else kept_walk(asked, origin)
    if before is not None:
        return before
    folder = _folder(asked, origin)
    if origin["commit"].endswith(DIRTY):
        folder = folder.with_name(folder.name + DIRTY)
    done = folder / _DONE
    done.unlink(missing_ok=True)
    walk(dataclasses.replace(asked, out=folder))
    write_file(done, b"")
    return folder


def kept_walk(asked: WalkArgs, origin: Mapping[str, str]) -> Path | None:
    """Return the folder of a long walk that was made before; None if it was not, or not whole."""
    folder = _folder(asked, origin)
    return folder if (folder / _DONE).is_file() else None


def _folder(asked: WalkArgs, origin: Mapping[str, str]) -> Path:
    decisive = {
        "policy_sha256": policy_origin(asked.policy)["policy_sha256"],
        "calibration_sha256": origin["calibration_sha256"],
        "course_sha256": file_sha256(asked.course),
        "beta": asked.beta,
        "seed": asked.seed,
        "trials": asked.trials,
    }
    return asked.out / digest_of(decisive)


_DONE = "done"
"""File in the folder of a walk; what is there without was stopped."""


def tell_of_others(found: Mapping[str, Any]) -> None:
    """Print on standard error what was measured before with another commit or machine, if any."""
    others = measured_before(found)
    if others:
        tell(f"measured before: {'; '.join(others)}; --anew measures all again")
