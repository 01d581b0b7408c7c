"""A training whose numbers are no longer finite, and how that is found."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

from mute.support.errors import MuteError

__all__ = ["DivergedError", "first_not_finite", "stopped_by"]


class DivergedError(MuteError):
    """What is learnt is no longer finite: nothing good can follow, and nothing of it be kept."""


def first_not_finite(values: Mapping[str, Tensor]) -> str | None:
    """Return the name of the first value that holds NaN or infinity; None if all are finite.

    All lie on one device; if that is a GPU it is waited for once where all is well, however many
    they are.
    """
    # A sum takes one pass, and is finite unless a part of it is not, or all together are too large.
    sums = torch.stack([value.sum(dtype=torch.float32) for value in values.values()])
    if bool(sums.isfinite().all()):
        return None
    flags = [value.isfinite().all() for value in values.values()]
    if bool(torch.stack(flags).all()):
        return None
    return next(name for name, finite in zip(values, flags, strict=True) if not finite)


def stopped_by(found: str) -> str:
    """Return in words why a training stops, and which option may keep it from that.

    What the environment hands out is another matter than how fast is learnt from it.

    Args:
        found: Name of what holds NaN or infinity.
    """
    stops = f"NaN or infinity in {found}, so the training stops and keeps nothing of this iteration"
    if found.startswith("the reward"):
        return stops
    option = "estimation" if "estimat" in found else "ppo"
    return f"{stops}; a smaller --agent.{option}.learning-rate may help"
