"""The fused Adam against torch's own, and states that the other saved."""

from __future__ import annotations

import copy

import torch
from torch import nn

from mute.learning.optimizer import FusedAdam


def _learn(network: nn.Module, optimizer: torch.optim.Optimizer, steps: int) -> None:
    generator = torch.Generator().manual_seed(1)
    for _ in range(steps):
        x = torch.randn(8, 4, generator=generator)
        optimizer.zero_grad()
        network(x).square().mean().backward()
        optimizer.step()


def test_it_goes_on_from_what_torch_s_adam_saved_and_stays_fused():
    torch.manual_seed(0)
    plain = nn.Linear(4, 3)
    theirs = torch.optim.Adam(plain.parameters(), lr=0.01)
    _learn(plain, theirs, 5)
    network = copy.deepcopy(plain)
    ours = FusedAdam(network.parameters(), lr=0.5)
    saved = copy.deepcopy(theirs.state_dict())  # it refers to what goes on learning
    ours.load_state_dict(saved)
    assert ours.param_groups[0]["fused"] is True
    assert saved["param_groups"][0]["fused"] is None
    _learn(plain, theirs, 20)
    _learn(network, ours, 20)
    for expected, parameter in zip(plain.parameters(), network.parameters(), strict=True):
        torch.testing.assert_close(parameter, expected, rtol=1e-5, atol=1e-6)
