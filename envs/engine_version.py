"""The version of MuJoCo in a saved state, which both engines keep and look at alike."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import torch

__all__ = ["check_version", "version_entry"]

_KEY = "mujoco"

_VERSION = tuple(int(part) for part in mujoco.__version__.split(".")[:3])


def version_entry(device: torch.device) -> dict[str, torch.Tensor]:
    """Return the entry of a `state_dict` that tells this version of MuJoCo. Shape: (3,)."""
    return {_KEY: torch.tensor(_VERSION, device=device)}


def check_version(state: Mapping[str, torch.Tensor]) -> None:
    """Refuse a state that another MuJoCo would not continue as it was: patches alone may differ.

    Args:
        state: A `state_dict` of either engine.

    Raises:
        ValueError: If it tells no version, or another major or minor one.
    """
    if _KEY not in state:
        raise ValueError(
            "simulation state is of the engine of an earlier version, whose trainings cannot go"
            " on here; their policies play and export as before"
        )
    version = tuple(state[_KEY].tolist())
    if version[:2] != _VERSION[:2]:
        raise ValueError(
            f"simulation state is of MuJoCo {'.'.join(map(str, version))}, this is "
            f"{mujoco.__version__}: go on with the version that it was saved with"
        )
