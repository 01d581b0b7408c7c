"""rsl_rl's running mean and variance of the networks' inputs, from columns that are not joined.

The statistics are the same up to rounding. torch's variance over rows takes one pass that is not
vectorised; a mean and a mean square about it are two that are, and take a third of the time.
"""

from __future__ import annotations

import torch
from rsl_rl.modules import EmpiricalNormalization
from torch import Tensor

__all__ = ["RunningNormalization"]


class RunningNormalization(EmpiricalNormalization):
    """rsl_rl's normaliser, which takes an input in blocks of columns."""

    def forward(self, x: Tensor) -> Tensor:
        """Return the input normalised, as rsl_rl does, with one new tensor instead of two."""
        return torch.sub(x, self._mean).div_(self._std + self.eps)

    @torch.jit.unused
    @torch.no_grad()
    def update(self, x: Tensor, *more: Tensor) -> None:
        """Learn the mean and variance of an input, over all ranks.

        Args:
            x: The input, or its first columns. Shape: (num_samples, width).
            more: The columns that follow. Shapes: (num_samples, width of each).

        Raises:
            ValueError: If the blocks differ in their numbers of samples.
        """
        if not self.training or (self.until is not None and self.count >= self.until):
            return
        blocks = [block.to(self.get_buffer("_mean")) for block in (x, *more)]
        num_samples = len(x)
        if any(len(block) != num_samples for block in blocks):
            lengths = [len(block) for block in blocks]
            raise ValueError(f"blocks of columns must have equally many rows, got {lengths}")
        count = _sum_of_ranks_(torch.full_like(self.get_buffer("count"), num_samples))
        share = num_samples / count.to(blocks[0])
        mean = _sum_of_ranks_(share * torch.cat([block.mean(dim=0) for block in blocks]))
        parts = zip(blocks, mean.split([block.shape[1] for block in blocks]), strict=True)
        squares = [(block - part).square_().mean(dim=0) for block, part in parts]
        self._take_on(count, mean[None], _sum_of_ranks_(share * torch.cat(squares))[None])

    def _take_on(self, count: Tensor, mean: Tensor, variance: Tensor) -> None:
        """Merge new samples with those before. Shapes: (), (1, obs_dim), (1, obs_dim).

        Source: Chan et al., "Algorithms for computing the sample variance", 1983.
        """
        self.count += count
        rate = count / self.count
        shift = mean - self._mean
        self._mean += rate * shift
        self._var += rate * (variance - self._var + shift * (mean - self._mean))
        self._std = self._var.sqrt()


def _sum_of_ranks_(value: Tensor) -> Tensor:
    """Replace a tensor by its sum over all ranks, and return it."""
    if torch.distributed.is_initialized():
        torch.distributed.all_reduce(value)
    return value
