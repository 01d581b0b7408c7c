"""What every test may count on: one torch thread to begin with, and torch as it found it."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest

# Before torch is imported: tensors here are tiny, and on a busy machine the threads of two pools
# cost more time than all tests together.
os.environ.setdefault("OMP_NUM_THREADS", "1")

import torch

_FOUND = torch.get_num_threads(), torch.get_float32_matmul_precision()


@pytest.fixture(autouse=True)
def _restore_torch_settings() -> Iterator[None]:
    """Put back what a training run sets for its whole process, in a test or in its fixtures."""
    _reset_torch()
    yield
    _reset_torch()


def _reset_torch() -> None:
    threads, precision = _FOUND
    torch.set_num_threads(threads)
    torch.set_float32_matmul_precision(precision)
