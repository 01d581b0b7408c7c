"""rsl_rl's Gaussian for actions, with what its deviations need done once for all samples.

The deviations do not depend on the state, but rsl_rl repeats them for every sample and takes
logarithms and squares of all the copies. The values are the same up to rounding.
"""

from __future__ import annotations

import math

import torch
from rsl_rl.modules.distribution import GaussianDistribution

__all__ = ["SharedGaussian"]

_LOG_ROOT_TWO_PI = 0.5 * math.log(2.0 * math.pi)


class SharedGaussian(GaussianDistribution):
    """A Gaussian whose deviations are the same for all samples of a batch.

    Shapes: mean and outputs (num_samples, output_dim); what is summed over a sample (num_samples,).
    """

    def __init__(
        self,
        output_dim: int,
        init_std: float = 1.0,
        std_range: tuple[float, float] = (1e-6, 1e6),
    ) -> None:
        """Start with one deviation for all outputs, see `GaussianDistribution`."""
        super().__init__(output_dim, init_std, std_range)

    def update(self, mlp_output: torch.Tensor) -> None:
        """Take on the means of a batch, see `GaussianDistribution.update`."""
        super().update(mlp_output)
        self._row = self.std_param.clamp(*self.std_range)
        """Deviations. Shape: (output_dim,)."""
        self._log_norm = (self._row.log() + _LOG_ROOT_TWO_PI).sum()
        """Logarithm of what the density is divided by."""

    @property
    def entropy(self) -> torch.Tensor:
        """Entropy of each sample."""
        return (self._log_norm + 0.5 * self.output_dim).expand(self.mean.shape[:-1])

    def log_prob(self, outputs: torch.Tensor) -> torch.Tensor:
        """Return the log-probability of each sample."""
        squares = ((outputs - self.mean) / self._row).square().sum(dim=-1)
        return -0.5 * squares - self._log_norm

    def kl_divergence(
        self, old_params: tuple[torch.Tensor, ...], new_params: tuple[torch.Tensor, ...]
    ) -> torch.Tensor:
        """Return KL(old || new) of each sample; deviations are read off the first one."""
        (old_mean, old_std), (new_mean, new_std) = old_params, new_params
        ratio, new_row = old_std[:1] / new_std[:1], new_std[:1]
        squares = ((old_mean - new_mean) / new_row).square().sum(dim=-1)
        return 0.5 * squares + (0.5 * ratio.square() - ratio.log() - 0.5).sum(dim=-1)
