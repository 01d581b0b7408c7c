"""MuJoCo on the CPU behind the protocol of `envs.simulation`: `mjbatch`, a pool of threads."""

from __future__ import annotations

import mujoco
import numpy as np
import torch
from mjbatch import Batch

from .simulation import MAX_SPEED

__all__ = ["BatchSimulation"]

_BAD_STATE = [
    int(warning)
    for warning in (
        mujoco.mjtWarning.mjWARN_BADQPOS,
        mujoco.mjtWarning.mjWARN_BADQVEL,
        mujoco.mjtWarning.mjWARN_BADQACC,
    )
]


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
        self._warnings.zero_()  # of a past that is not this state's
        self._state[:] = integration
        self._batch.forward()
        # The solver's warm start is part of the state, and `forward` has just moved it.
        self._state[:] = integration
        self.qpos.copy_(state["qpos"])
        self.qvel.copy_(state["qvel"])
        self._failed[:] = False

    def _bind(self, name: str) -> torch.Tensor:
        return torch.from_numpy(self._batch.bind(name, np.float32))
