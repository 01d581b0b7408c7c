"""An LSTM whose input is projected beforehand: one step of it, and a sequence with its gradient.

Gates lie in torch's order i, f, g, o. tanh x is 2 sigmoid(2 x) - 1, which takes torch a third of
the time on a CPU and differs from it by 2e-7 at most. Autograd's own gradient of a sequence makes
some twenty small tensors a step and one product a step for the recurrent weight; the one written
out here fills one buffer of gates, and has one product for all steps.

Source: Hochreiter and Schmidhuber, 1997; Gers et al., 2000 (forget gate).
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

__all__ = ["State", "lstm_sequence", "lstm_step"]

State = tuple[Tensor, Tensor]
"""Hidden and cell state of the LSTM, each of shape (N, H)."""

_sigmoid_backward = torch.ops.aten.sigmoid_backward.grad_input


def lstm_step(projected: Tensor, state: State, weight_hh: Tensor) -> State:
    """Advance by one step; the new state is out of place.

    Args:
        projected: What the input adds to the gates, biases included. Shape: (N, 4 H).
        state: Hidden and cell state.
        weight_hh: Recurrent weight. Shape: (4 H, H).
    """
    hidden, cell = state
    gates = torch.addmm(projected, hidden, weight_hh.t())
    input_gate, forget_gate, candidate, output_gate = gates.chunk(4, dim=-1)
    cell = torch.sigmoid(forget_gate) * cell + torch.sigmoid(input_gate) * _tanh(candidate)
    return torch.sigmoid(output_gate) * _tanh(cell), cell


def _tanh(value: Tensor) -> Tensor:
    if not value.is_cpu or torch.compiler.is_exporting():
        return torch.tanh(value)
    return 2.0 * torch.sigmoid(2.0 * value) - 1.0


def lstm_sequence(
    projected: Tensor, state: State, starts: Tensor, weight_hh: Tensor
) -> tuple[Tensor, Tensor]:
    """Advance by a sequence of steps, differentiably.

    Args:
        projected: What the inputs add to the gates, biases included. Shape: (T, N, 4 H).
        state: Hidden and cell state before the first step.
        starts: Where the state is zeroed before the step. Shape: (T, N), bool.
        weight_hh: Recurrent weight. Shape: (4 H, H).

    Returns:
        The hidden states after each step, shape (T, N, H), and the last cell state, shape (N, H).
    """
    return _Sequence.apply(projected, *state, starts[..., None], weight_hh)


class _Sequence(torch.autograd.Function):
    """The sequence as one operation, which works in buffers for all steps."""

    @staticmethod
    def forward(
        ctx: Any,  # noqa: ANN401
        projected: Tensor,
        hidden: Tensor,
        cell: Tensor,
        starts: Tensor,
        weight_hh: Tensor,
    ) -> tuple[Tensor, Tensor]:
        """Return all hidden states and the last cell state, see `lstm_sequence`."""
        width, zero = hidden.shape[-1], hidden.new_zeros(())
        gates = torch.empty_like(projected)
        hiddens = projected.new_empty((*projected.shape[:2], width))
        hiddens_before, cells_before = torch.empty_like(hiddens), torch.empty_like(hiddens)
        candidates, cells_tanh = torch.empty_like(hiddens), torch.empty_like(hiddens)
        for step, gate in enumerate(gates):
            torch.where(starts[step], zero, hidden, out=hiddens_before[step])
            torch.where(starts[step], zero, cell, out=cells_before[step])
            torch.addmm(projected[step], hiddens_before[step], weight_hh.t(), out=gate)
            input_gate, forget_gate, half_candidate, output_gate = gate.chunk(4, dim=-1)
            half_candidate.mul_(2.0)
            gate.sigmoid_()  # all four at once; of the candidate, half of 1 + tanh
            candidate = torch.mul(half_candidate, 2.0, out=candidates[step]).sub_(1.0)
            cell = (forget_gate * cells_before[step]).add_(input_gate * candidate)
            torch.sigmoid(2.0 * cell, out=cells_tanh[step]).mul_(2.0).sub_(1.0)
            hidden = torch.mul(output_gate, cells_tanh[step], out=hiddens[step])
        befores = hiddens_before, cells_before
        ctx.save_for_backward(gates, *befores, candidates, cells_tanh, starts, weight_hh)
        return hiddens, cell

    @staticmethod
    @once_differentiable
    def backward(  # pyright: ignore[reportIncompatibleMethodOverride]
        ctx: Any,  # noqa: ANN401
        *grad_outputs: Tensor,
    ) -> tuple[Tensor, Tensor, Tensor, None, Tensor]:
        """Return the gradients of what `forward` was given."""
        hiddens_grad, cell_grad = grad_outputs
        gates, hiddens_before, cells_before, candidates, cells_tanh, starts, weight_hh = (
            ctx.saved_tensors
        )
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
        weight_grad = gates_grad.flatten(0, 1).t() @ hiddens_before.flatten(0, 1)
        return gates_grad, hidden_grad, cell_grad, None, weight_grad
