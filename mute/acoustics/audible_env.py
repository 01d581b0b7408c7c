"""Configurations of environments that can be heard.

`listening_cfg` is for measuring: a real floor, with forces at the feet, at 1 ms steps.
`audible_cfg` is for watching a walk: the same if a floor is named, else the walk as it is, heard if
its own steps allow it. What does the hearing is a `Listener`.
"""

from __future__ import annotations

import dataclasses

from mute.acoustics.floors import FLOORS
from mute.acoustics.metering.levels import READINGS_PER_SECOND
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.scene import FloorPatch

__all__ = ["TIMESTEP", "audible_cfg", "listening_cfg", "make_listening_env"]

TIMESTEP = 0.001
"""Physics step where sound is measured, s."""


def listening_cfg(
    cfg: QuadrupedEnvCfg, surface: str | None = None, patches: tuple[FloorPatch, ...] = ()
) -> QuadrupedEnvCfg:
    """Return an environment in which every physics step can be heard.

    The control rate stays; the physics runs at `TIMESTEP`, forces at the feet are measured,
    friction tells sliding from sticking (elliptic cones), and the floor has the contact parameters
    of a real one.

    Args:
        cfg: The environment, as `evaluation_cfg` returns it.
        surface: Name of the floor everywhere; None leaves the one there is.
        patches: Floors side by side, in place of one.

    Raises:
        ValueError: If the floor is not known, or the control period no multiple of the step.
    """
    decimation = round(cfg.step_dt / TIMESTEP)
    if abs(decimation * TIMESTEP - cfg.step_dt) > 1e-9:
        raise ValueError(
            f"the control period must be a multiple of {TIMESTEP:g} s, got {cfg.step_dt:g}"
        )
    scene = dataclasses.replace(
        cfg.scene, timestep=TIMESTEP, foot_forces=True, cone="elliptic", floor_patches=patches
    )
    if surface is not None:
        if surface not in FLOORS:
            raise ValueError(f"surface must be one of {', '.join(FLOORS)}, got {surface!r}")
        floor = FLOORS[surface]
        scene = dataclasses.replace(scene, floor_friction=floor.friction, floor_solref=floor.solref)
    return dataclasses.replace(cfg, scene=scene, decimation=decimation)


def audible_cfg(cfg: QuadrupedEnvCfg, surface: str | None) -> QuadrupedEnvCfg:
    """Return an environment that can be heard as it walks.

    Args:
        cfg: The environment, as `evaluation_cfg` returns it.
        surface: Name of the floor to walk on, at the steps of `listening_cfg`; None leaves floor
            and physics as they are, where nothing scuffs, and silent where no meter can read at
            their steps.

    Raises:
        ValueError: If the floor is not known, or does not go with the control period.
    """
    if surface is not None:
        return listening_cfg(cfg, surface)
    rate = round(1.0 / cfg.scene.timestep)
    readable = rate >= READINGS_PER_SECOND and abs(rate * cfg.scene.timestep - 1.0) < 1e-6
    forces = readable or cfg.scene.foot_forces  # a reward may ask for them
    return dataclasses.replace(cfg, scene=dataclasses.replace(cfg.scene, foot_forces=forces))


def make_listening_env(cfg: QuadrupedEnvCfg, surface: str) -> QuadrupedEnv:
    """Return the environment on a floor, see `listening_cfg`."""
    return QuadrupedEnv(listening_cfg(cfg, surface))
