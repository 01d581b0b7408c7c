"""An LSTM: one step of it, and a sequence with its gradient.

Gates lie in torch's order i, f, g, o. Where activations have their fast form (see `networks.elu`),
tanh x is 2 sigmoid(2 x) - 1, which takes torch a third of the time on a CPU and differs from it by
2e-7 at most; a sequence has it everywhere. Autograd's own gradient of a sequence makes some twenty
small tensors a step and a product a step for each weight; the one written out here fills one
buffer of gates, and has a single product for each.

Source: Hochreiter and Schmidhuber, 1997; Gers et al., 2000 (forget gate).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import torch
from torch import Tensor

from .autograd import once_differentiable
from .elu import has_fast_form

__all__ = ["State", "Weights", "lstm_sequence", "lstm_step"]

State = tuple[Tensor, Tensor]
"""Hidden and cell state of the LSTM, each of shape (N, H)."""

_sigmoid_backward = torch.ops.aten.sigmoid_backward.grad_input


class Weights(NamedTuple):
    """What the LSTM learns. D is the width of its input."""

    input: Tensor
    """Shape: (4 H, D)."""
    hidden: Tensor
    """Shape: (4 H, H)."""
    bias: Tensor
    """Shape: (4 H,)."""


def lstm_step(value: Tensor, state: State, weights: Weights) -> State:
    """Advance by one step; the new state is out of place.

    Args:
        value: The input. Shape: (N, D).
        state: Hidden and cell state before the step.
        weights: The weights.
    """
    hidden, cell = state
    gates = torch.addmm(weights.bias, value, weights.input.t())
    if has_fast_form(gates) and not torch.is_grad_enabled():
        gates.addmm_(hidden, weights.hidden.t())
        input_gate, forget_gate, half_candidate, output_gate = _activate_(gates)
        candidate = half_candidate.mul_(2.0).sub_(1.0)
        cell = (forget_gate * cell).add_(candidate.mul_(input_gate))
        return (2.0 * cell).sigmoid_().mul_(2.0).sub_(1.0).mul_(output_gate), cell
    gates = torch.addmm(gates, hidden, weights.hidden.t())
    input_gate, forget_gate, candidate, output_gate = gates.chunk(4, dim=-1)
    kept = torch.sigmoid(forget_gate) * cell
    cell = kept + torch.sigmoid(input_gate) * _tanh(candidate)
    return torch.sigmoid(output_gate) * _tanh(cell), cell


def lstm_sequence(
    values: Tensor, state: State, starts: Tensor, weights: Weights
) -> tuple[Tensor, Tensor]:
    """Advance by a sequence of steps, differentiably, but once only.

    Args:
        values: The inputs. Shape: (T, N, D).
        state: Hidden and cell state before the first step.
        starts: Where the state is zeroed before the step. Shape: (T, N), bool.
        weights: The weights.

    Returns:
        The hidden states after each step, shape (T, N, H), and the last cell state, shape (N, H).
    """
    return _Sequence.apply(values, *state, starts[..., None], *weights)


def _tanh(value: Tensor) -> Tensor:
    return 2.0 * torch.sigmoid(2.0 * value) - 1.0 if has_fast_form(value) else torch.tanh(value)


def _activate_(gates: Tensor) -> tuple[Tensor, ...]:
    """Activate gates in place and return each; of the candidate it is half of 1 + tanh."""
    parts = gates.chunk(4, dim=-1)
    parts[2].mul_(2.0)
    gates.sigmoid_()  # all four at once
    return parts


class _Sequence(torch.autograd.Function):
    """The sequence as one operation, which works in buffers for all steps."""

    @staticmethod
    def forward(
        ctx: Any,  # noqa: ANN401
        values: Tensor,
        hidden: Tensor,
        cell: Tensor,
        starts: Tensor,
        weight_ih: Tensor,
        weight_hh: Tensor,
        bias: Tensor,
    ) -> tuple[Tensor, Tensor]:
        """Return all hidden states and the last cell state, see `lstm_sequence`."""
        shape, zero = values.shape[:2], hidden.new_zeros(())
        gates = torch.addmm(bias, values.flatten(0, 1), weight_ih.t()).view(*shape, len(bias))
        hiddens = values.new_empty((*shape, hidden.shape[-1]))
        hiddens_before, cells_before = torch.empty_like(hiddens), torch.empty_like(hiddens)
        candidates, cells_tanh = torch.empty_like(hiddens), torch.empty_like(hiddens)
        for step, gate in enumerate(gates):
            torch.where(starts[step], zero, hidden, out=hiddens_before[step])
            torch.where(starts[step], zero, cell, out=cells_before[step])
            gate.addmm_(hiddens_before[step], weight_hh.t())
            input_gate, forget_gate, half_candidate, output_gate = _activate_(gate)
            candidate = torch.mul(half_candidate, 2.0, out=candidates[step]).sub_(1.0)
            cell = (forget_gate * cells_before[step]).add_(input_gate * candidate)
            torch.sigmoid(2.0 * cell, out=cells_tanh[step]).mul_(2.0).sub_(1.0)
            hidden = torch.mul(output_gate, cells_tanh[step], out=hiddens[step])
        befores = hiddens_before, cells_before
        activated = gates, candidates, cells_tanh
        ctx.save_for_backward(values, *befores, *activated, starts, weight_ih, weight_hh)
        return hiddens, cell

    @staticmethod
    @once_differentiable("an LSTM's sequence")
    def backward(  # pyright: ignore[reportIncompatibleMethodOverride]
        ctx: Any,  # noqa: ANN401
        *grad_outputs: Tensor,
    ) -> tuple[Tensor | None, ...]:
        """Return the gradients of what `forward` was given."""
        hiddens_grad, cell_grad = grad_outputs
        values, hiddens_before, cells_before, *saved = ctx.saved_tensors
        gates, candidates, cells_tanh, starts, weight_ih, weight_hh = saved
        gates_grad = torch.empty_like(gates)
        hidden_grad = torch.zeros_like(cell_grad)
        for step in reversed(range(len(gates))):
            input_gate, forget_gate, _, output_gate = gates[step].chunk(4, dim=-1)
            grad, cell_tanh = gates_grad[step], cells_tanh[step]
            input_grad, forget_grad, half_grad, output_grad = grad.chunk(4, dim=-1)
            hidden_grad = hidden_grad + hiddens_grad[step]
            through_tanh = torch.ops.aten.tanh_backward(hidden_grad * output_gate, cell_tanh)
            cell_grad = cell_grad + through_tanh
            torch.mul(cell_grad, candidates[step], out=input_grad)
            torch.mul(cell_grad, cells_before[step], out=forget_grad)
            torch.mul(cell_grad, input_gate, out=half_grad).mul_(4.0)  # 2 before and 2 after
            torch.mul(hidden_grad, cell_tanh, out=output_grad)
            _sigmoid_backward(grad, gates[step], grad_input=grad)
            cell_grad = (cell_grad * forget_gate).masked_fill_(starts[step], 0.0)
            hidden_grad = (grad @ weight_hh).masked_fill_(starts[step], 0.0)
        values_grad = gates_grad @ weight_ih if ctx.needs_input_grad[0] else None
        flat = gates_grad.flatten(0, 1)
        weight_grads = flat.t() @ values.flatten(0, 1), flat.t() @ hiddens_before.flatten(0, 1)
        return values_grad, hidden_grad, cell_grad, None, *weight_grads, flat.sum(dim=0)
