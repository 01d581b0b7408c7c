"""The Gaussian of the actions against rsl_rl's, to rounding."""

from __future__ import annotations

import torch
from rsl_rl.modules.distribution import GaussianDistribution

from mute.learning.distribution import SharedGaussian


def _both() -> list[GaussianDistribution]:
    torch.manual_seed(0)
    deviation = torch.linspace(0.02, 1.5, 12)  # some of it is out of the range
    pair = [GaussianDistribution(12, 0.8, (0.05, 1.2)), SharedGaussian(12, 0.8, (0.05, 1.2))]
    for distribution in pair:
        distribution.std_param.data.copy_(deviation)
    return pair


def test_probability_entropy_and_divergence_are_those_of_rsl_rl_and_so_are_their_gradients():
    means, actions = torch.randn(50, 12), torch.randn(50, 12)
    old = (means + 0.1 * torch.randn(50, 12), torch.linspace(0.1, 0.5, 12).expand(50, 12))
    results = []
    for distribution in _both():
        mean = means.clone().requires_grad_()
        distribution.update(mean)
        values = (
            distribution.log_prob(actions),
            distribution.entropy,
            distribution.kl_divergence(old, distribution.params),
        )
        weights = torch.linspace(-1.0, 1.0, 50)
        grads = [
            torch.autograd.grad((weights * value).sum() + value.sum(), inputs, retain_graph=True)
            for value, inputs in (
                (values[0], (mean, distribution.std_param)),
                (values[1], (distribution.std_param,)),
                (values[2], (mean, distribution.std_param)),
            )
        ]
        results.append([*values, *(grad for each in grads for grad in each)])
    for theirs, ours in zip(*results, strict=True):
        assert ours.shape == theirs.shape
        assert torch.allclose(ours, theirs, rtol=1e-5, atol=1e-5)


def test_the_divergence_from_itself_is_zero():
    _, distribution = _both()
    distribution.update(torch.randn(5, 12))
    divergence = distribution.kl_divergence(distribution.params, distribution.params)
    assert torch.equal(divergence, torch.zeros(5))
