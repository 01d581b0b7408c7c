"""The choice between the engines that stand behind `envs.simulation`."""

from __future__ import annotations

import mujoco
import torch

from mute.support.threads import core_share

from .batch_simulation import BatchSimulation
from .simulation import Engine, Simulation
from .warp_simulation import WarpSimulation

__all__ = ["make_simulation"]


def make_simulation(
    model: mujoco.MjModel,
    num_envs: int,
    device: str = "cpu",
    num_threads: int = 0,
    engine: Engine = "auto",
) -> Simulation:
    """Return a batch of simulations.

    Args:
        model: The compiled model.
        num_envs: Number of simulations.
        device: Device that `engine` is to run on; `mujoco` runs on the CPU, whatever it is.
        num_threads: Size of the thread pool of `mujoco`; 0 takes every processor that this process
            may use, but no more than there are simulations.
        engine: The engine; `auto` is `mujoco` on the CPU and `warp` elsewhere.

    Raises:
        ValueError: If the engine is not installed, or there is no such device.
    """
    if engine == "mujoco" or (engine == "auto" and torch.device(device).type == "cpu"):
        return BatchSimulation(model, num_envs, num_threads or min(core_share(), num_envs))
    return WarpSimulation(model, num_envs, device)
