"""The long walk: robots follow a course over several floors and are heard all the way.

The paper's experiment in an office. A robot is told where it is, as by a perfect odometry; what
drives it knows nothing of the course but the velocity commands. All levels are modelled.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import torch
from numpy.typing import NDArray

from mute.acoustics.audible_env import listening_cfg
from mute.acoustics.floors import FLOORS
from mute.acoustics.listener import Listener
from mute.acoustics.metering.levels import READINGS_PER_SECOND
from mute.acoustics.microphone import Microphone
from mute.acoustics.physics.room import OPEN, Room
from mute.acoustics.soundscape import SOURCES
from mute.acoustics.tally import HeardLevels
from mute.controllers.controller import Controller
from mute.controllers.driver import Driver
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.scene import FloorPatch
from mute.evaluation.course.course import Course
from mute.evaluation.course.path_following import PathFollower, SpeedHold
from mute.evaluation.gait import Gait, GaitMeter
from mute.evaluation.noise_levels import SETTLE_TIME
from mute.evaluation.usual_robots import robots_cfg
from mute.rendering.kept_walks import KeptWalks, filming

__all__ = ["FloorLevel", "Track", "Walk", "follow_course", "make_walk_env", "time_limit"]

_SWAY_TIME = 0.5
"""Time between the positions that the distance is measured by, s: the trunk sways at every step,
which leads nowhere."""

End = Literal["arrived", "fell", "unstable", "time limit"]


@dataclass(frozen=True)
class Track:
    """Where the robot was, and how loud, at every reading of the meter. All shapes: (readings,)."""

    time: NDArray[np.float64]
    """Since the start, s."""
    x: NDArray[np.float64]
    """Position of the trunk, world frame, m."""
    y: NDArray[np.float64]
    """Position of the trunk, world frame, m."""
    floor: NDArray[np.str_]
    """Name of the floor under the trunk."""
    level: NDArray[np.float64]
    """Level with Fast time weighting, dBA."""

    def rows(self) -> list[dict[str, Any]]:
        """Return one row a reading, to the millisecond, the millimetre and the hundredth of dB."""
        return [
            {
                "time": round(float(time), 3),
                "x": round(float(x), 3),
                "y": round(float(y), 3),
                "floor": str(floor),
                "level": round(float(level), 2),
            }
            for time, x, y, floor, level in zip(
                self.time, self.x, self.y, self.floor, self.level, strict=True
            )
        ]


@dataclass(frozen=True)
class FloorLevel:
    """The readings on one floor."""

    floor: str
    """Its name."""
    mnl: float
    """Their mean, dBA."""
    pnl: float
    """The largest of them, dBA."""
    seconds: float
    """Time that they cover, s."""


@dataclass(frozen=True)
class Walk:
    """What came of a walk. Levels are NaN where it ended before the first reading."""

    end: End
    """How it ended: a fall or a simulation that blew up ends it, since the robot would start again
    at the origin."""
    position: tuple[float, float]
    """Where it ended, world frame, m."""
    seconds: float
    """How long it took, s."""
    progress: float
    """Length of the path left behind, m."""
    path_length: float
    """Length of the whole path, m."""
    distance: float
    """Distance walked, without the sway of the trunk, m."""
    speed_mean: float
    """Distance over time, m/s."""
    command_mean: float
    """Mean of the forward command, m/s."""
    deviation_max: float
    """Largest distance from the path, m."""
    mnl: float
    """Mean noise level, dBA."""
    pnl: float
    """Peak noise level, dBA."""
    laeq: float
    """Equivalent continuous level, dBA."""
    floors: tuple[FloorLevel, ...]
    """Levels by floor, in the order in which they were met."""
    gait: Gait
    """How it walked; the power is that of every physics step."""
    track: Track
    """Place and level over time."""

    @property
    def falls(self) -> int:
        """How many times it fell: 0 or 1."""
        return int(self.end == "fell")

    def figures(self) -> dict[str, Any]:
        """Return all but the track, as plain data."""
        left_out = ("track", "gait", "floors")
        names = [field.name for field in dataclasses.fields(self) if field.name not in left_out]
        return {name: getattr(self, name) for name in names} | {
            "falls": self.falls,
            "floors": [dataclasses.asdict(floor) for floor in self.floors],
            "gait": self.gait.as_dict(),
        }


def time_limit(course: Course) -> float:
    """Return the time after which a walk is given up, s: twice what the course's speed needs."""
    return 10.0 + 2.0 * course.length / course.speed


