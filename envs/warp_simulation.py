"""MuJoCo Warp behind the protocol of `envs.simulation`: the same model, on a GPU.

A physics step, a forward pass and a reset are graphs of kernels, captured after their first use and
replayed from then on. torch reads and writes the engine's own arrays, so a control step copies
nothing between device and host. Warp replays graphs on the CPU as well, and that is how the tests
hold this engine to MuJoCo itself; on a GPU it has not been run.

Warp compiles kernels at their first use and keeps them in a cache of its own (`WARP_CACHE_PATH`).
"""

from __future__ import annotations

import contextlib
import importlib
from collections.abc import Callable, Iterator
from typing import Any

import mujoco
import numpy as np
import torch

from .engine_version import check_version, version_entry
from .model_fields import load_fields, saved_fields
from .scene import GROUND_BOX
from .simulation import MAX_SPEED, Stage

__all__ = ["WarpSimulation"]

_STATE = (
    "qpos",
    "qvel",
    "ctrl",
    "qacc_warmstart",
    "time",
    "sensordata",
    "actuator_force",
    "overflow",
)
"""Arrays from which everything else follows, and readings that are older than they."""

_FORWARDED = ("sensordata", "actuator_force", "overflow")
"""Those of them that a forward pass may write."""

_DERIVED = ("body_subtreemass", "body_invweight0", "dof_invweight0")
"""Model fields that follow from the masses, and differ between simulations when these do."""


