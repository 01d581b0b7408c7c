"""The policy that ships under another configuration, for tests that look at no step of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from places import SHIPPED_POLICY

from mute.checkpoint import load_checkpoint, save_checkpoint

_PLACES = {
    "seed": ("config", "env"),
    "num_threads": ("config", "env"),
    "action_scale": ("config", "env"),
    "symmetric": ("config", "agent"),
    "gamma": ("config", "agent", "ppo"),
    "iteration": (),
}


def write_variant(path: Path, **changes: Any) -> Path:
    """Write it with other values of some fields, and return its path."""
    saved = load_checkpoint(SHIPPED_POLICY)
    for name, value in changes.items():
        part = saved
        for key in _PLACES[name]:
            part = part[key]
        part["iter" if name == "iteration" else name] = value
    if changes.get("symmetric") is False:
        saved["config"]["agent"]["leading_side"] = False
    save_checkpoint(path, saved)
    return path
