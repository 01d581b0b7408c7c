"""The perceptron in blocks against its layers, and its gradient against the numerical one."""

from __future__ import annotations

import itertools

import pytest
import torch
from torch import nn

from networks import perceptron as module
from networks.elu import ELU
from networks.perceptron import perceptron

NUM_ROWS, WIDTHS = 26, (7, 16, 24, 8, 3)


@pytest.fixture(autouse=True)
def _blocks_of_8_rows(monkeypatch):
    monkeypatch.setattr(module, "_ROWS", 8)  # three whole blocks, and one that is cut off


def _make_layers(activation: type[nn.Module] = ELU, widths=WIDTHS, **factory):
    torch.manual_seed(0)
    layers: list[nn.Module] = []
    for before, after in itertools.pairwise(widths):
        layers += [nn.Linear(before, after, **factory), activation()]
    return nn.Sequential(*layers[:-1])


def _runs_in_blocks(output):
    return type(output.grad_fn).__name__ == "_PerceptronBackward"


@pytest.mark.parametrize("widths", [WIDTHS, (7, 3), (7, 16, 3)])
def test_outputs_and_gradients_are_those_of_the_layers(widths):
    layers = _make_layers(widths=widths)
    value = 3.0 * torch.randn(NUM_ROWS, widths[0])
    outputs = perceptron(layers, value), layers(value)
    assert _runs_in_blocks(outputs[0])
    torch.testing.assert_close(*outputs, rtol=1e-6, atol=1e-6)
    weight = torch.randn(NUM_ROWS, widths[-1])
    gradients = [
        torch.autograd.grad((output * weight).sum(), [*layers.parameters()]) for output in outputs
    ]
    torch.testing.assert_close(*gradients)


def test_gradients_are_the_numerical_ones():
    layers = _make_layers(dtype=torch.float64)
    value = torch.randn(NUM_ROWS, WIDTHS[0], dtype=torch.float64)

    parameters = [*layers.parameters()]  # weight and bias of each layer in turn
    assert torch.autograd.gradcheck(
        lambda *parameters: module._Perceptron.apply(value, *parameters), parameters
    )


def test_hooks_of_the_parameters_see_their_gradients():
    layers = _make_layers()
    for parameter in layers.parameters():
        parameter.register_hook(torch.zeros_like)
    perceptron(layers, torch.randn(NUM_ROWS, WIDTHS[0])).sum().backward()
    assert all(p.grad is not None and not p.grad.any() for p in layers.parameters())


def test_an_input_is_left_alone():
    value = torch.randn(NUM_ROWS, WIDTHS[0])
    before = value.clone()
    perceptron(_make_layers(), value).sum().backward()
    assert torch.equal(value, before)


@pytest.mark.parametrize("num_rows", [0, 1, 8])
def test_any_number_of_rows_will_do(num_rows):
    layers = _make_layers()
    value = torch.randn(num_rows, WIDTHS[0])
    output = perceptron(layers, value)
    torch.testing.assert_close(output, layers(value))
    output.sum().backward()


def test_an_input_that_wants_a_gradient_gets_one():
    value = torch.randn(NUM_ROWS, WIDTHS[0], requires_grad=True)
    output = perceptron(_make_layers(), value)
    assert not _runs_in_blocks(output)
    output.sum().backward()
    assert value.grad is not None and value.grad.abs().min() > 0.0


def test_other_layers_stay_as_they_are():
    linear = nn.Linear(WIDTHS[0], 3)
    others = [
        _make_layers(nn.Tanh),
        _make_layers(bias=False),
        nn.Sequential(linear, ELU()),
        nn.Sequential(ELU(), linear),
        nn.Sequential(linear, ELU(), nn.Flatten(0)),
    ]
    value = torch.randn(NUM_ROWS, WIDTHS[0])
    for layers in others:
        output = perceptron(layers, value)
        assert not _runs_in_blocks(output)
        assert torch.equal(output, layers(value))