class WarpSimulation:
    """MuJoCo Warp, see `Simulation`.

    Physics runs in float32. A simulation that blows up stays as it is until it is reset. On a GPU
    contacts are found in no fixed order, so that there, unlike on the CPU, no run repeats another
    bit for bit.
    """

    def __init__(self, model: mujoco.MjModel, num_envs: int, device: str = "cpu") -> None:
        """Allocate the simulations.

        Args:
            model: The compiled model.
            num_envs: Number of simulations.
            device: "cpu", "cuda" or "cuda:N".

        Raises:
            ValueError: If MuJoCo Warp is not installed, there is no such device, or the model has
                what this engine has not: ground laid anew, or motors that are late.
        """
        _check_model(model)
        self._warp, self._engine = _load_packages()
        self.model = model
        self.num_envs = num_envs
        self.device = _existing_device(device, self._warp)
        with self._on_torch_stream():
            self._model = self._engine.put_model(model)
            self._set_options()
            contacts, rows = _capacity(model, self._model.nxn_geom_pair_filtered.numpy())
            self._data = self._engine.make_data(
                model, nworld=num_envs, nconmax=contacts, njmax=rows
            )
            self._keyframes = self._warp.zeros(num_envs, dtype=int)
        self._state = {name: self._view(getattr(self._data, name)) for name in _STATE}
        self.qpos = self._state["qpos"]
        self.qvel = self._state["qvel"]
        self.ctrl = self._state["ctrl"]
        self.sensordata = self._state["sensordata"]
        self.actuator_force = self._state["actuator_force"]
        self.substeps: dict[str, torch.Tensor] = {}
        self._recorded: tuple[str, ...] = ()
        self._fields: dict[str, torch.Tensor] = {}
        self._graphs: dict[Callable[..., None], Any] = {}
        overflow = self._engine.OverflowType
        # MuJoCo stops its solver at these limits, too; all others lose contacts or constraints.
        self._harmless = int(overflow.ITERATIONS | overflow.LS_ITERATIONS)

    def record(self, *names: str) -> None:
        """Keep in `substeps`, from the next `step` on, what arrays hold in its physics steps."""
        self._recorded = tuple(dict.fromkeys((*self._recorded, *names)))
        self.substeps = {}

    def step(self, num_steps: int = 1, ctrl: torch.Tensor | None = None) -> None:
        """Advance every simulation by a number of physics steps, see `Simulation.step`."""
        self._make_room(num_steps)
        for index in range(num_steps):
            if ctrl is not None:
                self.ctrl.copy_(ctrl[:, index])
            self._run(self._engine.step)
            for name, rows in self.substeps.items():
                rows[:, index] = self._state[name]

    def forward(self, mask: torch.Tensor | None = None, stage: Stage = "all") -> None:
        """Recompute what follows from the state, at any stage all of it. Mask: (num_envs,)."""
        if mask is None:
            self._run(self._engine.forward)
            return
        before = {name: self._state[name].clone() for name in _FORWARDED}
        self._run(self._engine.forward)
        for name, old in before.items():
            own = self._state[name]
            inside = mask if own.ndim == 1 else mask.unsqueeze(1)
            torch.where(inside, own, old, out=own)

    def reset(self, mask: torch.Tensor, keyframe: int = 0) -> None:
        """Put the masked simulations to a keyframe. Mask shape: (num_envs,)."""
        # A keyframe that does not exist leaves a simulation as it is.
        self._view(self._keyframes).copy_(torch.where(mask, keyframe, -1))
        self._run(self._engine.reset_data_keyframe, self._keyframes)

    def unstable(self) -> torch.Tensor:
        """Return which simulations blew up since their last reset. Shape: (num_envs,)."""
        # Negated, so that NaN counts as too far and too fast.
        too_far = ~(self.qpos.abs().amax(dim=1) < mujoco.mjMAXVAL)
        too_fast = ~(self.qvel.abs().amax(dim=1) < MAX_SPEED)
        lost = (self._state["overflow"] & ~self._harmless) != 0
        return too_far | too_fast | lost

    def field(self, name: str) -> torch.Tensor:
        """Return a model field per simulation, to be written. Shape: (num_envs, ...)."""
        if name not in self._fields:
            self._expand(name)
            self._fields[name] = self._view(getattr(self._model, name))
        return self._fields[name]

    def read_field(self, name: str) -> torch.Tensor:
        """Return a model field of every simulation, to be read. Shape: (num_envs, ...)."""
        if name in self._fields:
            return self._fields[name]
        value = torch.from_numpy(getattr(self.model, name).copy()).to(self.device)
        return value.expand(self.num_envs, *value.shape)

    def set_const(self) -> None:
        """Recompute the constants that depend on model fields, after writing these."""
        for name in _DERIVED:
            self._expand(name)
        with self._on_torch_stream():
            self._engine.set_const(self._model, self._data)

    def state_dict(self) -> dict[str, torch.Tensor]:
        """Return all that is needed to continue, on the CPU bit for bit."""
        own = {name: value.clone() for name, value in self._state.items()}
        return saved_fields(self._fields) | version_entry(self.device) | own

    def load_state_dict(self, state: dict[str, torch.Tensor]) -> None:
        """Continue from a `state_dict`.

        Raises:
            ValueError: If the state belongs to another engine or version of MuJoCo, another model
                or another number of simulations.
        """
        if "qacc_warmstart" not in state:
            raise ValueError(
                "simulation state is not of the engine 'warp': go on with the engine and the"
                " device that it was saved with"
            )
        check_version(state)
        for name, own in self._state.items():
            if state[name].shape != own.shape:
                raise ValueError(
                    f"simulation state's {name} has shape {tuple(state[name].shape)}, this model "
                    f"and num_envs need {tuple(own.shape)}"
                )
        load_fields(self, state)
        self.set_const()
        for name, own in self._state.items():
            own.copy_(state[name])

    def _make_room(self, num_steps: int) -> None:
        """Allocate the arrays that `step` records into, unless they are there."""
        if all(rows.shape[1] == num_steps for rows in self.substeps.values()) and (
            len(self.substeps) == len(self._recorded)
        ):
            return
        own = {name: self._state[name] for name in self._recorded}
        self.substeps = {
            name: rows.new_zeros(num_steps, *rows.shape).transpose(0, 1)
            for name, rows in own.items()
        }

    def _set_options(self) -> None:
        options = self._model.opt
        options.warn_overflow = 0  # nothing is printed from the device: `unstable` tells
        if self.device.type == "cuda":
            # Drivers before CUDA 12.4 cannot end a solver's loop early inside a graph.
            options.graph_conditional = self._warp.is_conditional_graph_supported()

    def _expand(self, name: str) -> None:
        """Give a field of the model a row for every simulation, in place of the common one."""
        common = getattr(self._model, name)
        if common.shape[0] == self.num_envs:
            return
        if common.shape[0] != 1:
            raise ValueError(f"model field {name!r} cannot differ between simulations")
        with self._on_torch_stream():
            row = self._view(common)
            rows = row.expand(self.num_envs, *row.shape[1:]).contiguous()
            setattr(self._model, name, self._warp.from_torch(rows, dtype=common.dtype))
        self._graphs.clear()  # they would go on with the old array

    def _run(self, function: Callable[..., None], *args: Any) -> None:  # noqa: ANN401
        """Call one of the engine's functions on all simulations, from its graph once it has one."""
        if function in self._graphs:
            self._warp.capture_launch(self._graphs[function], stream=self._torch_stream())
            return
        # The first call loads all kernels, which not every driver can do while it captures.
        with self._on_torch_stream():
            function(self._model, self._data, *args)
        # On a stream of Warp's: CUDA captures nothing on the one that is torch's default.
        with self._warp.ScopedDevice(str(self.device)), self._warp.ScopedCapture() as capture:
            function(self._model, self._data, *args)
        self._graphs[function] = capture.graph

    def _torch_stream(self) -> Any:  # noqa: ANN401
        """Return torch's current stream, on which the engine's work and torch's keep their order.

        None on the CPU, which has no streams.
        """
        on_cuda = self.device.type == "cuda"
        return self._warp.stream_from_torch(self.device) if on_cuda else None

    @contextlib.contextmanager
    def _on_torch_stream(self) -> Iterator[None]:
        """Let Warp allocate and work on this simulation's device, in torch's order."""
        with (
            self._warp.ScopedDevice(str(self.device)),
            self._warp.ScopedStream(self._torch_stream()),
        ):
            yield

    def _view(self, array: Any) -> torch.Tensor:  # noqa: ANN401
        """Return a tensor that shares an array's memory."""
        return self._warp.to_torch(array)


