"""Where the tests find the tree."""

from __future__ import annotations

from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
RESOURCES = REPOSITORY / "resources"
SHIPPED_POLICY = RESOURCES / "go1" / "go1_mute.pt"
FLAT_POLICY = RESOURCES / "go1" / "go1_mute_flat.pt"
