"""ELU against torch's own, and its gradient against the numerical one."""

from __future__ import annotations

import math
from typing import Any

import pytest
import torch
from torch.nn import functional

from mute.networks.elu import ELU


def test_it_is_within_1e_7_of_the_exact_value():
    value = torch.linspace(-30.0, 1.0, 60_001)
    exact = functional.elu(value.double())
    worst = (ELU()(value).double() - exact).abs().max()
    assert worst <= 1e-7


@pytest.mark.parametrize("value", [0.0, -math.inf, math.inf, math.nan])
def test_it_is_torchs_where_numbers_end(value):
    tensor = torch.full((3,), value)
    torch.testing.assert_close(ELU()(tensor), functional.elu(tensor), equal_nan=True)


def test_it_leaves_its_input_alone():
    value = torch.tensor([-1.0, 2.0])
    ELU()(value)
    assert value.tolist() == [-1.0, 2.0]


def test_its_gradient_is_the_numerical_one():
    torch.manual_seed(0)
    value = torch.randn(5, 3, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(ELU(), value)


def test_its_gradient_in_float32_is_torchs():
    torch.manual_seed(0)
    value = torch.randn(64, 6, requires_grad=True)
    weight = torch.randn(6, 64)
    gradients = [
        torch.autograd.grad((activation(value.t()) * weight).sum(), value)
        for activation in (ELU(), torch.nn.ELU())
    ]
    torch.testing.assert_close(*gradients)


def test_its_second_derivative_is_the_numerical_one():
    torch.manual_seed(0)
    value = torch.randn(5, 3, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradgradcheck(ELU(), value)


def test_functional_transforms_go_through_it():
    value = torch.linspace(-2.0, 2.0, 6)
    slopes = torch.func.vmap(torch.func.grad(ELU()))(value)
    torch.testing.assert_close(slopes, value.clamp(max=0.0).exp())


@pytest.mark.parametrize("dtype", [torch.bfloat16, torch.float16])
def test_in_half_precision_it_is_torchs(dtype):
    value = torch.randn(64).to(dtype)
    assert torch.equal(ELU()(value), functional.elu(value))


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of TorchScript, by torch
def test_graphs_hold_torchs_one_operation():
    value = torch.linspace(-3.0, 3.0, 8)
    model = torch.nn.Sequential(ELU())
    exported = torch.export.export(model, (value,)).graph
    assert [node.target for node in exported.nodes if node.op == "call_function"] == [
        torch.ops.aten.elu.default
    ]
    scripted: Any = torch.jit.script(model)
    traced: Any = torch.jit.trace(model, value)
    for graph in (scripted, traced):
        assert torch.equal(graph(value), functional.elu(value))


def test_a_row_is_the_same_whatever_rows_stand_beside_it():
    # Where rows do not fill vectors, torch computes what is left over another way, as in its own.
    torch.manual_seed(0)
    value = torch.randn(37, 64)
    whole = ELU()(value)
    rows = torch.stack([ELU()(row) for row in value])
    assert torch.equal(rows, whole)
