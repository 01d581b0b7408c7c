"""Fields of the model that differ between simulations, saved and loaded by both engines alike."""

from __future__ import annotations

from collections.abc import Mapping

import torch

from .simulation import Simulation

__all__ = ["load_fields", "saved_fields"]

_PREFIX = "field/"


def saved_fields(fields: Mapping[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    """Return the entries of a `state_dict` that hold model fields.

    Args:
        fields: Fields by their names in MuJoCo. Shape of each: (num_envs, ...).
    """
    return {f"{_PREFIX}{name}": value.clone() for name, value in fields.items()}


def load_fields(simulation: Simulation, state: Mapping[str, torch.Tensor]) -> None:
    """Write the model fields of a `state_dict`; `set_const` is the caller's to call.

    Args:
        simulation: The engine that they are written to.
        state: A `state_dict` of an engine of that kind.

    Raises:
        ValueError: If a field has another shape than in this model; none is written then.
    """
    saved = {
        key.removeprefix(_PREFIX): value for key, value in state.items() if key.startswith(_PREFIX)
    }
    for name, value in saved.items():
        own = simulation.field(name)
        if value.shape != own.shape:
            raise ValueError(
                f"simulation field {name!r} has shape {tuple(value.shape)}, this model needs "
                f"{tuple(own.shape)}"
            )
    for name, value in saved.items():
        simulation.field(name).copy_(value)
