"""What ground a task has: which kinds, in which shares, and at which levels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from mute.support.ranges import Range, check_ordered, check_ranges

from .figures import LEVELS
from .kinds import KINDS

__all__ = ["GROUNDS", "QUIET_KINDS", "TerrainCfg", "kind_of_robot"]

GROUNDS: Mapping[str, Mapping[str, float]] = {
    "indoor": {"flat": 0.25, "rooms": 0.2, "blocks": 0.15, "stairs": 0.25, "stairs_down": 0.15},
    "rough": {
        "flat": 0.1,
        "slopes": 0.1,
        "uneven": 0.2,
        "blocks": 0.2,
        "stairs": 0.2,
        "stairs_down": 0.2,
    },
} | {name: {name: 1.0} for name in KINDS}
"""Kinds of ground in each choice, with their shares of the robots."""

QUIET_KINDS = ("flat", "rooms")
"""Kinds of ground, level for the most part, that keep all of the phase rewards."""


@dataclass
class TerrainCfg:
    """The ground under the robots."""

    kind: str = "flat"
    """`flat`, `indoor` (floors with what lies on them, and stairs), `rough` (slopes, uneven ground,
    blocks and stairs), or one kind alone of `envs.terrain.KINDS`."""
    first_levels: tuple[int, int] = (0, 1)
    """Lowest and highest level, of 0 to 4, that robots start with."""
    curriculum: bool = True
    """Whether robots that get ahead go on to higher levels, and others back to lower ones."""
    crossed: float = 4.0
    """Distance from its start that a robot gets in an episode to go up a level, m."""
    passed_share: float = 0.0
    """Share of the way it was asked for that it must have made as well, or who is slow goes up."""
    command_time: float = 0.0
    """Time between new velocity commands where ground has levels, s; with 0 it is that of all
    commands. Commands that soon follow each other lead nowhere, and over nothing."""
    turning_share: float = 1.0
    """Share of the yaw rates' range that commands are drawn from where ground is crossed along x: a
    robot that turns all the time climbs nothing."""
    ahead_share: float = 0.0
    """Share of the commands there that lead straight ahead, at 0.3 to 1 of the largest speed."""
    quiet_share: float = 1.0
    """What is left of the weight of the phase rewards on stairs, slopes, blocks and uneven ground:
    soft steps and steps over edges are at odds. Flat ground and rooms keep all of it."""

    def __post_init__(self) -> None:
        """Check the fields.

        Raises:
            ValueError: If one is out of its range.
        """
        if self.kind not in GROUNDS:
            raise ValueError(
                f"env.terrain.kind must be one of {', '.join(GROUNDS)}, got {self.kind!r}"
            )
        check_ranges(self, "env.terrain", _RANGES)
        check_ordered(self, "env.terrain", "first_levels")

    @property
    def shares(self) -> Mapping[str, float]:
        """Kinds of ground and their shares of the robots."""
        return GROUNDS[self.kind]


_RANGES = {
    "first_levels": Range(0, LEVELS - 1, whole=True),
    "crossed": Range(0.0, 1e6, above=True),
    "command_time": Range(0.0, 1e12),
    "passed_share": Range(0.0, 1.0),
    "turning_share": Range(0.0, 1.0),
    "ahead_share": Range(0.0, 1.0),
    "quiet_share": Range(0.0, 1.0),
}


def kind_of_robot(cfg: TerrainCfg, num_envs: int) -> list[str]:
    """Return each robot's kind of ground: as even as the shares allow, and spread over all ranks.

    Robot k takes the kind at the place (k + 1/2) g, modulo 1, of the shares laid side by side, g
    the golden ratio: any number of robots comes out nearly as the shares say.
    """
    names, ends, total = list(cfg.shares), [], 0.0
    for share in cfg.shares.values():
        total += share
        ends.append(total)
    places = [((robot + 0.5) * 0.6180339887498949) % 1.0 * total for robot in range(num_envs)]
    return [names[sum(place >= end for end in ends[:-1])] for place in places]
