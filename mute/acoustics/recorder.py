"""What an environment's robots do at every physics step, kept; the sound is made of it later.

Nothing is sampled at the control rate: an impact is over within a control step. The engine records
while the physics runs, and the recorder only copies; a block is worked out when it is taken.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable

import mujoco
import numpy as np
from numpy.typing import NDArray

from mute.acoustics.contacts import ContactBlock, Impacts
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.scene import FOOT_RADIUS, LEGS
from mute.envs.sensors import sensor_slice

__all__ = ["AT_LIMIT", "RELEASE", "Recorder", "effective_mass"]

RELEASE = 0.005
"""Time without contact after which the next contact is an impact, s (chosen). The solver may drop a
contact that carries little load for a step or two; a foot that is off the ground that shortly
cannot have gathered speed."""

AT_LIMIT = 0.99
"""Share of the largest friction from which on a foot slides. With an elliptic cone the solver puts
the force of a sliding foot exactly on the cone."""

_RECORDED = ("sensordata", "qpos", "qvel", "actuator_force")
"""What is kept of every physics step, of the engine's arrays."""

FloorAt = Callable[[NDArray[np.floating]], NDArray[np.integer]]


class Recorder:
    """Keeps the state of every physics step of an environment, and makes blocks of it.

    The environment needs `scene.foot_forces`. With pyramidal cones, whose friction is never quite
    used up, no foot is known to slide, and none scuffs; `scene.cone` elliptic tells. A robot that
    begins anew in between jumps, drops and lands: whoever resets robots calls `restart`.
    """

    def __init__(
        self, env: QuadrupedEnv, floor_at: FloorAt | int = 0, robots: slice | None = None
    ) -> None:
        """Begin to record.

        Args:
            env: The environment, which others may record as well.
            floor_at: Index of the floor under world positions of shape (..., 2) in m, as an array
                of shape (...), or one index for everywhere.
            robots: Which robots to record, in blocks that count from the first of them; None for
                all.

        Raises:
            ValueError: If the environment does not measure what is needed.
        """
        if not env.cfg.scene.foot_forces:
            raise ValueError("recording needs env.scene.foot_forces")
        self.timestep = env.cfg.scene.timestep
        """Physics step, s."""
        self._env = env
        self._model = env.model
        self._data = mujoco.MjData(env.model)
        self._floor_at = floor_at
        feet = len(LEGS)
        self._columns = {
            name: sensor_slice(env.model, f"{LEGS[0]}_foot_{name}", feet)
            for name in ("pos", "vel", "contact", "force", "angvel")
        }
        env.simulation.record(*_RECORDED)
        self._robots = robots or slice(None)
        self._rows: dict[str, list[NDArray[np.float32]]] = {name: [] for name in _RECORDED}
        self._recorded = 0
        self._release = max(1, round(RELEASE / self.timestep))
        self._last_qpos = env.simulation.qpos.numpy()[self._robots].copy()
        self._friction = _friction(env, floor_at)[self._robots]
        # All begin on the ground: the first contact is no impact.
        self._touched = np.ones((self._release, len(self._last_qpos), feet), dtype=bool)
        self._stood = np.ones((len(self._last_qpos), feet), dtype=bool)
        self._restarts: list[tuple[int, NDArray[np.bool_]]] = []
        self._steps = 0
        env.physics_listeners.append(self._record)

    def close(self) -> None:
        """Stop recording, if that has not been done."""
        with contextlib.suppress(ValueError):
            self._env.physics_listeners.remove(self._record)

    def restart(self, robots: NDArray[np.bool_], unstable: NDArray[np.bool_] | None = None) -> None:
        """Take note that robots begin anew: a foot's first contact from now on is no impact.

        Args:
            robots: Those that are reset after the physics so far. Shape: (robots recorded,).
            unstable: Those whose simulation blew up in the control step just made: in its place
                they are recorded at rest where they begin anew. Shape: (robots recorded,).
        """
        self._restarts.append((self._recorded, robots.copy()))
        if unstable is not None and unstable.any() and self._recorded:
            self._lay_at_rest(unstable)

    def take(self) -> ContactBlock:
        """Return what happened since the last call, and forget it.

        Raises:
            ValueError: If nothing happened.
        """
        if not self._recorded:
            raise ValueError("no physics step since the last block")
        rows = {name: np.concatenate(values) for name, values in self._rows.items()}
        for values in self._rows.values():
            values.clear()
        self._recorded = 0
        start = self._steps * self.timestep
        steps, robots = rows["qpos"].shape[:2]
        self._steps += steps
        sensors = {name: rows["sensordata"][:, :, at] for name, at in self._columns.items()}
        vectors = {
            name: sensors[name].reshape(steps, robots, len(LEGS), 3)
            for name in ("pos", "vel", "force", "angvel")
        }
        floor = self._floor(vectors["pos"][..., :2])
        block = ContactBlock(
            start=start,
            timestep=self.timestep,
            impacts=self._impacts(start, sensors["contact"] > 0.0, vectors, floor, rows["qpos"]),
            friction_power=_friction_power(vectors, self._limit(floor, vectors["force"])),
            foot_pos=vectors["pos"],
            floor=floor,
            joint_pos=rows["qpos"][:, :, 7:],
            joint_vel=rows["qvel"][:, :, 6:],
            joint_torque=rows["actuator_force"],
            trunk_pos=rows["qpos"][:, :, :3],
            trunk_quat=rows["qpos"][:, :, 3:7],
        )
        self._last_qpos = rows["qpos"][-1]
        self._restarts.clear()
        return block

    def _record(self) -> None:
        """Keep the physics steps of a control step, steps first."""
        substeps = self._env.simulation.substeps
        for name, rows in self._rows.items():
            own = substeps[name][self._robots].transpose(0, 1)
            rows.append(own.numpy().astype(np.float32))
        self._recorded += substeps["qpos"].shape[1]

    def _lay_at_rest(self, robots: NDArray[np.bool_]) -> None:
        """Replace what was recorded in the last control step: no speed, force or contact."""
        last = {name: rows[-1] for name, rows in self._rows.items()}
        for name in ("qvel", "actuator_force", "sensordata"):
            last[name][:, robots] = 0.0
        qpos = self._env.simulation.qpos.numpy()[self._robots][robots]
        last["qpos"][:, robots] = qpos
        sensors = last["sensordata"][:, robots]
        sensors[:, :, self._columns["pos"]] = np.tile(qpos[:, :3], len(LEGS))
        last["sensordata"][:, robots] = sensors

    def _floor(self, xy: NDArray[np.floating]) -> NDArray[np.integer]:
        if callable(self._floor_at):
            return self._floor_at(xy)
        return np.full(xy.shape[:-1], self._floor_at, dtype=np.int8)

    def _limit(
        self, floor: NDArray[np.integer], force: NDArray[np.floating]
    ) -> NDArray[np.floating]:
        """Return the largest friction of each foot on its floor, N. Shape: (steps, robots, 4)."""
        robot = np.arange(floor.shape[1])[:, None]
        friction = self._friction[robot, floor if self._friction.shape[1] > 1 else 0]
        # Feet in the air, whose limit is none or no number, have no force to slide with either.
        return friction * np.maximum(np.abs(force[..., 2]), 1e-6)

    def _impacts(
        self,
        start: float,
        contact: NDArray[np.bool_],
        vectors: dict[str, NDArray],
        floor: NDArray[np.integer],
        qpos: NDArray,
    ) -> Impacts:
        """Find the onsets of contact and what hits the floor with what.

        The step that first finds contact still carries the velocity of the approach: the contact
        force acts from the next one on.
        """
        known = np.concatenate((self._touched, contact))
        before = np.lib.stride_tricks.sliding_window_view(known[:-1], self._release, axis=0)
        onset = contact & ~before.any(axis=-1) & self._have_stood(contact)
        self._touched = known[len(known) - self._release :]
        step, robot, foot = np.nonzero(onset)
        # Sensors lag the positions by a step: those of a step's contacts are the step before's.
        poses = np.concatenate((self._last_qpos[None], qpos[:-1]))[step, robot]
        return Impacts(
            time=start + step * self.timestep,
            robot=robot,
            foot=foot,
            speed=np.maximum(-vectors["vel"][step, robot, foot, 2], 0.0),
            mass=effective_mass(self._model, self._data, poses, foot),
            floor=floor[step, robot, foot],
            position=vectors["pos"][step, robot, foot] - (0.0, 0.0, FOOT_RADIUS),
        )

    def _have_stood(self, contact: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return whether each foot was in contact before, since its robot began anew.

        Shape: that of `contact`, (steps, robots, 4).
        """
        stood = np.empty_like(contact)
        nobody = np.zeros(contact.shape[1], dtype=bool)
        first = 0
        for stop, robots in [*self._restarts, (len(contact), nobody)]:
            run = np.concatenate((self._stood[None], contact[first:stop]))
            run = np.logical_or.accumulate(run)
            stood[first:stop], self._stood = run[:-1], run[-1] & ~robots[:, None]
            first = stop
        return stood


def effective_mass(
    model: mujoco.MjModel, data: mujoco.MjData, qpos: NDArray, foot: NDArray[np.integer]
) -> NDArray[np.float64]:
    """Return the mass that a vertical blow at a foot meets: (n^T J M^-1 J^T n)^-1, kg.

    J is the Jacobian of the foot's centre, n the floor's normal, M the robot's inertia matrix with
    the rotors' inertia (`armature`) in it: the joints are free to give way, as they are within the
    few milliseconds of an impact.

    Args:
        model: The robot; its masses are not those of a randomised copy.
        data: Scratch data of it.
        qpos: Poses. Shape: (n, nq).
        foot: Index of each pose's foot in the order of `LEGS`. Shape: (n,).
    """
    sites = [model.site(f"{leg}_foot").id for leg in LEGS]
    jacobian, response = np.zeros((3, model.nv)), np.zeros((1, model.nv))
    result = np.empty(len(foot))
    for index, (pose, leg) in enumerate(zip(qpos, foot, strict=True)):
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_crb(model, data)
        mujoco.mj_factorM(model, data)
        mujoco.mj_jacSite(model, data, jacobian, None, sites[leg])
        mujoco.mj_solveM(model, data, response, jacobian[2:3])
        result[index] = 1.0 / (jacobian[2] @ response[0])
    return result


def _friction(env: QuadrupedEnv, floor_at: FloorAt | int) -> NDArray[np.floating]:
    """Return every robot's friction coefficient on each floor, by its index.

    Shape: (robots, floors); (robots, 1) where there is but one to stand on.
    """
    model = env.model
    ground = np.flatnonzero(model.geom_bodyid == 0)
    if len(ground) > 1:  # beside patches, the endless floor is but a backdrop
        ground = ground[ground != model.geom("floor").id]
    friction = env.simulation.read_field("geom_friction")[:, ground, 0].numpy(force=True)
    if model.opt.cone != mujoco.mjtCone.mjCONE_ELLIPTIC:
        friction = np.full_like(friction, np.inf)
    if len(ground) == 1 or not callable(floor_at):
        return friction[:, :1]
    floor = floor_at(model.geom_pos[ground, :2])
    known = np.zeros((len(friction), int(floor.max()) + 1), dtype=friction.dtype)
    known[:, floor] = friction
    return known


def _friction_power(
    vectors: dict[str, NDArray], limit: NDArray[np.floating]
) -> NDArray[np.floating]:
    """Return the power that each foot loses to the floor by sliding, W. Shape: (steps, robots, 4).

    A foot slides where its friction is as large as it can be. Below that it sticks: there a real
    foot's rubber shears, and one of MuJoCo, whose friction is soft, creeps, neither of which rubs.
    The speed is taken where the foot touches: a foot that rolls does not slide, though its centre
    moves. The force is the foot's on the floor.

    Args:
        vectors: What was measured at the feet. Each array's shape: (steps, robots, 4, 3).
        limit: The largest friction there can be, N. Shape: (steps, robots, 4).
    """
    x, y = vectors["vel"][..., 0], vectors["vel"][..., 1]
    turn_x, turn_y = vectors["angvel"][..., 0], vectors["angvel"][..., 1]
    # v + w x (0, 0, -r)
    slide_x, slide_y = x - turn_y * FOOT_RADIUS, y + turn_x * FOOT_RADIUS
    force = vectors["force"]
    power = np.maximum(force[..., 0] * slide_x + force[..., 1] * slide_y, 0.0)
    slides = np.hypot(force[..., 0], force[..., 1]) >= AT_LIMIT * limit
    return np.where(slides, power, 0.0)
