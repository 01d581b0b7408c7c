"""Perceptrons: linear layers, each but the last followed by an activation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from torch import nn

__all__ = ["ACTIVATIONS", "Activation", "perceptron"]

Activation = Literal["elu", "relu", "tanh"]
"""What may follow a layer."""

ACTIVATIONS: dict[Activation, type[nn.Module]] = {
    "elu": nn.ELU,
    "relu": nn.ReLU,
    "tanh": nn.Tanh,
}
"""Activations by name."""


def perceptron(
    in_features: int,
    hidden: Sequence[int],
    out_features: int | None,
    activation: Activation,
) -> nn.Sequential:
    """Build a perceptron.

    Args:
        in_features: Width of the input.
        hidden: Widths of the hidden layers.
        out_features: Width of the linear output; None ends with the last hidden layer.
        activation: What follows each hidden layer.
    """
    layers: list[nn.Module] = []
    for width in hidden:
        layers += [nn.Linear(in_features, width), ACTIVATIONS[activation]()]
        in_features = width
    if out_features is not None:
        layers.append(nn.Linear(in_features, out_features))
    return nn.Sequential(*layers)
