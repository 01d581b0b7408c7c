"""Velocity commands that keep a robot on a path: pure pursuit.

The robot steers for the point of the path that lies a look-ahead beyond the point nearest to it
(Coulter, Implementation of the Pure Pursuit Path Tracking Algorithm, CMU-RI-TR-92-01, 1992): the
arc from the robot to a point at bearing a and distance L has the curvature 2 sin(a) / L. So corners
are rounded without being in the path. The further to the side the point lies, the slower the robot
walks; with the point behind, it turns on the spot.

A policy may walk slower than it is asked to, or stand where it is asked to walk slowly: `SpeedHold`
asks for more until the robot gets along as it should.

Positions come from whoever knows them; nothing here is about simulation or about sound.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

__all__ = ["MAX_SPEED", "PathFollower", "SpeedHold"]

MAX_SPEED = 1.0
"""Fastest forward command that policies are trained on, m/s."""

_MAX_TURN_RATE = 1.0
"""Fastest yaw rate that policies are trained on, rad/s."""


class PathFollower:
    """Follows a path once, from its first point to its last."""

    def __init__(
        self, path: Sequence[tuple[float, float]], speed: float, look_ahead: float = 0.6
    ) -> None:
        """Begin at the start of the path.

        Args:
            path: Waypoints in m, joined by straight lines.
            speed: Forward speed on straight stretches, m/s.
            look_ahead: Distance along the path to the point that is steered for, m. Longer is
                calmer, and cuts corners more: a right angle by 0.3 of it.

        Raises:
            ValueError: If there are less than two points, two that follow each other are the same,
                or the speed or the look-ahead is out of its range.
        """
        if not 0.0 < speed <= MAX_SPEED:
            raise ValueError(f"speed must be above 0 and at most {MAX_SPEED:g}, got {speed}")
        if not 0.0 < look_ahead < math.inf:
            raise ValueError(f"look_ahead must be > 0, got {look_ahead}")
        if len(path) < 2:
            raise ValueError(f"path must have at least two points, got {len(path)}")
        points = np.asarray(path, dtype=np.float64)
        self._starts, self._legs = points[:-1], np.diff(points, axis=0)
        self._lengths = np.linalg.norm(self._legs, axis=1)
        if not (self._lengths > 0.0).all():
            raise ValueError("path must not have the same point twice in a row")
        self._begins = np.concatenate(([0.0], np.cumsum(self._lengths)[:-1]))
        self._speed, self._look_ahead = speed, look_ahead
        self.length = float(self._lengths.sum())
        """Length of the path, m."""
        self.progress = 0.0
        """Length of the path up to the point nearest to the robot, m; it never falls."""
        self.deviation = 0.0
        """Distance of the robot from that point, m."""

    @property
    def finished(self) -> bool:
        """Whether the robot is level with the end of the path, or beyond."""
        return self.progress >= self.length - 1e-9

    def command(self, x: float, y: float, yaw: float) -> tuple[float, float, float]:
        """Take in where the robot is, and return what to ask of it; at the end, to stand.

        Args:
            x: Position, world frame, m.
            y: Position, world frame, m.
            yaw: Direction of the robot's forward axis from world x, rad.

        Returns:
            Velocities forward and to the left in m/s, and yaw rate in rad/s, in the body frame.
        """
        self._advance(x, y)
        if self.finished:
            return 0.0, 0.0, 0.0
        target_x, target_y = self._point(self.progress + self._look_ahead)
        bearing = math.remainder(math.atan2(target_y - y, target_x - x) - yaw, math.tau)
        ahead = math.cos(bearing)
        # A point behind is turned to at the full rate, not by an ever wider arc.
        aside = math.sin(bearing) if ahead > 0.0 else math.copysign(1.0, bearing)
        turn_rate = self._speed * 2.0 * aside / self._look_ahead
        # Where the rate is not to be had, the speed gives way and the arc keeps its curvature.
        slowing = min(1.0, _MAX_TURN_RATE / max(abs(turn_rate), 1e-9))
        return self._speed * max(ahead, 0.0) * slowing, 0.0, turn_rate * slowing

    def _advance(self, x: float, y: float) -> None:
        """Find the nearest point from the last one on, no further than the point steered for.

        Other stretches of the path may come nearer, or cross: those are not where the robot is.
        """
        offset = np.array((x, y)) - self._starts
        along = (offset * self._legs).sum(axis=1) / self._lengths
        first = np.maximum(self.progress - self._begins, 0.0)
        last = np.minimum(self.progress + self._look_ahead - self._begins, self._lengths)
        along = np.clip(along, first, np.maximum(first, last))
        nearest = self._starts + self._legs * (along / self._lengths)[:, None]
        apart = np.linalg.norm(nearest - (x, y), axis=1)
        apart[last < first] = np.inf
        leg = int(np.argmin(apart))
        self.progress = max(self.progress, float(self._begins[leg] + along[leg]))
        self.deviation = float(apart[leg])

    def _point(self, distance: float) -> tuple[float, float]:
        """Return the point at a distance along the path; beyond its end it goes on straight."""
        leg = int(np.searchsorted(self._begins, distance, side="right")) - 1
        share = (distance - self._begins[leg]) / self._lengths[leg]
        x, y = self._starts[leg] + share * self._legs[leg]
        return float(x), float(y)


class SpeedHold:
    """Raises forward commands in proportion to how far the robot has fallen behind them."""

    def __init__(self, step_dt: float, gain: float = 0.5) -> None:
        """Start with nothing to make up.

        Args:
            step_dt: Time between commands, s.
            gain: Speed added for each metre behind, 1/s.
        """
        self._step_dt, self._gain = step_dt, gain
        self._behind = 0.0
        self._progress = 0.0

    def raised(self, speed: float, progress: float) -> float:
        """Return the forward speed to ask for, m/s: at least `speed`, at most what is trained.

        Args:
            speed: Forward speed that the robot should have from now on, m/s; 0 stays 0.
            progress: Length of the path behind it, m.
        """
        gained, self._progress = progress - self._progress, progress
        # What was gained is not saved up: a cut corner must not slow the robot down after it.
        behind = max(self._behind - gained, 0.0)
        asked = min(speed + self._gain * behind, MAX_SPEED) if speed > 0.0 else speed
        # Nor does it grow once the fastest command is reached.
        self._behind = behind + speed * self._step_dt if asked < MAX_SPEED else behind
        return asked
