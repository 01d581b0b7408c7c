"""The LSTM against torch's own, and the gradient written out for a sequence against autograd's."""

from __future__ import annotations

import pytest
import torch

from mute.networks.lstm import Weights, lstm_sequence, lstm_step

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


def _weights(lstm):
    return Weights(lstm.weight_ih, lstm.weight_hh, lstm.bias_ih + lstm.bias_hh)


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
    expected = lstm(obs[0], (hidden, cell))
    before = [tensor.clone() for tensor in (obs, hidden, cell)]
    learnt = lstm_step(obs[0], (hidden, cell), _weights(lstm))
    with torch.no_grad():
        acted = lstm_step(obs[0], (hidden, cell), _weights(lstm))
    torch.testing.assert_close(learnt, expected)
    torch.testing.assert_close(acted, expected)
    assert all(map(torch.equal, (obs, hidden, cell), before))


def test_a_step_in_single_precision_is_within_1e_6_of_the_exact_one():
    lstm = _make_cell()
    obs, _, hidden, cell = (3.0 * tensor for tensor in _make_inputs())
    exact = lstm(obs[0], (hidden, cell))
    weights = Weights(*(weight.float() for weight in _weights(lstm)))
    with torch.no_grad():
        ours = lstm_step(obs[0].float(), (hidden.float(), cell.float()), weights)
    for one, other in zip(ours, exact, strict=True):
        assert (one.double() - other).abs().max() < 1e-6


def test_steps_are_those_of_the_sequence():
    lstm = _make_cell().float()
    obs, starts, hidden, cell = _make_inputs()
    obs, state = obs.float(), (hidden.float(), cell.float())
    with torch.no_grad():
        hiddens, last_cell = lstm_sequence(obs, state, starts, _weights(lstm))
        for value, start, expected in zip(obs, starts[..., None], hiddens, strict=True):
            before = [part.masked_fill(start, 0.0) for part in state]
            state = lstm_step(value, (before[0], before[1]), _weights(lstm))
            torch.testing.assert_close(state[0], expected, atol=1e-6, rtol=0.0)
    torch.testing.assert_close(state[1], last_cell, atol=1e-6, rtol=0.0)


def test_a_sequence_of_no_robots_is_empty():
    lstm = _make_cell()
    obs, starts, hidden, cell = _make_inputs()
    state = (hidden[:0], cell[:0])
    hiddens, last_cell = lstm_sequence(obs[:, :0], state, starts[:, :0], _weights(lstm))
    assert hiddens.shape == (NUM_STEPS, 0, WIDTH)
    assert last_cell.shape == (0, WIDTH)


def test_a_gradient_of_a_sequences_gradient_is_refused():
    lstm = _make_cell()
    obs, starts, hidden, cell = _make_inputs()
    hiddens, _ = lstm_sequence(obs, (hidden, cell), starts, _weights(lstm))
    with pytest.raises(RuntimeError, match="an LSTM's sequence has no second derivative"):
        torch.autograd.grad(hiddens.sum(), [*lstm.parameters()], create_graph=True)


def test_a_sequence_and_all_its_gradients_are_those_of_torch():
    lstm = _make_cell()
    obs, starts, hidden, cell = _make_inputs()
    leaves = [tensor.requires_grad_() for tensor in (obs, hidden, cell)] + [*lstm.parameters()]
    ours = lstm_sequence(obs, (hidden, cell), starts, _weights(lstm))
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
    weights = [weight.detach().requires_grad_() for weight in _weights(lstm)]
    for leaf in (obs, hidden, cell):
        leaf.requires_grad_()

    def sequence(obs, hidden, cell, *weights):
        return lstm_sequence(obs, (hidden, cell), starts, Weights(*weights))

    assert torch.autograd.gradcheck(sequence, (obs, hidden, cell, *weights))


def test_the_gradient_does_not_pass_a_start():
    lstm = _make_cell()
    obs, starts, hidden, cell = _make_inputs()
    obs.requires_grad_()
    hiddens, _ = lstm_sequence(obs, (hidden, cell), starts, _weights(lstm))
    hiddens[-1].sum().backward()
    assert obs.grad is not None
    earlier = obs.grad[:-1].abs().sum(dim=(0, 2))
    assert earlier[2] == 0.0  # it starts at the last step
    assert (earlier[[0, 1, 3, 4]] > 0.0).all()
