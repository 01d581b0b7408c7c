"""MuJoCo on the CPU behind the protocol of `envs.simulation`: `mujoco.batch`, a pool of threads."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from contextlib import contextmanager

import mujoco
import numpy as np
import torch
from mujoco.batch import Batch, SimulationError

from .engine_version import check_version, version_entry
from .model_fields import load_fields, saved_fields
from .scene import GROUND_BOX
from .simulation import MAX_SPEED, Stage

__all__ = ["BatchSimulation", "as_stepped"]

_WRITTEN = ("qpos", "qvel", "ctrl")
"""Arrays that the environment may write, parts of the engine's state."""

_READ = ("sensordata", "actuator_force")
"""Arrays that follow from the state."""

_CTRL = int(mujoco.mjtState.mjSTATE_CTRL)

_MANY_SHAPES = 8
"""Shapes of a body from which on it may pay to look first which of them are near."""

_STAGES: dict[Stage, int] = {
    "positions": int(mujoco.mjtStage.mjSTAGE_POS),
    "all": int(mujoco.mjtStage.mjSTAGE_ACC),
}


class BatchSimulation:
    """MuJoCo on a CPU thread pool (`mujoco.batch.Batch`), see `Simulation`.

    Physics runs in float64 and its state stays so; the tensors are copies in float32. Before every
    call what has been changed in them reaches the state, and nothing else does: a robot that nobody
    touched keeps its state to the last bit.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        num_envs: int,
        num_threads: int = 1,
        trees: bool | None = None,
    ) -> None:
        """Allocate the simulations.

        Args:
            model: The compiled model; it is copied.
            num_envs: Number of simulations.
            num_threads: Size of the thread pool, 1 or more.
            trees: See `as_stepped`.
        """
        self.model = as_stepped(model, trees)
        self.num_envs = num_envs
        self.device = torch.device("cpu")
        self.substeps: dict[str, torch.Tensor] = {}
        self._batch = Batch(self.model, num_envs, num_threads)
        self._own = {name: self._batch.bind(name) for name in (*_WRITTEN, *_READ)}
        self._shown = {name: own.astype(np.float32) for name, own in self._own.items()}
        self._seen = {name: self._shown[name].copy() for name in _WRITTEN}
        self.qpos = torch.from_numpy(self._shown["qpos"])
        self.qvel = torch.from_numpy(self._shown["qvel"])
        self.ctrl = torch.from_numpy(self._shown["ctrl"])
        self.sensordata = torch.from_numpy(self._shown["sensordata"])
        self.actuator_force = torch.from_numpy(self._shown["actuator_force"])
        self._state = self._batch.state
        self._warnings = torch.from_numpy(self._batch.warning)
        self._fields: dict[str, torch.Tensor] = {}
        self._recorded: tuple[str, ...] = ()
        self._records: dict[str, np.ndarray] = {}
        self._failed = np.zeros(num_envs, dtype=bool)
        self._past = self._batch.bind("history") if self.model.nhistory else None
        self._past_ctrl = _past_ctrl(self.model)

    def record(self, *names: str) -> None:
        """Keep in `substeps`, from the next `step` on, what arrays hold in its physics steps."""
        self._recorded = tuple(dict.fromkeys((*self._recorded, *names)))
        self._records = {}

    def step(self, num_steps: int = 1, ctrl: torch.Tensor | None = None) -> None:
        """Advance every simulation by a number of physics steps, see `Simulation.step`."""
        self._make_room(num_steps)
        with self._calling():
            # Unlike `Batch.step`, a rollout ends for a simulation that MuJoCo warns of.
            try:
                self._batch.rollout(
                    num_steps,
                    None if ctrl is None else ctrl.double().numpy(),
                    _CTRL,
                    record=self._recorded,
                    out=self._records,
                )
            except SimulationError as error:
                for name, rows in self._records.items():
                    rows[error.ids] = self._batch.bind(name)[error.ids, np.newaxis]
                raise

    def forward(self, mask: torch.Tensor | None = None, stage: Stage = "all") -> None:
        """Recompute what follows from the state. Mask shape: (num_envs,)."""
        with self._calling():
            self._batch.forward(_ids(mask), _STAGES[stage])

    def reset(self, mask: torch.Tensor, keyframe: int = 0) -> None:
        """Put the masked simulations to a keyframe. Mask shape: (num_envs,)."""
        ids = _ids(mask)
        with self._calling():
            self._batch.reset(ids, keyframe, stage=int(mujoco.mjtStage.mjSTAGE_NONE))
            if self._past is not None:  # else delayed motors would first be asked for 0
                ctrl = np.repeat(self.model.key_ctrl[keyframe], self._past_ctrl.shape[1])
                self._past[np.ix_(np.arange(self.num_envs)[ids], self._past_ctrl.ravel())] = ctrl
        self._failed[ids] = False

    def unstable(self) -> torch.Tensor:
        """Return which simulations blew up since their last reset. Shape: (num_envs,)."""
        # Of whatever kind, a warning means that numbers were bad or contacts were lost.
        warned = (self._warnings[:, :, 1] > 0).any(dim=1)
        # Negated, so that NaN counts as too fast.
        too_fast = ~(self.qvel.abs().amax(dim=1) < MAX_SPEED)
        return warned | too_fast | torch.from_numpy(self._failed)

    def field(self, name: str) -> torch.Tensor:
        """Return a model field per simulation, to be written. Shape: (num_envs, ...)."""
        if name not in self._fields:
            self._fields[name] = torch.from_numpy(self._batch.expand(name))
        return self._fields[name]

    def read_field(self, name: str) -> torch.Tensor:
        """Return a model field of every simulation, to be read. Shape: (num_envs, ...)."""
        if name in self._fields:
            return self._fields[name]
        value = torch.from_numpy(getattr(self.model, name).copy()).to(self.device)
        return value.expand(self.num_envs, *value.shape)

    def set_const(self) -> None:
        """Recompute the constants that depend on model fields, after writing these."""
        self._batch.set_const()

    def state_dict(self) -> dict[str, torch.Tensor]:
        """Return all that is needed to continue bit for bit."""
        state = saved_fields(self._fields) | version_entry(self.device)
        state["integration"] = torch.from_numpy(self._state.copy())
        # What was written since the last call reaches the engine's own state in the next one only.
        return state | {name: torch.from_numpy(self._shown[name].copy()) for name in _WRITTEN}

    def load_state_dict(self, state: dict[str, torch.Tensor]) -> None:
        """Continue from a `state_dict`.

        Raises:
            ValueError: If the state belongs to another engine or version of MuJoCo, another model
                or another number of simulations.
        """
        if "integration" not in state:
            raise ValueError(
                "simulation state is not of the engine 'mujoco': go on with the engine and the"
                " device that it was saved with"
            )
        check_version(state)
        integration = state["integration"].numpy()
        if integration.shape != self._state.shape:
            raise ValueError(
                f"simulation state has shape {integration.shape}, this model and num_envs need "
                f"{self._state.shape}"
            )
        load_fields(self, state)
        self.set_const()
        self._warnings.zero_()  # of a past that is not this state's
        self._failed[:] = False
        self._state[:] = integration
        self._show()  # nothing that was written before goes on top
        self.forward()
        # The solver's warm start is part of the state, and `forward` has just moved it.
        self._state[:] = integration
        for name in _WRITTEN:
            np.copyto(self._shown[name], state[name].numpy())

    @contextmanager
    def _calling(self) -> Iterator[None]:
        """Let a call of the engine see what has been written, and show what it made of that."""
        for name, seen in self._seen.items():
            written = self._shown[name] != seen
            if written.any():
                self._own[name][written] = self._shown[name][written]
        try:
            yield
        except SimulationError as error:
            # An engine error (an exhausted arena, say) leaves the failing simulations where they
            # were; all others have done what they were to do.
            self._failed[error.ids] = True
        self._show()

    def _show(self) -> None:
        for name, own in self._own.items():
            np.copyto(self._shown[name], own, casting="same_kind")
        for name, seen in self._seen.items():
            np.copyto(seen, self._shown[name])

    def _make_room(self, num_steps: int) -> None:
        """Allocate the arrays that `rollout` records into, unless they are there."""
        if not self._recorded or (
            self._records and next(iter(self._records.values())).shape[1] == num_steps
        ):
            return
        # State components bind as parts of wider rows, so widths alone are taken from them.
        self._records = {
            name: np.zeros((self.num_envs, num_steps, *self._batch.bind(name).shape[1:]))
            for name in self._recorded
        }
        self.substeps = {name: torch.from_numpy(rows) for name, rows in self._records.items()}


def as_stepped(model: mujoco.MjModel, trees: bool | None = None) -> mujoco.MjModel:
    """Return a model as it is stepped on the CPU: mostly without trees of boxes around shapes.

    A limb has one or two shapes, and a floor often one. To test them all is quicker then, and the
    contacts are the same. MuJoCo Warp has no such trees, and refuses the flag.

    Args:
        model: The compiled model.
        trees: Whether to have them; None where a body has many shapes, unless these are laid anew
            all the time, of which a tree knows nothing.

    Returns:
        The model itself, or a copy that differs in that.
    """
    if trees is None:
        moved = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, GROUND_BOX.format(0)) >= 0
        trees = not moved and bool(model.body_geomnum.max() > _MANY_SHAPES)
    if trees:
        return model
    model = copy.copy(model)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE)
    return model


def _past_ctrl(model: mujoco.MjModel) -> np.ndarray:
    """Return where a simulation's history holds the past set points of each motor.

    Of each motor that is delayed it has a time, where it writes next, the times of its samples,
    and these. Shape: (motors, samples).
    """
    samples = int(model.actuator_history[0, 0]) if model.nhistory else 0
    first = model.actuator_historyadr.reshape(-1, 1) + 2 + samples
    return first + np.arange(samples)


def _ids(mask: torch.Tensor | None) -> np.ndarray | None:
    return None if mask is None else np.flatnonzero(mask.numpy())
