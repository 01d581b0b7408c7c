"""Ground without an environment around it."""

from __future__ import annotations

import torch

from mute.envs.batch_simulation import BatchSimulation
from mute.envs.scene import SceneCfg, build_scene
from mute.envs.terrain import KINDS, BoxGround
from mute.envs.terrain.draws import KEYS
from mute.envs.terrain.figures import LEVELS


def make_ground(name: str, robots: int, seed: int) -> tuple[BoxGround, BatchSimulation]:
    """Return ground of one kind, of all levels in turn, that is not laid yet.

    Args:
        name: The kind.
        robots: Number of robots.
        seed: Of their keys.
    """
    model = build_scene(SceneCfg(ground_boxes=KINDS[name].boxes), pictured=False)
    simulation = BatchSimulation(model, robots)
    ground = BoxGround(simulation, [name] * robots)
    ground.level = torch.arange(robots) % LEVELS
    ground.key = torch.randint(KEYS, (robots,), generator=torch.Generator().manual_seed(seed))
    return ground, simulation
