"""A batch of MuJoCo simulations behind a small protocol.

The environment talks to `Simulation` alone, so that an engine can be exchanged without touching a
reward or an observation. `BatchSimulation` is the CPU engine, on `mjbatch`; the GPU engine has a
module of its own, `envs.warp_simulation`. What a robot is, when it is reset and to which state is
the environment's business.
"""

from __future__ import annotations

from typing import Literal, Protocol

import mujoco
import numpy as np
import torch
from mjbatch import Batch

__all__ = ["MAX_SPEED", "BatchSimulation", "Engine", "Simulation", "make_simulation"]

Engine = Literal["auto", "mjbatch", "warp"]
"""MuJoCo on the CPU's threads, MuJoCo Warp, or the one that suits the device."""

_BAD_STATE = [
    int(warning)
    for warning in (
        mujoco.mjtWarning.mjWARN_BADQPOS,
        mujoco.mjtWarning.mjWARN_BADQVEL,
        mujoco.mjtWarning.mjWARN_BADQACC,
    )
]

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
    """Past readings of the sensors that keep them, see `sensors.sensor_history`: rings, which begin
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


class BatchSimulation:
    """MuJoCo on a CPU thread pool (`mjbatch`), see `Simulation`.

    Physics runs in float64; the tensors are float32 and share the engine's own buffers.
    """

    def __init__(self, model: mujoco.MjModel, num_envs: int, num_threads: int = 0) -> None:
        """Allocate the simulations.

        Args:
            model: The compiled model; it is copied.
            num_envs: Number of simulations.
            num_threads: Size of the thread pool; 0 takes every logical CPU.
        """
        self.model = model
        self.num_envs = num_envs
        self.device = torch.device("cpu")
        self._batch = Batch(model, num_envs, num_threads)
        self.qpos = self._bind("qpos")
        self.qvel = self._bind("qvel")
        self.ctrl = self._bind("ctrl")
        self.sensordata = self._bind("sensordata")
        self.actuator_force = self._bind("actuator_force")
        self.history = (
            self._bind("history")
            if model.nhistory
            else torch.zeros(num_envs, 0, device=self.device)
        )
        self._state = self._batch.bind("state")
        self._time = self._batch.bind("time")
        self._warnings = torch.from_numpy(self._batch.bind("warning"))
        self._fields: dict[str, torch.Tensor] = {}
        self._failed = np.zeros(num_envs, dtype=bool)

    def step(self, num_steps: int = 1) -> None:
        """Advance every simulation by a number of physics steps."""
        before = self._time.copy()
        try:
            self._batch.step(nstep=num_steps)
        except RuntimeError:
            # An engine error (an exhausted arena, say) leaves the failing simulations where they
            # were and steps all others: a clock that stood still tells which they are.
            self._failed |= self._time == before

    def forward(self, mask: torch.Tensor | None = None) -> None:
        """Recompute everything that follows from the state. Mask shape: (num_envs,)."""
        self._batch.forward(None if mask is None else mask.numpy())

    def reset(self, mask: torch.Tensor, keyframe: int = 0) -> None:
        """Put the masked simulations to a keyframe. Mask shape: (num_envs,)."""
        self._batch.reset(mask.numpy(), keyframe=keyframe)
        self._failed &= ~mask.numpy()

    def unstable(self) -> torch.Tensor:
        """Return which simulations blew up since their last reset. Shape: (num_envs,)."""
        warned = (self._warnings[:, _BAD_STATE, 1] > 0).any(dim=1)
        # Negated, so that NaN counts as too fast.
        too_fast = ~(self.qvel.abs().amax(dim=1) < MAX_SPEED)
        return warned | too_fast | torch.from_numpy(self._failed)

    def field(self, name: str) -> torch.Tensor:
        """Return a model field per simulation, to be written. Shape: (num_envs, ...)."""
        if name not in self._fields:
            self._fields[name] = torch.from_numpy(self._batch.expand(name))
        return self._fields[name]

    def set_const(self) -> None:
        """Recompute the constants that depend on model fields, after writing these."""
        self._batch.set_const()

    def state_dict(self) -> dict[str, torch.Tensor]:
        """Return all that is needed to continue bit for bit."""
        state = {f"field/{name}": value.clone() for name, value in self._fields.items()}
        state["integration"] = torch.from_numpy(self._state.copy())
        # A push written since the last step reaches the engine's own state in the next one only.
        state["qpos"], state["qvel"] = self.qpos.clone(), self.qvel.clone()
        return state

    def load_state_dict(self, state: dict[str, torch.Tensor]) -> None:
        """Continue from a `state_dict`.

        Raises:
            ValueError: If the state belongs to another engine, another model or another number of
                simulations.
        """
        if "integration" not in state:
            raise ValueError(
                "simulation state is not of the engine 'mjbatch': go on with the engine and the"
                " device that it was saved with"
            )
        integration = state["integration"].numpy()
        if integration.shape != self._state.shape:
            raise ValueError(
                f"simulation state has shape {integration.shape}, this model and num_envs need "
                f"{self._state.shape}"
            )
        for key, value in state.items():
            if key.startswith("field/"):
                self.field(key.removeprefix("field/")).copy_(value)
        self.set_const()
        self._state[:] = integration
        self._batch.forward()
        # The solver's warm start is part of the state, and `forward` has just moved it.
        self._state[:] = integration
        self.qpos.copy_(state["qpos"])
        self.qvel.copy_(state["qvel"])
        self._failed[:] = False

    def _bind(self, name: str) -> torch.Tensor:
        return torch.from_numpy(self._batch.bind(name, np.float32))


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
        device: Device that `engine` is to run on; `mjbatch` runs on the CPU, whatever it is.
        num_threads: Size of the thread pool of `mjbatch`; 0 takes every logical CPU.
        engine: The engine; `auto` is `mjbatch` on the CPU and `warp` elsewhere.

    Raises:
        ValueError: If the engine is not installed, or there is no such device.
    """
    if engine == "mjbatch" or (engine == "auto" and torch.device(device).type == "cpu"):
        return BatchSimulation(model, num_envs, num_threads)
    from .warp_simulation import WarpSimulation  # leaves Warp out where nobody asks for it

    return WarpSimulation(model, num_envs, device)
