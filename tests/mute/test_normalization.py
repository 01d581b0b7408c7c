"""The normaliser against rsl_rl's own, whose statistics it keeps."""

from __future__ import annotations

import pytest
import torch
from rsl_rl.modules import EmpiricalNormalization

from mute.normalization import RunningNormalization

WIDTHS = (3, 2)


def _make_inputs(num_samples, seed):
    """Return an input far from zero, in which a variance from raw squares would be lost."""
    generator = torch.Generator().manual_seed(seed)
    scale, offset = torch.tensor([1.0, 0.01, 10.0, 1.0, 0.0]), torch.tensor([0.0, 5.0, 1e3, -1, 2])
    return scale * torch.randn(num_samples, 5, generator=generator) + offset


def test_statistics_of_several_updates_are_those_of_rsl_rl():
    ours, theirs = RunningNormalization(5), EmpiricalNormalization(5)
    for seed, num_samples in enumerate((200, 1000, 7)):
        inputs = _make_inputs(num_samples, seed)
        ours.update(*inputs.split(WIDTHS, dim=1))
        theirs.update(inputs)
    assert ours.count == theirs.count == 1207
    for one, other in zip(ours.state_dict().values(), theirs.state_dict().values(), strict=True):
        torch.testing.assert_close(one, other, rtol=1e-4, atol=1e-6)
    inputs = _make_inputs(50, 3)
    torch.testing.assert_close(ours(inputs), theirs(inputs), rtol=1e-3, atol=1e-3)


def test_statistics_are_those_of_all_samples():
    normalization = RunningNormalization(5)
    parts = [_make_inputs(num_samples, seed) for seed, num_samples in enumerate((300, 500))]
    for part in parts:
        normalization.update(part)
    every = torch.cat(parts).double()
    # Before the first update stand a mean of 0 and a variance of 1 that count as no samples.
    torch.testing.assert_close(normalization.mean.double(), every.mean(0), rtol=1e-5, atol=1e-5)
    std = every.std(dim=0, unbiased=False)
    torch.testing.assert_close(normalization.std.double(), std, rtol=1e-3, atol=1e-6)


@pytest.mark.parametrize("stop", ["eval", "until"])
def test_what_has_stopped_learning_stays_as_it_is(stop):
    normalization = RunningNormalization(5, until=100 if stop == "until" else None)
    normalization.update(_make_inputs(100, 0))
    if stop == "eval":
        normalization.eval()
    before = {name: value.clone() for name, value in normalization.state_dict().items()}
    normalization.update(_make_inputs(100, 1))
    assert all(torch.equal(before[name], now) for name, now in normalization.state_dict().items())
