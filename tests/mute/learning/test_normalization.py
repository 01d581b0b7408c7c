"""The normaliser against rsl_rl's own, whose statistics it keeps."""

from __future__ import annotations

import pytest
import torch
from rsl_rl.modules import EmpiricalNormalization

from mute.learning.normalization import RunningNormalization
from mute.networks.reflection import Reflection

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
    assert ours.count == theirs.get_buffer("count") == 1207
    torch.testing.assert_close(ours.state_dict(), theirs.state_dict(), rtol=1e-4, atol=1e-6)
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


def test_checkpoints_of_rsl_rls_normaliser_go_on():
    ours, theirs = RunningNormalization(5), EmpiricalNormalization(5)
    theirs.update(_make_inputs(200, 0))
    ours.load_state_dict(theirs.state_dict())
    for normalization in (ours, theirs):
        normalization.update(_make_inputs(100, 1))
    torch.testing.assert_close(ours.state_dict(), theirs.state_dict(), rtol=1e-4, atol=1e-6)


def test_blocks_of_other_types_count_as_numbers():
    normalization = RunningNormalization(2)
    normalization.update(torch.tensor([[1], [3]]), torch.tensor([[True], [False]]))
    assert normalization.mean.tolist() == [2.0, 0.5]
    assert normalization.std.tolist() == [1.0, 0.5]


def test_ranks_with_unequal_numbers_of_samples_learn_what_one_would(monkeypatch):
    parts = [_make_inputs(num_samples, seed) for seed, num_samples in enumerate((300, 50))]
    alone = RunningNormalization(5)
    alone.update(torch.cat(parts))
    mean = torch.cat(parts).mean(dim=0)
    # What the second rank sends: its count, and its shares of the mean and of the mean square.
    others = [
        torch.tensor(50),
        parts[1].sum(dim=0) / 350,
        (parts[1] - mean).square().sum(dim=0) / 350,
    ]
    monkeypatch.setattr(torch.distributed, "is_initialized", lambda: True)
    monkeypatch.setattr(torch.distributed, "all_reduce", lambda value: value.add_(others.pop(0)))
    first = RunningNormalization(5)
    first.update(parts[0])
    assert not others
    torch.testing.assert_close(first.state_dict(), alone.state_dict(), rtol=1e-4, atol=1e-6)


def test_blocks_of_unequal_length_are_refused():
    with pytest.raises(ValueError, match=r"equally many rows, got \[10, 1\]"):
        RunningNormalization(2).update(torch.zeros(10, 1), torch.zeros(1, 1))


def test_what_has_stopped_learning_stays_as_it_is():
    normalization = RunningNormalization(5)
    normalization.update(_make_inputs(100, 0))
    normalization.eval()
    before = {name: value.clone() for name, value in normalization.state_dict().items()}
    normalization.update(_make_inputs(100, 1))
    assert all(torch.equal(before[name], now) for name, now in normalization.state_dict().items())


def test_a_mirror_image_counts_as_much_as_what_was_seen():
    reflection = Reflection((1, 0, 2), (1.0, 1.0, -1.0))
    samples = torch.tensor([[1.0, 5.0, 2.0], [3.0, 5.0, 4.0]])
    normalization = RunningNormalization(3)
    normalization.update(samples)
    normalization.include_mirror_image(reflection)
    both = torch.cat((samples, reflection(samples)))
    torch.testing.assert_close(normalization.mean, both.mean(dim=0))
    torch.testing.assert_close(normalization.std, both.std(dim=0, correction=0))
    assert normalization.count == 2