def make_walk_env(
    policy: Driver, course: Course, seed: int, robots: int = 1, nominal: bool = False
) -> QuadrupedEnv:
    """Return an environment of robots on the floors of a course, each alone, facing along +x.

    Args:
        policy: What walks.
        course: What lies on the ground.
        seed: Of the robots' physics, their initial states and their noise.
        robots: How many.
        nominal: Whether they are the exact model instead, and see without noise.
    """
    measured = robots_cfg(policy, robots, time_limit(course), seed, nominal)
    heard = listening_cfg(measured, patches=_patches(course))
    threads = 1 if robots == 1 else 0
    return QuadrupedEnv(dataclasses.replace(heard, random_heading=False, num_threads=threads))


def follow_course(
    env: QuadrupedEnv,
    controller: Controller,
    course: Course,
    beta: float,
    seed: int = 0,
    hold_speed: bool = False,
    keep: KeptWalks | None = None,
    on_progress: Callable[[float], None] | None = None,
    microphone: Microphone | None = None,
    sources: Sequence[str] = SOURCES,
    from_energies: bool = False,
    room: Room = OPEN,
) -> list[Walk]:
    """Walk a course from its start to its end, to a fall or the like, or to the time limit.

    Robots walk side by side, each in a world of its own. One whose walk has ended is asked to
    stand, and all that comes after is left out of its figures. Where an interrupt comes between,
    the walks that have ended are returned, if there are any.

    Args:
        env: What `make_walk_env` returns for the course; it is reset first.
        controller: What drives.
        course: Where to walk.
        beta: Quiet factor.
        seed: Seed of all noise in the sound.
        hold_speed: Ask for more where a robot falls behind the course's speed; otherwise the
            commands are never above it, whatever becomes of them.
        keep: What to keep of the first robot, of index 0, from `SETTLE_TIME` on, until all have
            ended.
        on_progress: Called before every step with the length of the path that the last one has
            left behind, m.
        microphone: Where to listen. Default: on the trunk.
        sources: What to hear, of `soundscape.SOURCES`.
        from_energies: Take the levels from energies, without sound that no file wants: quicker, but
            with peaks that are up to 1 dB off, see `mute.acoustics.energy`.
        room: Where it is heard. Sound of one with walls needs pyroomacoustics.

    Returns:
        What came of each robot.

    Raises:
        KeyboardInterrupt: If that came before any walk had ended.
        MuteError: If a file cannot be written, nothing renders, or what a room needs is missing.
    """
    env.autoreset = False  # a fall ends the walk, and leaves the robot where it fell
    robots = [_Robot(course, env.step_dt, hold_speed) for _ in range(env.num_envs)]
    kept = keep or KeptWalks()
    env.reset()
    controller.reset()
    meter = GaitMeter(env, SETTLE_TIME)
    with (
        filming(env, kept, SETTLE_TIME) as films,
        Listener(
            env,
            course.floor_names,
            course.floor_at,
            microphone,
            sources,
            settle_time=SETTLE_TIME,
            seed=seed,
            wav=films.sounds,
            from_energies=from_energies,
            room=room,
        ) as listener,
    ):
        try:
            for _ in range(round(time_limit(course) / env.step_dt)):
                commands = _commands(env, robots, beta)
                if on_progress is not None:
                    on_progress(min(robot.follower.progress for robot in robots))
                _close(robots, env, meter, listener, course)
                if all(robot.walk for robot in robots):
                    break
                env.set_command(commands)
                _, _, dones, _ = env.step(controller.act(env.get_observations()))
                meter.update(commands, dones)
                listener.listen(env.fallen | env.unstable)
                films.record()
                for index, robot in enumerate(robots):
                    robot.steps += 1
                    if robot.end is None and bool(env.fallen[index] | env.unstable[index]):
                        robot.end = "fell" if bool(env.fallen[index]) else "unstable"
            for robot in robots:
                robot.end = robot.end or "time limit"
            _close(robots, env, meter, listener, course)
        except KeyboardInterrupt:
            if not any(robot.walk for robot in robots):
                raise
    kept.note_clipped(listener.clipped)
    return [robot.walk for robot in robots if robot.walk is not None]


