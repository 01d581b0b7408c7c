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
        """Load a state with its learning rate; all other settings stay as they are.

        So it stays fused where the state was saved by an Adam that was not.
        """
        own = self.state_dict()["param_groups"]
        saved = state_dict["param_groups"]
        groups = [one | {"lr": other["lr"]} for one, other in zip(own, saved, strict=True)]
        super().load_state_dict(state_dict | {"param_groups": groups})

    def set_learning_rate(self, learning_rate: float) -> None:
        """Go on with another learning rate."""
        for group in self.param_groups:
            group["lr"] = learning_rate
