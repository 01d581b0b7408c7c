"""A perceptron as one operation, which works through its rows in buffers that stay in the caches.

Layer by layer, every activation and gradient of a mini-batch is a new tensor of megabytes, and to
pass them through memory takes PPO's update nearly as long as the products. Here a block of rows
goes through all layers at a time: what is kept of it is each layer's output alone. Values and
gradients are those of the layers up to rounding; values bit for bit where a library's product of a
row does not depend on how many there are.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor, nn
from torch.autograd.function import once_differentiable

from networks.elu import ELU, elu_backward, elu_into, has_fast_elu

__all__ = ["perceptron"]

_ROWS = 3072
"""Rows of a block: more leave the caches, fewer make the products wait for their threads."""


def perceptron(layers: nn.Sequential, value: Tensor) -> Tensor:
    """Return what layers make of rows; in blocks where they are a perceptron of ELUs on a CPU.

    Args:
        layers: The layers.
        value: The rows; no gradient reaches them in blocks, so with one that should, they are not.
            Shape: (num_rows, in_features).
    """
    linear = [layer for layer in layers if isinstance(layer, nn.Linear) and layer.bias is not None]
    hidden = [layer for layer in layers if isinstance(layer, ELU)]
    expected = [layer for pair in zip(linear, hidden, strict=False) for layer in pair] + linear[-1:]
    in_blocks = has_fast_elu(value) and not value.requires_grad
    if not in_blocks or list(layers) != expected:
        return layers(value)
    parameters = [parameter for layer in linear for parameter in (layer.weight, layer.bias)]
    return _Perceptron.apply(value, *parameters)


class _Buffer:
    """Memory for a block of any width up to the largest, taken once."""

    def __init__(self, widths: Sequence[int], like: Tensor) -> None:
        self._memory = like.new_empty(_ROWS * max(widths, default=0))

    def block(self, num_rows: int, width: int) -> Tensor:
        return self._memory[: num_rows * width].view(num_rows, width)


class _Perceptron(torch.autograd.Function):
    """Linear layers with ELUs between them; parameters are weight and bias of each in turn."""

    @staticmethod
    def forward(ctx: Any, value: Tensor, *parameters: Tensor) -> Tensor:  # noqa: ANN401
        """Return the last layer's output."""
        weights, biases = parameters[::2], parameters[1::2]
        outputs = [value.new_empty(len(value), len(bias)) for bias in biases]
        before = _Buffer([len(bias) for bias in biases[:-1]], value)
        for first in range(0, len(value), _ROWS):
            rows = slice(first, first + _ROWS)
            block = value[rows]
            for weight, bias, output in zip(weights[:-1], biases, outputs, strict=False):
                buffer = before.block(len(block), len(bias))
                block = elu_into(torch.addmm(bias, block, weight.t(), out=buffer), output[rows])
            torch.addmm(biases[-1], block, weights[-1].t(), out=outputs[-1][rows])
        ctx.save_for_backward(value, *outputs[:-1], *weights)
        return outputs[-1]

    @staticmethod
    @once_differentiable
    def backward(  # pyright: ignore[reportIncompatibleMethodOverride]
        ctx: Any,  # noqa: ANN401
        *grad_outputs: Tensor,
    ) -> tuple[Tensor | None, ...]:
        """Return no gradient of the input, and those of the parameters."""
        saved = ctx.saved_tensors
        inputs, weights = saved[: len(saved) // 2], saved[len(saved) // 2 :]
        weight_grads = [torch.zeros_like(weight) for weight in weights]
        bias_grads = [weight.new_zeros(len(weight)) for weight in weights]
        widths = [weight.shape[1] for weight in weights[1:]]
        buffers = _Buffer(widths, weights[0]), _Buffer(widths, weights[0])  # one is read meanwhile
        for first in range(0, len(inputs[0]), _ROWS):
            rows = slice(first, first + _ROWS)
            grad = grad_outputs[0][rows]
            for layer in reversed(range(len(weights))):
                block = inputs[layer][rows]
                weight_grads[layer].addmm_(grad.t(), block)
                bias_grads[layer].add_(grad.sum(dim=0))
                if layer > 0:
                    buffer = buffers[layer % 2].block(*block.shape)
                    grad = elu_backward(torch.mm(grad, weights[layer], out=buffer), block, buffer)
        pairs = zip(weight_grads, bias_grads, strict=True)
        return (None, *(grad for pair in pairs for grad in pair))
