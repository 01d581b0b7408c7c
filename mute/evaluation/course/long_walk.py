"""The long walk: one robot follows a course over several floors and is heard all the way.

The paper's experiment in an office. The robot is told where it is, as by a perfect odometry; what
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
from mute.controllers.command import Command
from mute.controllers.controller import Controller
from mute.controllers.learned import Policy
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.scene import FloorPatch
from mute.evaluation.course.course import Course
from mute.evaluation.course.path_following import PathFollower, SpeedHold
from mute.evaluation.gait import Gait
from mute.evaluation.noise_levels import SETTLE_TIME
from mute.evaluation.session import Session
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


def make_walk_env(policy: Policy, course: Course, seed: int, nominal: bool = False) -> QuadrupedEnv:
    """Return an environment for one robot on the floors of a course, facing along +x.

    Args:
        policy: What walks.
        course: What lies on the ground.
        seed: Of the robot's physics, its initial state and its noise.
        nominal: Whether it is the exact model instead, and sees without noise.
    """
    measured = robots_cfg(policy, 1, time_limit(course), seed, nominal)
    heard = listening_cfg(measured, patches=_patches(course))
    return QuadrupedEnv(dataclasses.replace(heard, random_heading=False, num_threads=1))


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
) -> Walk:
    """Walk a course from its start to its end, to a fall or the like, or to the time limit.

    Args:
        env: What `make_walk_env` returns for the course; it is reset first.
        controller: What drives.
        course: Where to walk.
        beta: Quiet factor.
        seed: Seed of all noise in the sound.
        hold_speed: Ask for more where the robot falls behind the course's speed; otherwise the
            commands are never above it, whatever becomes of them.
        keep: What to keep of the robot, of index 0, from `SETTLE_TIME` on.
        on_progress: Called before every step with the length of the path left behind, m.
        microphone: Where to listen. Default: on the trunk.
        sources: What to hear, of `soundscape.SOURCES`.
        from_energies: Take the levels from energies, without sound that no file wants: quicker, but
            with peaks that are up to 1 dB off, see `mute.acoustics.energy`.
        room: Where it is heard. Sound of one with walls needs pyroomacoustics.

    Raises:
        MuteError: If a file cannot be written, nothing renders, or what a room needs is missing.
    """
    env.autoreset = False  # a fall ends the walk, and leaves the robot where it fell
    follower = PathFollower(course.path, course.speed)
    hold = SpeedHold(env.step_dt)
    session = Session(env, controller, Command(vx=0.0, beta=beta))
    places = [_place(env)]
    deviation, commanded = 0.0, 0.0
    end: End = "time limit"
    kept = keep or KeptWalks()
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
        for _ in range(round(time_limit(course) / env.step_dt)):
            vx, vy, wz = follower.command(*places[-1])
            if on_progress is not None:
                on_progress(follower.progress)
            deviation = max(deviation, follower.deviation)
            if follower.finished:
                end = "arrived"
                break
            if hold_speed:
                vx = hold.raised(vx, follower.progress)
            commanded += vx
            session.set_command(Command(vx, vy, wz, beta))
            session.step()
            dones = env.fallen | env.unstable
            listener.listen(dones)
            films.record()
            if bool(dones[0]):
                end = "fell" if bool(env.fallen[0]) else "unstable"
                break
            places.append(_place(env))
    kept.note_clipped(listener.clipped)
    xy = np.array(places)[:, :2]
    track = _track(listener, course, xy, env.step_dt)
    distance = _distance(xy, env.step_dt)
    seconds = session.seconds
    levels = listener.levels()[0]
    return Walk(
        end=end,
        position=(float(xy[-1, 0]), float(xy[-1, 1])),
        seconds=seconds,
        progress=follower.progress,
        path_length=follower.length,
        distance=distance,
        speed_mean=distance / seconds,
        command_mean=commanded / session.steps,
        deviation_max=deviation,
        mnl=levels.mnl,
        pnl=levels.pnl,
        laeq=levels.laeq,
        floors=_by_floor(track),
        gait=dataclasses.replace(session.gait(), power=levels.power),
        track=track,
    )


def _patches(course: Course) -> tuple[FloorPatch, ...]:
    return tuple(
        FloorPatch(area.low, area.high, floor.friction, floor.solref, (*floor.colour, 1.0))
        for area, floor in ((area, FLOORS[area.floor]) for area in course.floors)
    )


def _place(env: QuadrupedEnv) -> tuple[float, float, float]:
    """Return where the robot is: x and y in m, and yaw in rad."""
    x, y = env.base_pos[0, :2].tolist()
    forward = env.heading[0]
    return x, y, float(torch.atan2(forward[1], forward[0]))


def _track(listener: Listener, course: Course, xy: NDArray[np.float64], step_dt: float) -> Track:
    """Join the levels with the places, interpolated between the control steps."""
    level = listener.readings()[0]
    counted = ~np.isnan(level)
    time = listener.reading_times()[counted]
    known = np.arange(len(xy)) * step_dt
    x, y = (np.interp(time, known, column) for column in xy.T)
    floor = np.array(course.floor_names)[course.floor_at(np.stack((x, y), axis=-1))]
    return Track(time, x, y, floor, level[counted])


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
