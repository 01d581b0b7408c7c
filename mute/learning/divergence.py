"""A training whose numbers are no longer finite, and how that is found."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

from mute.support.errors import MuteError

__all__ = ["DivergedError", "first_not_finite"]


class DivergedError(MuteError):
    """What is learnt is no longer finite: nothing good can follow, and nothing of it be kept."""


def first_not_finite(values: Mapping[str, Tensor]) -> str | None:
    """Return the name of the first value that holds NaN or infinity; None if all are finite.

    All lie on one device; if that is a GPU it is waited for once, however many they are.
    """
    flags = [value.isfinite().all() for value in values.values()]
    if bool(torch.stack(flags).all()):
        return None
    return next(name for name, finite in zip(values, flags, strict=True) if not finite)
