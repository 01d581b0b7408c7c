"""The perceptron in blocks against its layers, and its gradient against the numerical one."""

from __future__ import annotations

import itertools
from typing import Any

import pytest
import torch
from torch import nn
from torch.nn.utils import prune

from mute.networks import perceptron as module
from mute.networks.elu import ELU
from mute.networks.perceptron import perceptron

NUM_ROWS, WIDTHS = 26, (7, 16, 24, 8, 3)


@pytest.fixture(autouse=True)
def _small_blocks(monkeypatch):
    _set_rows_of_a_block(monkeypatch, WIDTHS)


def _set_rows_of_a_block(monkeypatch, widths):
    # Three whole blocks of 8 rows, and one that is cut off.
    monkeypatch.setattr(module, "_BLOCK", 8 * max(widths[1:]))


def _make_layers(activation: type[nn.Module] = ELU, widths=WIDTHS, **factory):
    torch.manual_seed(0)
    layers: list[nn.Module] = []
    for before, after in itertools.pairwise(widths):
        layers += [nn.Linear(before, after, **factory), activation()]
    return nn.Sequential(*layers[:-1])


def _runs_in_blocks(output):
    return type(output.grad_fn).__name__ == "_PerceptronBackward"


def _assert_as_its_layers(layers, value, weight):
    outputs = perceptron(layers, value), layers(value)
    assert _runs_in_blocks(outputs[0])
    torch.testing.assert_close(*outputs, rtol=1e-6, atol=1e-6)
    learning = [parameter for parameter in layers.parameters() if parameter.requires_grad]
    gradients = [torch.autograd.grad((output * weight).sum(), learning) for output in outputs]
    torch.testing.assert_close(*gradients)


@pytest.mark.parametrize("widths", [WIDTHS, (7, 3), (7, 16, 3)])
def test_outputs_and_gradients_are_those_of_the_layers(widths, monkeypatch):
    _set_rows_of_a_block(monkeypatch, widths)
    layers = _make_layers(widths=widths)
    value = 3.0 * torch.randn(NUM_ROWS, widths[0])
    _assert_as_its_layers(layers, value, torch.randn(NUM_ROWS, widths[-1]))


@pytest.mark.parametrize("num_rows", [0, 1, 7, 8, 9])
def test_any_number_of_rows_will_do(num_rows):
    layers = _make_layers()
    value = torch.randn(num_rows, WIDTHS[0])
    _assert_as_its_layers(layers, value, torch.randn(num_rows, WIDTHS[-1]))


def test_rows_and_gradients_may_lie_anyhow_in_memory():
    layers = _make_layers()
    columns = torch.randn(WIDTHS[0] + 2, NUM_ROWS)[2:].t()
    _assert_as_its_layers(layers, columns, torch.randn(WIDTHS[-1], NUM_ROWS).t())
    same = torch.randn(WIDTHS[0]).expand(NUM_ROWS, -1)
    _assert_as_its_layers(layers, same, torch.ones(()).expand(NUM_ROWS, WIDTHS[-1]))


def test_layers_that_do_not_learn_are_passed_through():
    layers = _make_layers()
    layers[2].requires_grad_(False)
    value = torch.randn(NUM_ROWS, WIDTHS[0])
    _assert_as_its_layers(layers, value, torch.randn(NUM_ROWS, WIDTHS[-1]))


@pytest.mark.parametrize("mode", [torch.no_grad, torch.inference_mode])
def test_it_gives_the_same_where_nothing_is_learnt(mode):
    layers = _make_layers()
    value = torch.randn(NUM_ROWS, WIDTHS[0])
    with mode():
        output = perceptron(layers, value)
    assert torch.equal(output, perceptron(layers, value))
    torch.testing.assert_close(output, layers(value))


def test_layers_may_share_their_weights():
    one, other = nn.Linear(6, 6), nn.Linear(6, 6)
    other.weight = one.weight
    value = torch.randn(NUM_ROWS, 6)
    for layers in (nn.Sequential(one, ELU(), one), nn.Sequential(one, ELU(), other)):
        _assert_as_its_layers(layers, value, torch.randn(NUM_ROWS, 6))


def test_a_layer_wider_than_a_block_goes_row_by_row(monkeypatch):
    monkeypatch.setattr(module, "_BLOCK", 5)
    _assert_as_its_layers(_make_layers(), torch.randn(3, WIDTHS[0]), torch.randn(3, WIDTHS[-1]))


def test_a_gradient_of_its_gradient_is_refused():
    layers = _make_layers()
    output = perceptron(layers, torch.randn(NUM_ROWS, WIDTHS[0]))
    with pytest.raises(RuntimeError, match="a perceptron has no second derivative"):
        torch.autograd.grad(output.sum(), [*layers.parameters()], create_graph=True)


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


def test_an_input_that_wants_a_gradient_gets_one():
    layers = _make_layers()
    value = torch.randn(NUM_ROWS, WIDTHS[0], requires_grad=True)
    outputs = perceptron(layers, value), layers(value)
    assert not _runs_in_blocks(outputs[0])
    gradients = [torch.autograd.grad(output.sum(), value) for output in outputs]
    torch.testing.assert_close(*gradients)


class _Doubled(nn.Linear):
    def forward(self, input):
        return 2.0 * super().forward(input)


def _make_hooked():
    layers = _make_layers()
    layers[0].register_forward_hook(lambda _layer, _input, output: -output)
    return layers


def _make_pruned():
    layers = _make_layers()
    prune.random_unstructured(layers[0], "weight", amount=0.5)
    with torch.no_grad():
        # What is pruned is made anew in each pass.
        dict(layers.named_parameters())["0.weight_orig"].mul_(2.0)
    return layers


@pytest.mark.parametrize(
    "layers",
    [
        _make_layers(nn.Tanh),
        _make_layers(bias=False),
        nn.Sequential(),
        nn.Sequential(nn.Linear(WIDTHS[0], 3), ELU()),
        nn.Sequential(ELU(), nn.Linear(WIDTHS[0], 3)),
        nn.Sequential(nn.Linear(WIDTHS[0], 3), ELU(), nn.Flatten(0)),
        nn.Sequential(_Doubled(WIDTHS[0], 3)),
        _make_hooked(),
        _make_pruned(),
    ],
)
def test_other_layers_stay_as_they_are(layers):
    value = torch.randn(NUM_ROWS, WIDTHS[0])
    output = perceptron(layers, value)
    assert not _runs_in_blocks(output)
    assert torch.equal(output, layers(value))


@pytest.mark.parametrize("shape", [(WIDTHS[0],), (2, NUM_ROWS, WIDTHS[0])])
def test_other_shapes_go_through_the_layers(shape):
    layers, value = _make_layers(), torch.randn(shape)
    output = perceptron(layers, value)
    assert not _runs_in_blocks(output)
    assert torch.equal(output, layers(value))


def test_lower_precision_is_left_to_the_layers():
    layers, value = _make_layers(), torch.randn(NUM_ROWS, WIDTHS[0])
    with torch.autocast("cpu", torch.bfloat16):
        output = perceptron(layers, value)
    assert output.dtype == torch.bfloat16


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of TorchScript, by torch
def test_a_traced_one_is_made_of_its_layers():
    layers, value = _make_layers().requires_grad_(False), torch.randn(NUM_ROWS, WIDTHS[0])
    traced: Any = torch.jit.trace(lambda value: perceptron(layers, value), value)
    assert str(traced.graph).count("aten::elu") == len(WIDTHS) - 2
    torch.testing.assert_close(traced(value), layers(value))
