"""rsl_rl's running mean and variance of the networks' inputs, read where they lie.

The statistics are the same up to rounding. torch's variance over rows takes one pass that is not
vectorised; a mean and a mean square about it are two that are, and take a third of the time.
"""

from __future__ import annotations

import torch
from rsl_rl.modules import EmpiricalNormalization
from torch import Tensor

__all__ = ["RunningNormalization"]


class RunningNormalization(EmpiricalNormalization):
    """rsl_rl's normaliser, which also learns from an input that has not been joined."""

    @torch.jit.unused
    @torch.no_grad()
    def update(self, x: Tensor, *more: Tensor) -> None:
        """Learn the mean and variance of an input, over all ranks.

        Args:
            x: The input, or its first columns. Shape: (num_samples, .).
            more: The columns that follow. Shapes: (num_samples, .).
        """
        if not self.training or (self.until is not None and self.count >= self.until):
            return
        parts, num_samples = (x, *more), x.shape[0]
        count = _sum_of_ranks(torch.full_like(self.get_buffer("count"), num_samples))
        share = num_samples / count
        means = [_sum_of_ranks(share * part.mean(dim=0)) for part in parts]
        squares = [
            _sum_of_ranks(share * (part - mean).square_().mean(dim=0))
            for part, mean in zip(parts, means, strict=True)
        ]
        self._take_on(count, torch.cat(means)[None], torch.cat(squares)[None])

    def _take_on(self, count: Tensor, mean: Tensor, variance: Tensor) -> None:
        """Merge new samples with those before (Chan et al., 1983). Shapes: (), (1, width) twice."""
        self.count += count
        rate = count / self.count
        shift = mean - self._mean
        self._mean += rate * shift
        self._var += rate * (variance - self._var + shift * (mean - self._mean))
        self._std = self._var.sqrt()


def _sum_of_ranks(value: Tensor) -> Tensor:
    if torch.distributed.is_initialized():
        torch.distributed.all_reduce(value)
    return value
