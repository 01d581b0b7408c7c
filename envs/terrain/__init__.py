"""The ground: what lies under every robot, in boxes that are laid anew as it walks."""

from __future__ import annotations

from .cfg import GROUNDS, QUIET_KINDS, TerrainCfg, kind_of_robot
from .ground import BoxGround, FlatGround, Ground, num_boxes
from .kinds import KINDS

__all__ = [
    "GROUNDS",
    "KINDS",
    "QUIET_KINDS",
    "BoxGround",
    "FlatGround",
    "Ground",
    "TerrainCfg",
    "kind_of_robot",
    "num_boxes",
]
