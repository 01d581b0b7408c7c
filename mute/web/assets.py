"""The files that the page needs of Python, as plain data: scenes, the policy, floors and limits.

What the page walks in is what is heard in Python, `listening_cfg`: physics at 1 ms, forces at the
feet, elliptic cones, so that there is one physics for eye and ear. The policy is the ONNX file of
`mute.export`, which the page reads itself.
"""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

from mute.acoustics.audible_env import listening_cfg
from mute.acoustics.floors import FLOORS
from mute.controllers.command import COMMAND_LIMITS, Command
from mute.controllers.learned import Policy
from mute.controllers.onnx_export import export_policy
from mute.envs.quadruped_env import scene_of
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.scene import FOOT_RADIUS, JOINT_NAMES, LEGS, SceneCfg
from mute.envs.simulation import MAX_SPEED
from mute.envs.terrain.figures import FIGURES, TREAD
from mute.envs.terrain.kinds import Stairs
from mute.envs.terrain.layout import DEPTH, HALF_WIDTH, WIDE
from mute.evaluation.trials import evaluation_cfg, from_the_stance
from mute.support.files import write_file
from mute.web.scene_text import scene_text
from mute.web.sound_tables import packed, sound_tables

__all__ = ["FORMAT", "write_assets"]

FORMAT = 1
"""Version of the layout of `page.json`; the page refuses any other."""

_SURFACE = "wood"
"""Floor that the page begins with."""


def write_assets(policy: Policy, out: Path) -> list[Path]:
    """Write all files into a directory, which is made if need be, and return them.

    - `flat.xml`, `stairs.xml`: the scenes, see `scene_text`;
    - `TASK.onnx`: the policy, see `mute.controllers.onnx_export.export_policy`;
    - `page.json`: all else that the simulation needs, see `page_data`;
    - `sound.json`, `sound.bin`: see `mute.web.sound_tables`.

    Raises:
        MuteError: If a file cannot be written.
        ValueError: If the policy acts at times between the physics steps of sound.
    """
    cfg = walking_cfg(policy.cfg.env, _SURFACE, 1.0)
    out.mkdir(parents=True, exist_ok=True)
    policy_file = out / f"{policy.task}.onnx"
    export_policy(policy, policy_file)
    written = {
        "flat.xml": scene_text(scene_of(cfg)).encode(),
        "stairs.xml": scene_text(_with_boxes(scene_of(cfg))).encode(),
        "page.json": _json(page_data(policy, cfg)),
    }
    sound_json, sound_binary = packed(sound_tables())
    written |= {"sound.json": sound_json.encode(), "sound.bin": sound_binary}
    for name, data in written.items():
        write_file(out / name, data)
    return [policy_file, *(out / name for name in written)]


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


def page_data(policy: Policy, cfg: QuadrupedEnvCfg) -> dict[str, Any]:
    """Return what `page.json` holds. Lengths in m, times in s, angles in rad.

    Args:
        policy: The policy that ships.
        cfg: What it walks in, see `walking_cfg`.
    """
    speeds = policy.cfg.env.commands
    return {
        "format": FORMAT,
        "controllers": [
            {"name": policy.task, "label": "MUTE", "file": f"{policy.task}.onnx"},
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
        "footfall": dataclasses.asdict(cfg.footfall),
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