def _check_model(model: mujoco.MjModel) -> None:
    """Refuse what is not done here: boxes' bounds and past set points have forms of Warp's own.

    Raises:
        ValueError: If the model has some of it.
    """
    boxes = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, GROUND_BOX.format(0)) >= 0
    late = "env.randomization.action_delay and everything_share"
    for there, fields in ((boxes, "env.terrain.kind"), (model.nhistory, late)):
        if there:
            raise ValueError(
                f"the engine 'warp' has flat ground and motors that are never late alone: let the"
                f" physics run on the CPU with env.engine 'mujoco', or leave {fields} by default"
            )


def _load_packages() -> tuple[Any, Any]:
    """Return the modules `warp` and `mujoco_warp`, quiet on standard output.

    Raises:
        ValueError: If they are not installed.
    """
    try:
        warp = importlib.import_module("warp")
        warp.config.log_level = max(warp.config.log_level, warp.LOG_WARNING)
        return warp, importlib.import_module("mujoco_warp")
    except ImportError as error:
        raise ValueError(
            "the engine 'warp' needs the package mujoco_warp: pip install 'mute[gpu]', or let"
            " the physics run on the CPU with env.engine 'mujoco'"
        ) from error


def _existing_device(device: str, warp: Any) -> torch.device:  # noqa: ANN401
    """Return a device that torch and Warp both have, with its number.

    Raises:
        ValueError: If there is none.
    """
    asked = torch.device(device)
    if asked.type == "cpu":
        return asked
    if asked.type != "cuda":
        raise ValueError(f"simulation device must be 'cpu' or 'cuda', got {device!r}")
    found = {"torch": torch.cuda.device_count(), "Warp": warp.get_cuda_device_count()}
    for package, count in found.items():
        if count <= (asked.index or 0):
            raise ValueError(
                f"simulation device is {device!r}, {package} sees {count} CUDA devices"
            )
    return asked if asked.index is not None else torch.device("cuda", torch.cuda.current_device())


def _capacity(model: mujoco.MjModel, pairs: np.ndarray) -> tuple[int, int]:
    """Return the contacts and the rows of constraints that a simulation can have at most.

    Args:
        model: The model.
        pairs: Geoms that may touch. Shape: (num_pairs, 2).
    """
    kinds = mujoco.mjtGeom
    most = np.full(kinds.mjNGEOMTYPES, 8)  # two boxes, or a box and a plane
    most[kinds.mjGEOM_SPHERE], most[kinds.mjGEOM_CAPSULE] = 1, 2
    types = model.geom_type[pairs]
    contacts = most[types].min(axis=1)
    contacts[(types == kinds.mjGEOM_HFIELD).any(axis=1)] = 4
    num_contacts = max(1, int(contacts.sum()))
    # A pyramidal contact without spin has 4 rows, an elliptic one 3. A row of dry friction a degree
    # of freedom and one for each joint's limit come on top.
    return num_contacts, 4 * num_contacts + model.nv + model.njnt
