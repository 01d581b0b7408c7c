"""ELU, whose exponential is a power of two on a CPU: torch's own takes half as long again there.

exp(x) - 1 = 2^(x log2 e) - 1, in float32 within 1e-7 of the exact value, as torch's `expm1` is. On
a GPU, in half precision and where operations are made into a graph it is torch's.

Source: Clevert et al., "Fast and accurate deep network learning by exponential linear units", 2016.
"""

from __future__ import annotations

import math
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

__all__ = ["ELU", "elu_backward", "elu_into", "has_fast_form"]

_LOG2_E = math.log2(math.e)


def has_fast_form(value: Tensor) -> bool:
    """Return whether activations of a tensor take their fast form.

    They do on a CPU in single and double precision, unless operations are being traced, exported,
    compiled or transformed instead of done.
    """
    if not value.is_cpu or value.dtype not in (torch.float32, torch.float64):
        return False
    return not (
        torch.jit.is_tracing()  # pyright: ignore[reportPrivateImportUsage]
        or torch.compiler.is_compiling()  # or exporting
        or torch._C._are_functorch_transforms_active()
    )


def elu_into(value: Tensor, out: Tensor) -> Tensor:
    """Write the activation of a tensor to another on the same CPU, and return that.

    Args:
        value: What is activated. Any shape.
        out: Where it goes, other memory than `value`. The same shape.
    """
    torch.clamp(value, max=0.0, out=out).mul_(_LOG2_E).exp2_().sub_(1.0)
    return torch.maximum(value, out, out=out)


def elu_backward(grad: Tensor, output: Tensor, out: Tensor) -> Tensor:
    """Write the gradient of the activation's input to a tensor, and return that.

    Args:
        grad: Gradient of the output. Any shape.
        output: The output. The same shape.
        out: Where it goes; it may be `grad`. The same shape.
    """
    return torch.ops.aten.elu_backward.grad_input(grad, 1.0, 1.0, 1.0, True, output, grad_input=out)


class ELU(nn.ELU):
    """x where x > 0, else exp(x) - 1, as torch's with its default alpha.

    Its output is kept for the gradient and must not be changed in place.
    """

    def __init__(self) -> None:
        """Make the activation."""
        super().__init__()

    def forward(self, input: Tensor) -> Tensor:
        """Return the activation of a tensor of any shape."""
        if torch.jit.is_scripting():  # pyright: ignore[reportPrivateImportUsage]
            return functional.elu(input)
        return self._fastest(input)

    @torch.jit.unused
    def _fastest(self, value: Tensor) -> Tensor:
        return _PowerOfTwo.apply(value) if has_fast_form(value) else functional.elu(value)


class _PowerOfTwo(torch.autograd.Function):
    """The activation in passes that torch vectorises, and its gradient from the output alone."""

    @staticmethod
    def forward(ctx: Any, value: Tensor) -> Tensor:  # noqa: ANN401
        """Return the activation and keep it."""
        output = elu_into(value, torch.empty_like(value))
        ctx.save_for_backward(output)
        return output

    @staticmethod
    def backward(  # pyright: ignore[reportIncompatibleMethodOverride]
        ctx: Any,  # noqa: ANN401
        *grad_outputs: Tensor,
    ) -> Tensor:
        """Return the gradient of what `forward` was given."""
        (output,) = ctx.saved_tensors
        if torch.is_grad_enabled():  # a gradient of the gradient will be asked for
            return torch.ops.aten.elu_backward(grad_outputs[0], 1.0, 1.0, 1.0, True, output)
        return elu_backward(grad_outputs[0], output, torch.empty_like(output))
