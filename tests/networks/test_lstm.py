"""The LSTM against torch's own, and the gradient written out for a sequence against autograd's."""

from __future__ import annotations

import torch
from torch.nn import functional

from networks.lstm import lstm_sequence, lstm_step

NUM_STEPS, NUM_ENVS, OBS_DIM, WIDTH = 6, 5, 3, 4


def _make_cell():
    torch.manual_seed(0)
    return torch.nn.LSTMCell(OBS_DIM, WIDTH, dtype=torch.float64)


def _make_inputs():
    torch.manual_seed(1)
    obs = torch.randn(NUM_STEPS, NUM_ENVS, OBS_DIM, dtype=torch.float64)
    starts = torch.zeros(NUM_STEPS, NUM_ENVS, dtype=torch.bool)
    starts[0, 0] = starts[2, 1] = starts[5, 2] = True
    hidden, cell = torch.randn(2, NUM_ENVS, WIDTH, dtype=torch.float64)
    return obs, starts, hidden, cell


def _project(lstm, obs):
    return functional.linear(obs, lstm.weight_ih, lstm.bias_ih + lstm.bias_hh)


def _torch_sequence(lstm, obs, starts, hidden, cell):
    hiddens = []
    for step, start in zip(obs, starts[..., None], strict=True):
        state = (hidden.masked_fill(start, 0.0), cell.masked_fill(start, 0.0))
        hidden, cell = lstm(step, state)
        hiddens.append(hidden)
    return torch.stack(hiddens), cell


def test_a_step_is_that_of_torch():
    lstm = _make_cell()
    obs, _, hidden, cell = _make_inputs()
    ours = lstm_step(_project(lstm, obs[0]), (hidden, cell), lstm.weight_hh)
    torch.testing.assert_close(ours, lstm(obs[0], (hidden, cell)))


def test_a_sequence_and_all_its_gradients_are_those_of_torch():
    lstm = _make_cell()
    obs, starts, hidden, cell = _make_inputs()
    leaves = [tensor.requires_grad_() for tensor in (obs, hidden, cell)] + [*lstm.parameters()]
    ours = lstm_sequence(_project(lstm, obs), (hidden, cell), starts, lstm.weight_hh)
    torch_own = _torch_sequence(lstm, obs, starts, hidden, cell)
    torch.testing.assert_close(ours, torch_own)
    weights = [torch.randn_like(output) for output in ours]
    gradients = [
        torch.autograd.grad(outputs, leaves, weights, retain_graph=True)
        for outputs in (ours, torch_own)
    ]
    torch.testing.assert_close(*gradients)


def test_the_gradient_of_a_sequence_is_that_of_finite_differences():
    lstm = _make_cell()
    obs, starts, hidden, cell = _make_inputs()
    projected = _project(lstm, obs).detach().requires_grad_()
    for state in (hidden, cell):
        state.requires_grad_()

    def sequence(projected, hidden, cell, weight):
        return lstm_sequence(projected, (hidden, cell), starts, weight)

    assert torch.autograd.gradcheck(sequence, (projected, hidden, cell, lstm.weight_hh))


def test_the_gradient_does_not_pass_a_start():
    lstm = _make_cell()
    obs, starts, hidden, cell = _make_inputs()
    projected = _project(lstm, obs).detach().requires_grad_()
    hiddens, _ = lstm_sequence(projected, (hidden, cell), starts, lstm.weight_hh)
    hiddens[-1].sum().backward()
    assert projected.grad is not None
    earlier = projected.grad[:-1].abs().sum(dim=(0, 2))
    assert earlier[2] == 0.0  # it starts at the last step
    assert (earlier[[0, 1, 3, 4]] > 0.0).all()
