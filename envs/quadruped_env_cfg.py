"""The robot's world as data: what a task may set, and the ranges that it must keep to."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import get_args

from mute.support.ranges import Range, check_ranges

from .commands import CommandsCfg
from .footfall import FootfallCfg
from .height_map import HeightMapCfg
from .observations import ObservationsCfg
from .randomization import RandomizationCfg
from .rewards import RewardsCfg
from .scene import SceneCfg
from .simulation import Engine
from .terrain import TerrainCfg

__all__ = ["QuadrupedEnvCfg"]


@dataclass
class QuadrupedEnvCfg:
    """The task: everything about the world and nothing about learning."""

    num_envs: int = 1024
    """Number of robots."""
    seed: int = 0
    """Seed of every draw in the environment."""
    engine: Engine = "auto"
    """Physics: `mujoco` on the CPU, `warp` (MuJoCo Warp), or `auto`, the one that suits the
    device."""
    num_threads: int = 0
    """Threads of the physics on the CPU; 0 takes every processor that this process may use."""
    decimation: int = 4
    """Physics steps a control step; with 5 ms steps, 50 Hz."""
    episode_length: float = 20.0
    """Longest episode, s."""
    action_scale: float = 0.25
    """Radians of joint offset for an action of 1."""
    action_clip: float = 10.0
    """Largest magnitude of an action."""
    max_tilt: float = 1.0
    """Angle between trunk and vertical that ends an episode, rad."""
    initial_joint_noise: float = 0.1
    """Half width of the uniform offset of each joint at reset, rad."""
    initial_velocity: float = 0.2
    """Half width of the trunk's uniform initial velocities, m/s and rad/s."""
    random_heading: bool = True
    """Whether robots start in random directions."""
    scene: SceneCfg = field(default_factory=SceneCfg)
    """Robot, floor and solver."""
    terrain: TerrainCfg = field(default_factory=TerrainCfg)
    """The ground, and how its level follows what robots can do."""
    footfall: FootfallCfg = field(default_factory=FootfallCfg)
    """How contacts are debounced and landings measured."""
    height_map: HeightMapCfg = field(default_factory=HeightMapCfg)
    """Grid of the height map."""
    commands: CommandsCfg = field(default_factory=CommandsCfg)
    """Ranges of the commands."""
    observations: ObservationsCfg = field(default_factory=ObservationsCfg)
    """Scales and noise."""
    rewards: RewardsCfg = field(default_factory=RewardsCfg)
    """Weights and constants of the reward."""
    randomization: RandomizationCfg = field(default_factory=RandomizationCfg)
    """Physics that differs between robots, and pushes."""

    def __post_init__(self) -> None:
        """Check the fields.

        Raises:
            ValueError: If one is out of its range.
        """
        if self.engine not in get_args(Engine):
            raise ValueError(
                f"env.engine must be one of {', '.join(get_args(Engine))}, got {self.engine!r}"
            )
        check_ranges(self, "env", _RANGES)
        if self.terrain.ahead_share > 0.0 and self.commands.lin_vel_x[1] <= 0.0:
            raise ValueError(
                "env.commands.lin_vel_x must end above 0 where env.terrain.ahead_share is "
                f"{self.terrain.ahead_share:g}, got {self.commands.lin_vel_x}"
            )
        for name, term in self.rewards.terms.items():
            needs = term.function == "landing_load" and term.weight != 0.0
            if needs and not self.scene.foot_forces:
                raise ValueError(
                    f"env.scene.foot_forces must be true for env.rewards.terms.{name}, got false"
                )

    @property
    def step_dt(self) -> float:
        """Control period, s."""
        return self.scene.timestep * self.decimation


_RANGES = {
    "num_envs": Range(1, 2**20, whole=True),
    "seed": Range(0, 2**63 - 1, whole=True),  # what torch takes
    "num_threads": Range(0, 4096, whole=True),
    "decimation": Range(1, 1000, whole=True),
    "episode_length": Range(0.0, 1e9, above=True),
    "action_scale": Range(0.0, 100.0, above=True),
    "action_clip": Range(0.0, 1e6, above=True),
    "max_tilt": Range(0.0, math.pi, above=True),
    "initial_joint_noise": Range(0.0, math.pi),
    "initial_velocity": Range(0.0, 100.0),
}