class _Robot:
    """One robot on its way."""

    def __init__(self, course: Course, step_dt: float, hold_speed: bool) -> None:
        self.follower = PathFollower(course.path, course.speed)
        self._hold = SpeedHold(step_dt) if hold_speed else None
        self.places: list[tuple[float, float]] = []
        self.deviation, self.commanded = 0.0, 0.0
        self.steps = 0
        self.end: End | None = None
        self.walk: Walk | None = None
        """What came of it, once it has ended."""

    def command(self, x: float, y: float, yaw: float) -> tuple[float, float, float]:
        """Return what to ask of it where it is; once its walk has ended, to stand."""
        if self.end is not None:
            return 0.0, 0.0, 0.0
        self.places.append((x, y))
        vx, vy, wz = self.follower.command(x, y, yaw)
        self.deviation = max(self.deviation, self.follower.deviation)
        if self.follower.finished:
            self.end = "arrived"
            return 0.0, 0.0, 0.0
        if self._hold is not None:
            vx = self._hold.raised(vx, self.follower.progress)
        self.commanded += vx
        return vx, vy, wz


def _commands(env: QuadrupedEnv, robots: Sequence[_Robot], beta: float) -> torch.Tensor:
    """Return what to ask of each robot now. Shape: (num_envs, 4)."""
    forward = env.heading
    yaws = torch.atan2(forward[:, 1], forward[:, 0]).tolist()
    places = zip(env.base_pos[:, :2].tolist(), yaws, strict=True)
    asked = [
        (*robot.command(x, y, yaw), beta)
        for robot, ((x, y), yaw) in zip(robots, places, strict=True)
    ]
    return torch.tensor(asked)


def _close(
    robots: Sequence[_Robot],
    env: QuadrupedEnv,
    meter: GaitMeter,
    listener: Listener,
    course: Course,
) -> None:
    """Take the figures of robots whose walk has just ended."""
    ended = [index for index, robot in enumerate(robots) if robot.end and robot.walk is None]
    if not ended:
        return
    listener.level()  # works off what is left of the last stretch
    levels, readings, times = listener.levels(), listener.readings(), listener.reading_times()
    for index in ended:
        chosen = torch.arange(env.num_envs) == index
        gait = dataclasses.replace(meter.gait(chosen), power=levels[index].power)
        robots[index].walk = _walk(
            robots[index], env.step_dt, course, levels[index], gait, times, readings[index]
        )


def _walk(
    robot: _Robot,
    step_dt: float,
    course: Course,
    levels: HeardLevels,
    gait: Gait,
    times: NDArray[np.float64],
    readings: NDArray[np.float64],
) -> Walk:
    """Return what came of a robot's walk, which has just ended."""
    assert robot.end is not None
    xy = np.array(robot.places)
    track = _track(times, readings, course, xy, step_dt)
    distance = _distance(xy, step_dt)
    seconds = robot.steps * step_dt
    return Walk(
        end=robot.end,
        position=(float(xy[-1, 0]), float(xy[-1, 1])),
        seconds=seconds,
        progress=robot.follower.progress,
        path_length=robot.follower.length,
        distance=distance,
        speed_mean=distance / seconds,
        command_mean=robot.commanded / robot.steps,
        deviation_max=robot.deviation,
        mnl=levels.mnl,
        pnl=levels.pnl,
        laeq=levels.laeq,
        floors=_by_floor(track),
        gait=gait,
        track=track,
    )


def _patches(course: Course) -> tuple[FloorPatch, ...]:
    return tuple(
        FloorPatch(area.low, area.high, floor.friction, floor.solref, (*floor.colour, 1.0))
        for area, floor in ((area, FLOORS[area.floor]) for area in course.floors)
    )


def _track(
    times: NDArray[np.float64],
    readings: NDArray[np.float64],
    course: Course,
    xy: NDArray[np.float64],
    step_dt: float,
) -> Track:
    """Join the levels with the places, interpolated between the control steps."""
    counted = ~np.isnan(readings)
    time = times[counted]
    known = np.arange(len(xy)) * step_dt
    x, y = (np.interp(time, known, column) for column in xy.T)
    floor = np.array(course.floor_names)[course.floor_at(np.stack((x, y), axis=-1))]
    return Track(time, x, y, floor, readings[counted])


def _distance(xy: NDArray[np.float64], step_dt: float) -> float:
    """Return the length of the way through places at every control step, m."""
    stride = round(_SWAY_TIME / step_dt)
    ways = np.append(np.arange(0, len(xy) - 1, stride), len(xy) - 1)
    return float(np.linalg.norm(np.diff(xy[ways], axis=0), axis=1).sum())


def _by_floor(track: Track) -> tuple[FloorLevel, ...]:
    found = []
    for name in dict.fromkeys(track.floor.tolist()):
        level = track.level[track.floor == name]
        seconds = len(level) / READINGS_PER_SECOND
        found.append(FloorLevel(name, float(level.mean()), float(level.max()), seconds))
    return tuple(found)
