"""Forces of the feet over the steps ahead: a quadratic program of a rigid body, for each robot.

The robot is one rigid body, upright but for small angles, pushed by its feet (Di Carlo et al.,
"Dynamic locomotion in the MIT Cheetah 3 through convex model-predictive control", IROS 2018). A
force that is held through step j moves the body's velocity at the end of step k by dt, and its
place by (k - j - 1/2) dt^2, of the acceleration that it causes: what is minimised is written down
in closed form, in the forces alone, for all robots at once. Each program is solved by DAQP
(Arnstrom et al., "A dual active-set solver for embedded quadratic programming using recursive LDL'
updates", 2022).
"""

from __future__ import annotations

from dataclasses import dataclass

import daqp
import numpy as np
from numpy.typing import NDArray

from mute.envs.base_state import GRAVITY

from .body import Body
from .settings import MpcCfg
from .turning import cross

__all__ = ["ForceProgram", "Outlook", "Programs"]

Array = NDArray[np.floating]

_FAILED = 0
"""DAQP's exit flags up to it mean that there is no solution."""


@dataclass(frozen=True)
class Outlook:
    """What forces are looked for: n robots over N steps, in each robot's heading frame."""

    pose: Array
    """Roll, pitch and yaw from the heading, rad, and the place of the centre of mass, m, now.
    Shape: (n, 6)."""
    velocity: Array
    """Turning rates, rad/s, and velocity, m/s, now. Shape: (n, 6)."""
    pose_wanted: Array
    """The same as `pose`, wanted at the end of each step. Shape: (n, N, 6)."""
    velocity_wanted: Array
    """The same as `velocity`. Shape: (n, N, 6)."""
    feet: Array
    """From the centre of mass to each foot in the middle of each step, m. Shape: (n, N, 4, 3)."""
    stance: NDArray[np.bool_]
    """Which feet are on the ground in each step. Shape: (n, N, 4)."""
    turn: Array
    """From the trunk's frame to the heading frame. Shape: (n, 3, 3)."""


@dataclass(frozen=True)
class Programs:
    """Programs of n robots: the least of 1/2 f' H f + g' f, of `count` forces over the steps.

    The variables f are all forces along z, step by step, then along x, then along y.
    """

    hessian: Array
    """H. Shape: (n, 3 count, 3 count)."""
    gradient: Array
    """g. Shape: (n, 3 count)."""
    step: NDArray[np.int64]
    """Step of each force. Shape: (count,)."""
    foot: NDArray[np.int64]
    """Whose foot's it is. Shape: (n, count)."""


