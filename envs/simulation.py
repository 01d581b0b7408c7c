"""What the environment asks of a batch of MuJoCo simulations.

The environment talks to `Simulation` alone, so that an engine can be exchanged without touching a
reward or an observation. The engines are `envs.batch_simulation` on the CPU and
`envs.warp_simulation` on a GPU, and `envs.engines` makes the one that is asked for. What a robot
is, when it is reset and to which state is the environment's business.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, Protocol

import mujoco
import torch

__all__ = ["MAX_SPEED", "Engine", "Simulation", "Stage"]

Engine = Literal["auto", "mujoco", "warp"]
"""MuJoCo on the CPU's threads, MuJoCo Warp, or the one that suits the device."""

Stage = Literal["positions", "all"]
"""How far `forward` goes: to what follows from positions alone, or to everything."""

MAX_SPEED = 200.0
"""Largest generalised speed (m/s or rad/s) of a simulation that still counts as stable: over six
times the fastest joint. Far below MuJoCo's own limit (1e10), whose rewards would poison a batch."""


class Simulation(Protocol):
    """A batch of independent simulations of one model.

    The tensors are live: they are written by `step`, `reset` and `forward`, and what is written
    into `qpos`, `qvel` and `ctrl` takes effect at the next of these calls. `sensordata` and
    `actuator_force` lag `qpos` and `qvel` by one physics step after `step`, as MuJoCo's own do
    after `mj_step`, are current after `forward`, and mean nothing between `reset` and `forward`.
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

    @property
    def substeps(self) -> Mapping[str, torch.Tensor]:
        """What each physics step of the last `step` left in the arrays that are recorded, by name.

        They are in the engine's own precision. A simulation that stopped on the way repeats its
        last. `sensordata` and `actuator_force` lag here as well. Shape of each:
        (num_envs, num_steps, ...).
        """
        ...

    def record(self, *names: str) -> None:
        """Keep in `substeps`, from the next `step` on, what arrays hold in its physics steps.

        Args:
            names: Some of the tensors above; those that were recorded before still are, as long
                as the simulations live.
        """
        ...

    def step(self, num_steps: int = 1, ctrl: torch.Tensor | None = None) -> None:
        """Advance every simulation by a number of physics steps.

        Args:
            num_steps: How many.
            ctrl: Set points for each of them, in place of the ones that hold.
                Shape: (num_envs, num_steps, nu).
        """
        ...

    def forward(self, mask: torch.Tensor | None = None, stage: Stage = "all") -> None:
        """Recompute what follows from the state.

        Args:
            mask: Simulations to do that for; None for all. Shape: (num_envs,).
            stage: How far to go. After `positions` the sensors of positions are current; all other
                readings of these simulations mean nothing.
        """
        ...

    def reset(self, mask: torch.Tensor, keyframe: int = 0) -> None:
        """Put the masked simulations to a keyframe; `forward` then tells what follows from it.

        Args:
            mask: Simulations to reset. Shape: (num_envs,).
            keyframe: Number of the keyframe in the model.
        """
        ...

    def unstable(self) -> torch.Tensor:
        """Return which simulations blew up since their last reset. Shape: (num_envs,)."""
        ...

    def field(self, name: str) -> torch.Tensor:
        """Return a model field per simulation, to be written. Shape: (num_envs, ...)."""
        ...

    def read_field(self, name: str) -> torch.Tensor:
        """Return a model field of every simulation, to be read. Shape: (num_envs, ...).

        Unlike `field`, it leaves simulations that share the model's as they are.
        """
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
