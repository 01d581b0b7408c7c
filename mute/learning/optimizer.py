"""Adam as one kernel for all parameters, whoever saved its state."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from torch import nn
from torch.optim import Adam

__all__ = ["FusedAdam"]


class FusedAdam(Adam):
    """torch's fused Adam. On a CPU its default takes some twenty kernels for each parameter."""

    def __init__(self, params: Iterable[nn.Parameter], lr: float) -> None:
        """Take on parameters, see `torch.optim.Adam`."""
        super().__init__(params, lr, fused=True)

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """Load a state, and stay fused where it was saved by an Adam that was not."""
        groups = [group | {"fused": True} for group in state_dict["param_groups"]]
        super().load_state_dict(state_dict | {"param_groups": groups})