class ForceProgram:
    """The program of a body and its settings."""

    def __init__(self, body: Body, cfg: MpcCfg) -> None:
        """Work out what is the same for every robot and time."""
        self.cfg = cfg
        self._body = body
        steps, dt = cfg.horizon, cfg.horizon_step
        end, begin = np.arange(1, steps + 1)[:, None], np.arange(steps)[None]
        after = end > begin
        # By how much a unit of acceleration in step j changes what is at the end of step k.
        self._to_pose = after * (end - begin - 0.5) * dt**2
        self._to_velocity = after * dt
        self._pose_weights = np.array(cfg.orientation_weights + cfg.position_weights)
        self._velocity_weights = np.array(cfg.angular_velocity_weights + cfg.velocity_weights)
        self._pose_pairs = self._to_pose.T @ self._to_pose
        self._velocity_pairs = self._to_velocity.T @ self._to_velocity
        self._inverse_inertia = np.linalg.inv(body.inertia)
        self._bounds: dict[int, tuple[Array, Array, Array]] = {}
        self._time = dt * np.arange(1, steps + 1)

    def solve(self, outlook: Outlook) -> Array:
        """Return the forces of the ground on the feet in the first step, N, in the heading frame.

        Feet in the air have none. Where a program has no solution, which its bounds rule out but
        for rounding, each foot carries its share of the weight.

        Returns:
            Shape: (n, 4, 3).
        """
        forces = np.zeros((len(outlook.pose), 4, 3))
        # Robots whose steps have as many feet down each have programs of one form.
        feet_down = outlook.stance.sum(axis=2)
        left = np.flatnonzero(feet_down.any(axis=1))
        while len(left):
            form = feet_down[left[0]]
            alike = (feet_down[left] == form).all(axis=1)
            robots, left = left[alike], left[~alike]
            forces[robots] = self._first_forces(outlook, robots, form)
        return forces

    def programs(
        self, outlook: Outlook, robots: NDArray[np.int64], feet_down: NDArray[np.int64]
    ) -> Programs:
        """Return the programs of robots that have as many feet on the ground in each step.

        Args:
            outlook: What is looked for.
            robots: Which of its robots.
            feet_down: Their feet on the ground in each step. Shape: (N,).
        """
        step = np.repeat(np.arange(self.cfg.horizon), feet_down)
        foot = np.nonzero(outlook.stance[robots])[2].reshape(len(robots), -1)
        moved = self._accelerations(outlook.feet[robots[:, None], step, foot], outlook.turn[robots])
        steps = np.tile(step, 3)
        pairs = np.ix_(steps, steps)
        hessian = _products(moved, self._pose_weights) * self._pose_pairs[pairs]
        hessian += _products(moved, self._velocity_weights) * self._velocity_pairs[pairs]
        diagonal = np.arange(len(steps))
        hessian[:, diagonal, diagonal] += self.cfg.force_weight
        gradient = (moved * self._pull(outlook, robots)[:, steps]).sum(axis=-1)
        # What costs is what is more or less than a share of the weight: the cheapest is to stand.
        share = self._body.mass * GRAVITY / feet_down[step]
        gradient[:, : len(step)] -= self.cfg.force_weight * share
        return Programs(hessian, gradient, step, foot)

    def bounds(self, count: int) -> tuple[Array, Array, Array]:
        """Return rows A and bounds of lower <= (f_z, A f) <= upper: no pull, and friction.

        Args:
            count: Forces, three variables each, ordered as in `Programs`.
        """
        eye, zero = np.eye(count), np.zeros((count, count))
        cone = self.cfg.friction * eye
        rows = np.block([[-cone, eye, zero], [-cone, -eye, zero], [-cone, zero, eye],
                         [-cone, zero, -eye]])  # fmt: skip
        upper = np.concatenate((np.full(count, self.cfg.max_force), np.zeros(4 * count)))
        lower = np.concatenate((np.zeros(count), np.full(4 * count, -np.inf)))
        return rows, upper, lower

    def _first_forces(
        self, outlook: Outlook, robots: NDArray[np.int64], feet_down: NDArray[np.int64]
    ) -> Array:
        programs = self.programs(outlook, robots, feet_down)
        count, first = len(programs.step), int(feet_down[0])
        if count not in self._bounds:
            self._bounds[count] = self.bounds(count)
        bounds = self._bounds[count]
        forces = np.zeros((len(robots), 4, 3))
        share = (0.0, 0.0, self._body.mass * GRAVITY / max(first, 1))
        for robot in range(len(robots)):
            found, _, flag, _ = daqp.solve(
                programs.hessian[robot], programs.gradient[robot], *bounds
            )
            feet = programs.foot[robot, :first]
            solved = found.reshape(3, count)[(1, 2, 0), :first].T
            forces[robot, feet] = solved if flag > _FAILED else share
        return forces

    def _accelerations(self, feet: Array, turn: Array) -> Array:
        """Return what a newton at each foot does, along z, x and y. Shape: (n, 3 count, 6)."""
        inverse = turn @ self._inverse_inertia @ turn.transpose(0, 2, 1)
        robots, count = feet.shape[:2]
        moved = np.zeros((robots, 3, count, 6))
        for row, axis in enumerate((2, 0, 1)):
            unit = np.eye(3)[axis]
            moved[:, row, :, :3] = cross(feet, unit) @ inverse.transpose(0, 2, 1)
            moved[:, row, :, 3 + axis] = 1.0 / self._body.mass
        return moved.reshape(robots, 3 * count, 6)

    def _pull(self, outlook: Outlook, robots: NDArray[np.int64]) -> Array:
        """Return how much less it would cost to accelerate less in each step. Shape: (n, N, 6)."""
        velocity, time = outlook.velocity[robots, None], self._time[:, None]
        falls = np.zeros((len(time), 6))
        falls[:, 5:] = -GRAVITY * time
        pose = outlook.pose[robots, None] + velocity * time + 0.5 * falls * time
        pose_error = pose - outlook.pose_wanted[robots]
        velocity_error = velocity + falls - outlook.velocity_wanted[robots]
        pull = self._to_pose.T @ (pose_error * self._pose_weights)
        return pull + self._to_velocity.T @ (velocity_error * self._velocity_weights)


def _products(moved: Array, weights: Array) -> Array:
    """Return what each two forces do together, by weights. Shape: (n, 3 count, 3 count)."""
    return (moved * weights) @ moved.transpose(0, 2, 1)
