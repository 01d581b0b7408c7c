"""A perceptron as one operation, which works through its rows in buffers that stay in a cache.

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

from .autograd import once_differentiable
from .elu import ELU, elu_backward, elu_into, has_fast_form

__all__ = ["perceptron"]

_BLOCK = 3072 * 128
"""Entries of a block, its rows times its widest layer: 1.5 MiB in single precision, of which up to
three are in use at a time. Chosen by trial on 2 cores with caches of 512 KiB each and 32 MiB for
all: a third of it and less takes longer, twice of it as long."""


def perceptron(layers: nn.Sequential, value: Tensor) -> Tensor:
    """Return what layers make of rows; as one operation where they are a perceptron on a CPU.

    Args:
        layers: The layers. One operation they are if linear layers with biases alternate with ELUs,
            none of which is hooked or of a type of its own.
        value: The rows; no gradient reaches them in blocks, so with one that should, they are not.
            Shape: (num_rows, in_features).
    """
    is_alone = not value.requires_grad and not torch.is_autocast_enabled("cpu")
    if value.ndim != 2 or not is_alone or not has_fast_form(value) or not _is_plain(layers):
        return layers(value)
    pairs = [(layer.weight, layer.bias) for layer in layers if isinstance(layer, nn.Linear)]
    return _Perceptron.apply(value, *(parameter for pair in pairs for parameter in pair))


def _is_plain(layers: nn.Sequential) -> bool:
    linear, hidden = list(layers)[::2], list(layers)[1::2]
    return (
        len(linear) == len(hidden) + 1
        and all(type(layer) is nn.Linear and layer.bias is not None for layer in linear)
        and all(type(layer) is ELU for layer in hidden)
        and not any(_is_hooked(module) for module in layers.modules())
    )


def _is_hooked(module: nn.Module) -> bool:
    forward = module._forward_hooks or module._forward_pre_hooks
    return bool(forward or module._backward_hooks or module._backward_pre_hooks)


def _rows_of_block(widths: Sequence[int]) -> int:
    return max(1, _BLOCK // max(widths))


def _rows(num_rows: int, widths: Sequence[int]) -> list[slice]:
    """Return the rows of each block."""
    step = _rows_of_block(widths)
    return [slice(first, first + step) for first in range(0, num_rows, step)]


class _Buffer:
    """Memory for a block of any width up to the largest, taken once."""

    def __init__(self, num_rows: int, widths: Sequence[int], like: Tensor) -> None:
        self._memory = like.new_empty(min(num_rows, _rows_of_block(widths)) * max(widths))

    def block(self, num_rows: int, width: int) -> Tensor:
        return self._memory[: num_rows * width].view(num_rows, width)


class _Perceptron(torch.autograd.Function):
    """Linear layers with ELUs between them; parameters are weight and bias of each in turn."""

    @staticmethod
    def forward(ctx: Any, value: Tensor, *parameters: Tensor) -> Tensor:  # noqa: ANN401
        """Return the last layer's output."""
        weights, biases = parameters[::2], parameters[1::2]
        widths = [len(bias) for bias in biases]
        outputs = [value.new_empty(len(value), width) for width in widths]
        before = _Buffer(len(value), widths, value)
        for rows in _rows(len(value), widths):
            block = value[rows]
            for weight, bias, output in zip(weights[:-1], biases, outputs, strict=False):
                buffer = before.block(len(block), len(bias))
                block = elu_into(torch.addmm(bias, block, weight.t(), out=buffer), output[rows])
            torch.addmm(biases[-1], block, weights[-1].t(), out=outputs[-1][rows])
        ctx.save_for_backward(value, *outputs[:-1], *weights)
        return outputs[-1]

    @staticmethod
    @once_differentiable("a perceptron")
    def backward(  # pyright: ignore[reportIncompatibleMethodOverride]
        ctx: Any,  # noqa: ANN401
        *grad_outputs: Tensor,
    ) -> tuple[Tensor | None, ...]:
        """Return no gradient of the input, and those of the parameters."""
        saved = ctx.saved_tensors
        inputs, weights = saved[: len(saved) // 2], saved[len(saved) // 2 :]
        weight_grads = [torch.zeros_like(weight) for weight in weights]
        bias_grads = [weight.new_zeros(len(weight)) for weight in weights]
        num_rows, widths = len(inputs[0]), [len(weight) for weight in weights]
        buffers = [_Buffer(num_rows, widths, weights[0]) for _ in range(2)]  # one is read meanwhile
        for rows in _rows(num_rows, widths):
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
