"""How true a physics step is: landings, forces and work of a walk, to compare with finer steps."""

from __future__ import annotations

import dataclasses

import torch

from mute.controllers.driver import Driver
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.randomization import RandomizationCfg
from mute.envs.scene import LEGS
from mute.envs.sensors import sensor_slice
from mute.evaluation.trials import run_trial

__all__ = ["REFERENCE", "as_modelled", "walk_figures"]

REFERENCE = 0.0005
"""Physics step that stands for the truth, s."""

_SPEED = 0.5
"""Commanded speed, m/s."""

_SETTLE = 1.0
"""Time from the start that no force or work is taken of, s."""

_WINDOW = 0.5
"""Time in which every foot lands, s."""


def walk_figures(policy: Driver, cfg: QuadrupedEnvCfg, beta: float) -> dict[str, float]:
    """Return what a policy's walk is like at the physics steps.

    Args:
        policy: The policy that walks.
        cfg: Its environment, as `evaluation_cfg` returns it; episodes are as long as the walk and
            a control step.
        beta: Quiet factor.

    Returns:
        `landing_speed` (RMS, m/s), `force_rms` (vertical contact force of a foot, N), `peak_force`
        (mean over feet and windows of half a second, N) and `work` (mean mechanical power, W).

    Raises:
        RuntimeError: If a simulation blew up.
    """
    env = QuadrupedEnv(
        dataclasses.replace(cfg, scene=dataclasses.replace(cfg.scene, foot_forces=True))
    )
    columns = sensor_slice(env.model, f"{LEGS[0]}_foot_force", len(LEGS))
    forces, power = [], []
    env.simulation.record("qvel", "actuator_force")

    def record() -> None:
        steps = {name: rows.transpose(0, 1) for name, rows in env.simulation.substeps.items()}
        forces.append(steps["sensordata"][:, :, columns].unflatten(2, (4, 3))[..., 2].abs())
        power.append((steps["actuator_force"] * steps["qvel"][:, :, 6:]).abs().sum(dim=2).mean(1))

    env.physics_listeners.append(record)
    command = torch.tensor([_SPEED, 0.0, 0.0, beta])
    steps = round(cfg.episode_length / env.step_dt) - 1
    gait = run_trial(env, policy.controller(cfg), command, steps).gait()
    if gait.unstable:
        raise RuntimeError(f"{gait.unstable} simulations blew up: their steps are no walk's")
    first, window = (round(time / cfg.scene.timestep) for time in (_SETTLE, _WINDOW))
    force = torch.cat(forces)[first:]
    windows = force[: len(force) // window * window].unflatten(0, (-1, window))
    return {
        "landing_speed": gait.landing_speed_rms,
        "force_rms": float(force.square().mean().sqrt()),
        "peak_force": float(windows.amax(dim=1).mean()),
        "work": float(torch.cat(power)[first:].mean()),
    }


def as_modelled() -> RandomizationCfg:
    """Return a randomisation that draws nothing: the robot as its model has it, and no pushes.

    Dry friction is the one figure that the model has joint by joint; whoever uses this sets it.
    """
    return RandomizationCfg(
        friction_factor=(1.0, 1.0),
        added_mass=(0.0, 0.0),
        com_offset=(0.0, 0.0),
        gain_scale=(1.0, 1.0),
        push_interval=0.0,
    )
