"""Tests of the path follower on a kinematic unicycle, and of the speed hold."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from places import REPOSITORY

from mute.evaluation.course.course import load_course
from mute.evaluation.course.path_following import PathFollower, SpeedHold

DT = 0.02
CORNER = ((0.0, 0.0), (3.0, 0.0), (3.0, 3.0))


class _Unicycle:
    """Goes where it is told to; `lag` is the time constant of its velocities, s."""

    def __init__(self, yaw: float = 0.0, lag: float = 0.0) -> None:
        self.x, self.y, self.yaw = 0.0, 0.0, yaw
        self._share = DT / (lag + DT)
        self._speed = self._turn_rate = 0.0

    def move(self, command: tuple[float, float, float]) -> None:
        self._speed += self._share * (command[0] - self._speed)
        self._turn_rate += self._share * (command[2] - self._turn_rate)
        self.x += DT * self._speed * math.cos(self.yaw)
        self.y += DT * self._speed * math.sin(self.yaw)
        self.yaw += DT * self._turn_rate


def _follow(path, speed=0.36, seconds=None, **robot):
    """Return the places and the commands up to the end of the path, or to the time limit."""
    follower, unicycle = PathFollower(path, speed), _Unicycle(**robot)
    places, commands = [], []
    for _ in range(round((seconds or 2.0 * follower.length / speed + 10.0) / DT)):
        command = follower.command(unicycle.x, unicycle.y, unicycle.yaw)
        if follower.finished:
            break
        places.append((unicycle.x, unicycle.y))
        commands.append(command)
        unicycle.move(command)
    return np.array(places), np.array(commands), follower


def _off_path(places, path):
    """Return the distance of each place from the nearest point of the path, wherever it is."""
    apart = []
    for start, end in pairwise(np.array(path, dtype=float)):
        leg = end - start
        share = np.clip((places - start) @ leg / (leg @ leg), 0.0, 1.0)
        apart.append(np.linalg.norm(places - start - share[:, None] * leg, axis=1))
    return np.min(apart, axis=0)


@pytest.mark.parametrize("lag", [0.0, 0.3])
@pytest.mark.parametrize("speed", [0.1, 0.36, 1.0])
@pytest.mark.parametrize(
    "path",
    [
        CORNER,
        ((0, 0), (3, 0), (3, 0.8), (0, 0.8)),
        ((0, 0), (3, 0), (1, 1)),
        ((0, 0), (2, 0), (2.3, 0.3), (2.3, 2), (4, 2)),
    ],
)
def test_a_unicycle_stays_near_the_path_and_arrives(path, speed, lag):
    places, _, follower = _follow(path, speed, lag=lag)
    assert follower.finished
    assert _off_path(places, path).max() < 0.3
    assert places[-1] == pytest.approx(path[-1], abs=0.3)


def test_the_office_is_followed_to_its_end_in_the_time_that_its_length_takes():
    course = load_course(REPOSITORY / "resources" / "courses" / "office.yaml")
    places, commands, follower = _follow(course.path, course.speed, lag=0.2)
    assert follower.finished
    assert _off_path(places, course.path).max() < 0.2
    assert len(commands) * DT == pytest.approx(course.length / course.speed, rel=0.03)


@settings(max_examples=20, deadline=None, derandomize=True)
@given(
    turns=st.lists(st.floats(-2.4, 2.4), min_size=1, max_size=5),
    lengths=st.lists(st.floats(1.0, 4.0), min_size=6, max_size=6),
)
def test_any_turns_keep_commands_within_what_is_trained(turns, lengths):
    heading, path = 0.0, [(0.0, 0.0), (lengths[0], 0.0)]
    for turn, length in zip(turns, lengths[1:], strict=False):
        heading += turn
        x, y = path[-1]
        path.append((x + length * math.cos(heading), y + length * math.sin(heading)))
    places, commands, follower = _follow(path, 0.36, lag=0.2)
    assert follower.finished
    assert (commands[:, 0] >= 0.0).all()
    assert (commands[:, 0] <= 0.36).all()
    assert (commands[:, 1] == 0.0).all()
    assert (np.abs(commands[:, 2]) <= 1.0).all()
    assert _off_path(places, path).max() < 0.35


def test_on_the_path_it_asks_for_the_speed_and_no_turn():
    assert PathFollower(CORNER, 0.36).command(1.0, 0.0, 0.0) == pytest.approx((0.36, 0.0, 0.0))


def test_it_steers_along_the_arc_to_the_point_ahead():
    follower = PathFollower(((0, 0), (9, 0)), 0.3, look_ahead=0.5)
    vx, vy, wz = follower.command(0.4, 0.1, 0.0)
    bearing = math.atan2(-0.1, 0.5)
    assert (vx, vy) == pytest.approx((0.3 * math.cos(bearing), 0.0))
    assert wz == pytest.approx(0.3 * 2.0 * math.sin(bearing) / 0.5)


def test_where_the_turn_would_be_too_fast_the_speed_gives_way():
    follower = PathFollower(((0, 0), (9, 0)), 1.0, look_ahead=0.5)
    vx, _, wz = follower.command(0.0, 0.0, -0.5)
    assert wz == 1.0
    assert vx / wz == pytest.approx(math.cos(0.5) / (2.0 * math.sin(0.5) / 0.5))


def test_with_the_path_behind_it_turns_on_the_spot():
    vx, _, wz = PathFollower(((0, 0), (9, 0)), 0.36).command(0.0, 0.0, -2.0)
    assert (vx, wz) == (0.0, 1.0)


def test_a_robot_that_faces_backwards_turns_and_arrives():
    places, _, follower = _follow(((0, 0), (3, 0)), yaw=math.pi)
    assert follower.finished
    assert _off_path(places, ((0, 0), (3, 0))).max() < 0.3


def test_it_does_not_jump_to_a_later_stretch_that_comes_near():
    follower = PathFollower(((0, 0), (5, 0), (5, 0.3), (0, 0.3)), 0.36)
    for x in np.arange(0.0, 2.0, 0.1):
        follower.command(float(x), 0.2, 0.0)  # nearer to the way back
    assert follower.progress == pytest.approx(1.9)
    assert follower.deviation == pytest.approx(0.2)


def test_a_path_that_crosses_itself_is_walked_in_its_order():
    path = ((0, 0), (4, 0), (4, 2), (2, 2), (2, -2))
    places, _, follower = _follow(path)
    assert follower.finished
    assert places[:, 0].max() > 3.5
    assert places[-1] == pytest.approx((2.0, -2.0), abs=0.1)


def test_progress_does_not_fall_when_the_robot_is_pushed_back():
    follower = PathFollower(((0, 0), (5, 0)), 0.36)
    follower.command(0.5, 0.0, 0.0)
    follower.command(0.3, 0.0, 0.0)
    assert follower.progress == 0.5


def test_at_the_end_it_asks_to_stand():
    follower = PathFollower(((0, 0), (0.5, 0)), 0.36)
    assert follower.command(0.6, 0.1, 0.0) == (0.0, 0.0, 0.0)
    assert follower.finished


@pytest.mark.parametrize(
    ("path", "speed", "look_ahead", "message"),
    [
        (((0, 0),), 0.3, 0.6, "at least two points, got 1"),
        (((0, 0), (0, 0)), 0.3, 0.6, "same point twice in a row"),
        (CORNER, 0.0, 0.6, "speed must be above 0 and at most 1, got 0.0"),
        (CORNER, math.nan, 0.6, "speed must be above 0 and at most 1, got nan"),
        (CORNER, 0.3, 0.0, "look_ahead must be > 0, got 0.0"),
    ],
)
def test_bad_arguments_are_refused(path, speed, look_ahead, message):
    with pytest.raises(ValueError, match=message):
        PathFollower(path, speed, look_ahead)


def test_a_robot_that_keeps_up_is_asked_for_no_more():
    hold = SpeedHold(DT)
    asked = [hold.raised(0.36, 0.36 * DT * step) for step in range(100)]
    assert asked == pytest.approx([0.36] * 100)


def test_a_robot_that_stands_is_asked_for_more_with_every_second():
    hold = SpeedHold(DT, gain=0.5)
    asked = [hold.raised(0.36, 0.0) for _ in range(51)]
    assert asked[50] == pytest.approx(0.36 + 0.5 * 0.36 * 1.0)


def test_a_robot_that_walks_too_slowly_is_brought_to_the_speed():
    hold, progress, speeds = SpeedHold(DT), 0.0, []
    for _ in range(2000):
        speeds.append(0.8 * hold.raised(0.36, progress))
        progress += DT * speeds[-1]
    assert speeds[-1] == pytest.approx(0.36, rel=1e-3)


def test_it_never_asks_for_more_than_is_trained_and_comes_down_soon_after():
    hold = SpeedHold(DT)
    asked = [hold.raised(0.36, 0.0) for _ in range(5000)]
    assert max(asked) == 1.0
    behind = (1.0 - 0.36) / 0.5
    assert hold.raised(0.36, behind + 0.1) == pytest.approx(0.36)


def test_where_the_robot_turns_on_the_spot_it_asks_for_no_speed():
    hold = SpeedHold(DT)
    for _ in range(50):
        hold.raised(0.36, 0.0)
    assert hold.raised(0.0, 0.0) == 0.0


def test_what_a_cut_corner_gains_does_not_slow_it_down_afterwards():
    hold = SpeedHold(DT)
    hold.raised(0.36, 0.0)
    hold.raised(0.36, 1.0)
    assert hold.raised(0.36, 1.0) == pytest.approx(0.36 + 0.5 * 0.36 * DT)
