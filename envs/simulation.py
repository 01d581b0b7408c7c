"""What the environment asks of a batch of MuJoCo simulations.

The environment talks to `Simulation` alone, so that an engine can be exchanged without touching a
reward or an observation. The engines are `envs.batch_simulation` on the CPU and
`envs.warp_simulation` on a GPU, and `envs.engines` makes the one that is asked for. What a robot
is, when it is reset and to which state is the environment's business.
"""

from __future__ import annotations

from typing import Literal, Protocol

import mujoco
import torch

__all__ = ["MAX_SPEED", "Engine", "Simulation"]

Engine = Literal["auto", "mjbatch", "warp"]
"""MuJoCo on the CPU's threads, MuJoCo Warp, or the one that suits the device."""

MAX_SPEED = 200.0
"""Largest generalised speed (m/s or rad/s) of a simulation that still counts as stable: over six
times the fastest joint. Far below MuJoCo's own limit (1e10), whose rewards would poison a batch."""


class Simulation(Protocol):
    """A batch of independent simulations of one model.

    The tensors are live: they are written by `step`, `reset` and `forward`, and what is written
    into `qpos`, `qvel` and `ctrl` takes effect at the next of these calls. `sensordata` and
    `actuator_force` lag `qpos` and `qvel` by one physics step after `step`, as MuJoCo's own do
    after `mj_step`, and are current after `reset` and `forward`.
    """

    model: mujoco.MjModel
    """The model that all simulations share, before per-simulation fields."""
    num_envs: int
    """Number of simulations."""
    device: torch.device
    """Device of every tensor."""
    qpos: torch.Tensor
    """Generalised positions. Shape: (num_envs, nq)."""
    qvel: torch.Tensor
    """Generalised velocities. Shape: (num_envs, nv)."""
    ctrl: torch.Tensor
    """Actuator set points. Shape: (num_envs, nu)."""
    sensordata: torch.Tensor
    """Sensor readings. Shape: (num_envs, nsensordata)."""
    actuator_force: torch.Tensor
    """Actuator forces, N or N m. Shape: (num_envs, nu)."""
    history: torch.Tensor
    """Past readings of the sensors that keep them, see `sensors.past_readings`: rings, which begin
    with the oldest reading after as many steps as they hold. Shape: (num_envs, nhistory)."""

    def step(self, num_steps: int = 1) -> None:
        """Advance every simulation by a number of physics steps."""
        ...

    def forward(self, mask: torch.Tensor | None = None) -> None:
        """Recompute everything that follows from the state. Mask shape: (num_envs,)."""
        ...

    def reset(self, mask: torch.Tensor, keyframe: int = 0) -> None:
        """Put the masked simulations to a keyframe. Mask shape: (num_envs,)."""
        ...

    def unstable(self) -> torch.Tensor:
        """Return which simulations blew up since their last reset. Shape: (num_envs,)."""
        ...

    def field(self, name: str) -> torch.Tensor:
        """Return a model field per simulation, to be written. Shape: (num_envs, ...)."""
        ...

    def set_const(self) -> None:
        """Recompute the constants that depend on model fields, after writing these."""
        ...

    def state_dict(self) -> dict[str, torch.Tensor]:
        """Return all that is needed to continue bit for bit."""
        ...

    def load_state_dict(self, state: dict[str, torch.Tensor]) -> None:
        """Continue from a `state_dict`."""
        ...
