"""The running mean and variance of the networks' inputs, from columns that are not joined.

The statistics, and the names under which they are saved, are those of rsl_rl's
`EmpiricalNormalization`, up to rounding. torch's variance over rows takes one pass that is not
vectorised; a mean and a mean square about it are two that are, and take a third of the time.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from mute.networks.reflection import Reflection

__all__ = ["RunningNormalization"]


class RunningNormalization(nn.Module):
    """A normaliser that takes an input in blocks of columns, and may learn its mirror image too."""

    def __init__(self, width: int, eps: float = 1e-2) -> None:
        """Begin with a mean of 0 and a variance of 1, which count as no samples.

        Args:
            width: Width of the input.
            eps: What is added to the deviations before the input is divided by them.
        """
        super().__init__()
        self.eps = eps
        # TorchScript cannot read such types in the body of the class.
        self._mean: Tensor
        self._var: Tensor
        self._std: Tensor
        self.count: Tensor
        """Number of samples so far. Shape: ()."""
        self.register_buffer("_mean", torch.zeros(1, width))
        self.register_buffer("_var", torch.ones(1, width))
        self.register_buffer("_std", torch.ones(1, width))
        self.register_buffer("count", torch.tensor(0))

    @property
    def mean(self) -> Tensor:
        """Mean so far, a copy. Shape: (width,)."""
        return self._mean[0].clone()

    @property
    def std(self) -> Tensor:
        """Deviation so far, a copy. Shape: (width,)."""
        return self._std[0].clone()

    def forward(self, x: Tensor) -> Tensor:
        """Return the input normalised. Shapes: (num_samples, width)."""
        return torch.sub(x, self._mean).div_(self._std + self.eps)

    @torch.no_grad()
    def update(self, x: Tensor, *more: Tensor) -> None:
        """Learn the mean and variance of an input, over all ranks; in training mode alone.

        Args:
            x: The input, or its first columns. Shape: (num_samples, width).
            more: The columns that follow. Shapes: (num_samples, width of each).

        Raises:
            ValueError: If the blocks differ in their numbers of samples.
        """
        if not self.training:
            return
        blocks = [block.to(self._mean) for block in (x, *more)]
        num_samples = len(x)
        if any(len(block) != num_samples for block in blocks):
            lengths = [len(block) for block in blocks]
            raise ValueError(f"blocks of columns must have equally many rows, got {lengths}")
        count = _sum_of_ranks_(torch.full_like(self.count, num_samples))
        share = num_samples / count.to(blocks[0])
        mean = _sum_of_ranks_(share * torch.cat([block.mean(dim=0) for block in blocks]))
        parts = zip(blocks, mean.split([block.shape[1] for block in blocks]), strict=True)
        squares = [(block - part).square_().mean(dim=0) for block, part in parts]
        self._take_on(count, mean[None], _sum_of_ranks_(share * torch.cat(squares))[None])

    @torch.no_grad()
    def include_mirror_image(self, reflection: Reflection) -> None:
        """Take on the mirror image of what has been learnt, as if it had been seen as often.

        Args:
            reflection: How the input is mirrored.
        """
        image, variance = reflection(self._mean), reflection.unsigned(self._var)
        # The variance of two halves of the data is the mean of theirs and that of their means.
        self._var = 0.5 * (self._var + variance) + (0.5 * (self._mean - image)).square()
        self._mean = 0.5 * (self._mean + image)
        self._std = self._var.sqrt()

    def _take_on(self, count: Tensor, mean: Tensor, variance: Tensor) -> None:
        """Merge new samples with those before. Shapes: (), (1, width), (1, width).

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
