"""Hidden layers compute in bfloat16 where a run allows it and the processor has units for it."""

from __future__ import annotations

import pytest
import torch
from quick_products import use_bfloat16

from mute.support.precision import full_precision, hidden_dtype, hidden_layers


@pytest.mark.parametrize(
    ("precision", "device", "has_units", "expected"),
    [
        ("medium", "cpu", True, torch.bfloat16),
        ("medium", "cpu", False, torch.float32),
        ("high", "cpu", True, torch.float32),
        ("highest", "cpu", True, torch.float32),
        ("medium", "cuda", True, torch.float32),
    ],
)
def test_bfloat16_needs_the_lowest_precision_and_a_processor_with_units(
    monkeypatch, precision, device, has_units, expected
):
    monkeypatch.setattr("mute.support.precision._has_units", lambda: has_units)
    torch.set_float32_matmul_precision(precision)
    assert hidden_dtype(torch.device(device)) == expected


def test_layers_compute_in_bfloat16_inside_the_context_and_as_before_outside(monkeypatch):
    use_bfloat16(monkeypatch)
    layer, value = torch.nn.Linear(4, 2), torch.randn(3, 4)
    with hidden_layers(value.device):
        assert layer(value).dtype == torch.bfloat16
    assert layer(value).dtype == torch.float32
    torch.set_float32_matmul_precision("highest")
    with hidden_layers(value.device):
        assert layer(value).dtype == torch.float32


def test_full_precision_is_for_a_while_and_ends_with_an_error_too(monkeypatch):
    use_bfloat16(monkeypatch)
    device = torch.device("cpu")
    with pytest.raises(RuntimeError), full_precision():
        assert hidden_dtype(device) == torch.float32
        raise RuntimeError
    assert hidden_dtype(device) == torch.bfloat16
