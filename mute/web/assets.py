"""The files that the page needs of Python, as plain data: scenes, the policy, floors and limits.

What the page walks in is what is heard in Python, `listening_cfg`: physics at 1 ms, forces at the
feet, elliptic cones, so that there is one physics for eye and ear. The policy is the ONNX file of
`mute.export`, which the page reads itself.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mute.acoustics.audible_env import listening_cfg
from mute.acoustics.floors import FLOORS
from mute.acoustics.recorder import AT_LIMIT, RELEASE
from mute.controllers.command import COMMAND_LIMITS, Command
from mute.controllers.learned import Policy
from mute.controllers.onnx_export import export_policy
from mute.envs.quadruped_env import scene_of
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.scene import FOOT_RADIUS, JOINT_NAMES, LEGS, SceneCfg
from mute.envs.simulation import MAX_SPEED
from mute.envs.terrain.figures import FIGURES, TREAD
from mute.envs.terrain.ground import NEAR
from mute.envs.terrain.kinds import Stairs
from mute.envs.terrain.layout import DEPTH, HALF_WIDTH, WIDE
from mute.evaluation.noise_levels import SETTLE_TIME
from mute.evaluation.trials import evaluation_cfg, from_the_stance
from mute.support.files import write_file
from mute.web.scene_text import scene_text
from mute.web.sound_tables import SAMPLE_RATE, packed, sound_tables

__all__ = ["FORMAT", "write_assets"]

FORMAT = 2
"""Version of the layout of `page.json`; the page refuses any other."""

_LABELS = {
    "go1_mute": "MUTE",
    "go1_mute_flat": "MUTE, learnt on flat ground",
    "go1_dreamwaq": "DreamWaQ",
    "go1_mute_paper": "MUTE, as in the paper",
}
"""What controllers are called in the page's list, by their task; others by its name."""

_SURFACE = "wood"
"""Floor that the page begins with."""


def write_assets(policies: Sequence[Policy], out: Path) -> list[Path]:
    """Write all files into a directory, which is made if need be, and return them.

    The first policy drives when the page begins, and its task is the world; each is named after its
    task.

    - `flat.xml`, `stairs.xml`: the scenes, see `scene_text`;
    - `TASK.onnx`: a policy, see `mute.controllers.onnx_export.export_policy`;
    - `page.json`: all else that the simulation needs, see `page_data`;
    - `sound.json`, `sound.bin`: see `mute.web.sound_tables`.

    Raises:
        MuteError: If a file cannot be written.
        ValueError: If two policies are of one task, or the first acts at times between the physics
            steps of sound.
    """
    tasks = [policy.task for policy in policies]
    if len(set(tasks)) < len(tasks):
        raise ValueError(f"policies must be of different tasks, got {', '.join(tasks)}")
    cfg = walking_cfg(policies[0].cfg.env, _SURFACE, 1.0)
    out.mkdir(parents=True, exist_ok=True)
    for policy in policies:
        export_policy(policy, out / f"{policy.task}.onnx")
    written = {
        "flat.xml": scene_text(scene_of(cfg)).encode(),
        "stairs.xml": scene_text(_with_boxes(scene_of(cfg))).encode(),
        "page.json": _json(page_data(policies, cfg)),
    }
    sound_json, sound_binary = packed(sound_tables())
    written |= {"sound.json": sound_json.encode(), "sound.bin": sound_binary}
    for name, data in written.items():
        write_file(out / name, data)
    return [out / name for name in (*(f"{task}.onnx" for task in tasks), *written)]


def walking_cfg(
    cfg: QuadrupedEnvCfg, surface: str, seconds: float, seed: int = 0
) -> QuadrupedEnvCfg:
    """Return the environment that the page walks in: one robot, from the exact stance.

    Args:
        cfg: The environment of the policy's training.
        surface: Name of the floor.
        seconds: Length of an episode, s.
        seed: Seed of the environment, in which nothing is random but what is asked for.
    """
    return listening_cfg(from_the_stance(evaluation_cfg(cfg, 1, seconds, seed)), surface)


def page_data(policies: Sequence[Policy], cfg: QuadrupedEnvCfg) -> dict[str, Any]:
    """Return what `page.json` holds. Lengths in m, times in s, angles in rad.

    Args:
        policies: What drives, the one that the page begins with first.
        cfg: What it walks in, see `walking_cfg`.
    """
    speeds = policies[0].cfg.env.commands
    return {
        "format": FORMAT,
        "controllers": [
            {
                "name": policy.task,
                "label": _LABELS.get(policy.task, policy.task),
                "file": f"{policy.task}.onnx",
            }
            for policy in policies
        ],
        "legs": LEGS,
        "joint_names": JOINT_NAMES,
        "foot_radius": FOOT_RADIUS,
        "decimation": cfg.decimation,
        "max_tilt": cfg.max_tilt,
        "max_speed": MAX_SPEED,
        "command": {
            "limits": COMMAND_LIMITS,
            "trained": {"vx": speeds.lin_vel_x, "vy": speeds.lin_vel_y, "wz": speeds.ang_vel_z},
            "start": dataclasses.asdict(Command()),
        },
        "footfall": {**dataclasses.asdict(cfg.footfall), "near": NEAR},
        "contact": {"release": RELEASE, "at_limit": AT_LIMIT},
        "settle_time": SETTLE_TIME,
        "sample_rate": SAMPLE_RATE,
        "surface": _SURFACE,
        "floors": [
            {
                "name": floor.name,
                "friction": floor.friction,
                "solref": floor.solref,
                "colour": floor.colour,
            }
            for floor in FLOORS.values()
        ],
        "stairs": stairs_figures(),
    }


def stairs_figures() -> dict[str, Any]:
    """Return what the page needs to lay the stairs of `envs.terrain` by itself. Lengths in m."""
    return {
        "boxes": Stairs.boxes,
        "steps": Stairs.STEPS,
        "top": Stairs.TOP,
        "valley": Stairs.VALLEY,
        "tread": TREAD,
        "risers": FIGURES["riser"],
        "depth": DEPTH,
        "half_width": HALF_WIDTH,
        "drawn_half_width": WIDE,
    }


def _with_boxes(scene: SceneCfg) -> SceneCfg:
    return dataclasses.replace(scene, ground_boxes=Stairs.boxes)


def _json(content: object) -> bytes:
    return (json.dumps(content, indent=1, allow_nan=False) + "\n").encode()
