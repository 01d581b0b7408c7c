"""What a test of learning runs by: products as they are, or hidden layers in bfloat16."""

from __future__ import annotations

import pytest
import torch


def use_bfloat16(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let hidden layers compute in bfloat16, whatever the processor has."""
    monkeypatch.setattr("mute.support.precision._has_units", lambda: True)
    torch.set_float32_matmul_precision("medium")
