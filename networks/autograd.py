"""Gradients that are written out by hand, and end there."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import ParamSpec, TypeVar

import torch

__all__ = ["once_differentiable"]

P = ParamSpec("P")
R = TypeVar("R")


def once_differentiable(what: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator of a backward pass that raises where the pass is itself recorded.

    torch's own raises only where its result is differentiated on the way to what is asked for: a
    gradient penalty is wrong without a word.

    Args:
        what: What has no second derivative, for the error.
    """

    def decorate(backward: Callable[P, R]) -> Callable[P, R]:
        @functools.wraps(backward)
        def guarded(*args: P.args, **kwargs: P.kwargs) -> R:
            if torch.is_grad_enabled():
                raise RuntimeError(f"{what} has no second derivative: do not set create_graph")
            return backward(*args, **kwargs)

        return guarded

    return decorate
