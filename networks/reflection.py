"""Networks that treat left and right alike: what they do in a mirror is what they do, mirrored.

A reflection acts on a vector by permuting its entries and changing the signs of some. A layer W, b
commutes with the reflections P of its input and Q of its output if Q W P = W and Q b = b. Weights
that start so and learn from the mean of their gradient and its mirror image stay so under Adam,
which treats all entries alike, up to rounding. Nothing else changes: the layers, what is saved of
them and what they cost in use are those of ordinary ones; learning pays one more gather for each
gradient. Hidden layers are mirrored by swapping their halves.

Sources: Ordonez-Apraez et al., "Morphological symmetries in robotics", 2024 (equivariant layers);
Su et al., "Leveraging symmetry in RL-based legged locomotion control", 2024 (what they are worth).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor, nn

__all__ = ["Reflection", "tie_layer", "tie_mlp", "tie_vector"]


@dataclass(frozen=True)
class Reflection:
    """A reflection of a vector: entry i of the image is sign[i] times entry index[i]."""

    index: tuple[int, ...]
    """Where each entry of the image comes from."""
    sign: tuple[float, ...]
    """1, or -1 where it changes its sign."""

    def __post_init__(self) -> None:
        """Check that reflecting twice changes nothing.

        Raises:
            ValueError: If it would.
        """
        places = range(len(self.index))
        if len(self.sign) != len(self.index) or any(
            self.index[self.index[i]] != i
            or abs(self.sign[i]) != 1.0
            or self.sign[i] != self.sign[self.index[i]]
            for i in places
        ):
            raise ValueError(f"this is not a reflection: {self}")

    @classmethod
    def unchanged(cls, width: int) -> Reflection:
        """Return the reflection that changes nothing."""
        return cls(tuple(range(width)), (1.0,) * width)

    @classmethod
    def swapped(cls, width: int) -> Reflection:
        """Return the reflection that swaps the halves of a vector.

        Raises:
            ValueError: If the width is odd.
        """
        if width % 2:
            raise ValueError(f"a symmetric network needs layers of even width, got {width}")
        half = width // 2
        return cls((*range(half, width), *range(half)), (1.0,) * width)

    @property
    def unsigned(self) -> Reflection:
        """The same without changes of sign: how what has no sign is mirrored, a deviation say."""
        return Reflection(self.index, (1.0,) * len(self.index))

    @classmethod
    def joined(cls, parts: Sequence[Reflection]) -> Reflection:
        """Return the reflection of vectors that lie one after the other."""
        index: list[int] = []
        for part in parts:
            index += [len(index) + place for place in part.index]
        return cls(tuple(index), tuple(sign for part in parts for sign in part.sign))

    def __call__(self, value: Tensor) -> Tensor:
        """Return the image of vectors in the last dimension."""
        return value[..., list(self.index)] * value.new_tensor(self.sign)


def tie_layer(weight: Tensor, source: Reflection, target: Reflection) -> None:
    """Make a weight commute with the reflections of its input and output, now and as it learns.

    Args:
        weight: The weight. Shape: (out_features, in_features).
        source: Reflection of the input.
        target: Reflection of the output.
    """
    place = torch.tensor(target.index)[:, None], torch.tensor(source.index)
    sign = torch.tensor(target.sign)[:, None] * torch.tensor(source.sign)
    # Half the sum of two independent entries would start with half of the usual variance. No entry
    # is its own image, since hidden layers swap their halves, and one side is always hidden.
    _tie(weight, place, sign, math.sqrt(0.5))


def tie_vector(vector: Tensor, reflection: Reflection) -> None:
    """Make a vector its own mirror image, now and as it learns. Shape: (width,)."""
    _tie(vector, (torch.tensor(reflection.index),), torch.tensor(reflection.sign), 0.5)


def tie_mlp(
    layers: nn.Module, source: Reflection, target: Reflection, leading_side: bool = False
) -> None:
    """Make a perceptron commute with the reflections of its input and output.

    Args:
        layers: The perceptron.
        source: Reflection of the input.
        target: Reflection of the output.
        leading_side: Whether it may lead with one side, always the same: the bias of its first
            layer stays free. That is as good as one more input that changes its sign in the
            mirror, held at 1: what is its own mirror image in all else gets no mirrored answer.

    Raises:
        ValueError: If the width of a hidden layer is odd.
    """
    linear = [layer for layer in layers.modules() if isinstance(layer, nn.Linear)]
    for layer in linear:
        first, last = layer is linear[0], layer is linear[-1]
        image = target if last else Reflection.swapped(layer.out_features)
        tie_layer(layer.weight, source, image)
        if not (first and leading_side):
            tie_vector(layer.bias, image)
        source = image


def _tie(parameter: Tensor, place: tuple[Tensor, ...], sign: Tensor, initial_scale: float) -> None:
    # One index of entries in a row: a gather by two of them takes several times as long.
    entries = torch.arange(parameter.numel()).view(parameter.shape)[place].flatten()
    entries, sign = entries.to(parameter.device), sign.to(parameter)
    signed = bool((sign != 1.0).any())

    def mirrored(value: Tensor) -> Tensor:
        image = value.reshape(-1).index_select(0, entries).view(value.shape)
        return image.mul_(sign) if signed else image

    with torch.no_grad():
        parameter.copy_(initial_scale * (parameter + mirrored(parameter)))
    parameter.register_hook(lambda grad: mirrored(grad).add_(grad).mul_(0.5))
