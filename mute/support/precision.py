"""Which products are made in bfloat16: those of hidden layers, where a run lets a processor do so.

`agent.matmul_precision` 'medium' allows it. By itself torch then does so on processors with tiles
(AMX) alone, for every product, and keeps to float32 on those that have bfloat16 among their AVX-512
units, where such a product takes half the time, and what it reads and writes half the memory. There
this module sees to the hidden layers. Sums inside a product, weights, their optimisers' moments,
the state of an LSTM and what is told apart by small differences (means of actions, values,
estimates, losses) stay float32.

Source: Micikevicius et al., "Mixed precision training", 2018; Kalamkar et al., "A study of BFLOAT16
for deep learning training", 2019.
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Iterator

import torch

__all__ = ["full_precision", "hidden_dtype", "hidden_layers"]


def hidden_dtype(device: torch.device) -> torch.dtype:
    """Return the type that hidden layers compute in on a device, by the precision that is set."""
    allowed = torch.get_float32_matmul_precision() == "medium"
    return torch.bfloat16 if allowed and device.type == "cpu" and _has_units() else torch.float32


def hidden_layers(device: torch.device) -> contextlib.AbstractContextManager[object]:
    """Return a context in which layers compute in `hidden_dtype`, whatever they are given.

    Leave it between two uses of a weight whose gradients are to be added up in float32.
    """
    dtype = hidden_dtype(device)
    if dtype == torch.float32:
        return contextlib.nullcontext()
    return torch.autocast(device.type, dtype)


@contextlib.contextmanager
def full_precision() -> Iterator[None]:
    """Multiply in float32 within, as whoever plays or measures a policy does."""
    before = torch.get_float32_matmul_precision()
    torch.set_float32_matmul_precision("highest")
    try:
        yield
    finally:
        torch.set_float32_matmul_precision(before)


@functools.cache
def _has_units() -> bool:
    """Return whether this processor multiplies bfloat16 faster than float32."""
    return bool(torch.cpu.get_capabilities().get("avx512_bf16", False))
