"""Tests of the long walk: short courses, really walked and heard with the shipped policy."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from places import FLAT_POLICY

from mute.acoustics.files.reading import read_wav
from mute.acoustics.listener import WAV_FULL_SCALE
from mute.acoustics.metering.sound_level_meter import measure
from mute.acoustics.microphone import Microphone
from mute.command_lines.evaluate_walk import _story
from mute.controllers import LearnedController, load_policy
from mute.evaluation.course.course import Course, FloorArea
from mute.evaluation.course.long_walk import Walk, follow_course, make_walk_env, time_limit
from mute.evaluation.gait import GaitMeter
from mute.rendering.kept_walks import KeptWalks

POLICY = FLAT_POLICY
COURSE = Course(
    path=((0.0, 0.0), (1.0, 0.0), (1.0, 0.6)),
    floors=(
        FloorArea("carpet", (-1.0, -1.0), (0.7, 2.0)),
        FloorArea("tile", (0.7, -1.0), (3.0, 2.0)),
    ),
    speed=0.4,
)
STRAIGHT = Course(((0.0, 0.0), (1.0, 0.0)), COURSE.floors, 0.36)


class _Falling:
    """Drives with a policy, and turns the robot on its back at a step, or does worse."""

    def __init__(self, env, step, qpos=(0.0, 1.0, 0.0, 0.0)):
        self._learned = LearnedController(load_policy(POLICY), env.num_envs)
        self._env, self._step, self._qpos = env, step, torch.tensor(qpos)
        self.num_envs = env.num_envs

    def reset(self, mask=None):
        self._learned.reset(mask)

    def act(self, observations):
        self._step -= 1
        if self._step == 0:
            self._env.simulation.qpos[0, 3:7] = self._qpos
        return self._learned.act(observations)


def _walk(course, beta=0.0, seed=1, **options) -> Walk:
    policy = load_policy(POLICY)
    env = make_walk_env(policy, course, seed)
    [walk] = follow_course(env, LearnedController(policy, 1), course, beta, seed=seed, **options)
    return walk


@pytest.fixture(scope="module")
def walk() -> Walk:
    return _walk(COURSE)


def test_the_robot_arrives_near_the_path_and_about_as_fast_as_it_is_asked_to(walk):
    assert walk.end == "arrived"
    assert walk.falls == 0
    assert walk.progress == walk.path_length == pytest.approx(1.6)
    assert walk.position == pytest.approx((1.0, 0.6), abs=0.3)
    assert walk.deviation_max < 0.3
    assert walk.speed_mean == pytest.approx(0.36, abs=0.06)
    assert 1.2 < walk.distance < 1.7


def test_the_walk_is_louder_than_the_fan_and_the_peak_is_above_the_mean(walk):
    assert 55.0 < walk.mnl < walk.pnl
    assert walk.laeq == pytest.approx(walk.mnl, abs=1.0)


def test_keeping_the_sound_changes_no_figure(walk, tmp_path):
    path = tmp_path / "walk.wav"
    assert _walk(COURSE, keep=KeptWalks({0: path})).figures() == walk.figures()
    samples, rate = read_wav(path)
    # The file begins once the robot has settled, and holds what is measured.
    assert samples.shape[1] / rate == pytest.approx(walk.seconds - 1.0)
    (heard,) = measure(samples * WAV_FULL_SCALE, rate)
    assert walk.mnl == pytest.approx(heard.mnl, abs=0.1)
    assert walk.pnl == pytest.approx(heard.pnl, abs=0.1)
    assert walk.laeq == pytest.approx(heard.laeq, abs=0.1)


def test_levels_from_energies_are_near_those_of_the_sound(walk):
    counted = _walk(COURSE, from_energies=True)
    # Of one robot in 3 s, whose legs sound in step by chance, and whose peak is one moment: over
    # many they are within 0.5 and 1.5 dB.
    assert counted.mnl == pytest.approx(walk.mnl, abs=0.8)
    assert counted.laeq == pytest.approx(walk.laeq, abs=0.8)
    assert counted.pnl == pytest.approx(walk.pnl, abs=2.5)
    assert counted.pnl != walk.pnl
    # Power is added up in other stretches.
    assert counted.gait.as_dict() == pytest.approx(walk.gait.as_dict(), rel=1e-6)


def test_the_power_is_not_sampled_at_the_control_rate(monkeypatch):
    sampled = GaitMeter.gait
    monkeypatch.setattr(
        GaitMeter, "gait", lambda own, chosen: replace(sampled(own, chosen), power=math.nan)
    )
    env = make_walk_env(load_policy(POLICY), STRAIGHT, seed=1)
    [result] = follow_course(env, _Falling(env, step=75), STRAIGHT, beta=0.0, from_energies=True)
    assert 10.0 < result.gait.power < 50.0


def test_every_reading_has_its_time_place_and_floor(walk):
    track = walk.track
    assert np.diff(track.time) == pytest.approx(0.05)
    assert track.time[-1] == pytest.approx(walk.seconds, abs=0.1)
    assert (track.x[-1], track.y[-1]) == pytest.approx(walk.position, abs=0.05)
    assert (track.floor == np.where(track.x <= 0.7, "carpet", "tile")).all()
    assert len(track.rows()) == len(track.time)


def test_the_level_of_a_floor_is_the_mean_of_its_readings(walk):
    assert [floor.floor for floor in walk.floors] == ["carpet", "tile"]
    for floor in walk.floors:
        own = walk.track.level[walk.track.floor == floor.floor]
        assert floor.mnl == pytest.approx(own.mean())
        assert floor.pnl == own.max()
        assert floor.seconds == pytest.approx(0.05 * len(own))
    assert walk.pnl == max(floor.pnl for floor in walk.floors)


def test_the_same_seed_gives_the_same_walk_and_the_same_sound(walk):
    again = _walk(COURSE)
    assert again.figures() == walk.figures()
    assert np.array_equal(again.track.level, walk.track.level)


def test_the_physics_of_a_walk_runs_at_a_millisecond_on_the_floors_of_the_course():
    env = make_walk_env(load_policy(POLICY), COURSE, seed=0)
    assert (env.num_envs, env.cfg.scene.timestep, env.cfg.decimation) == (1, 0.001, 20)
    assert [patch.high for patch in env.cfg.scene.floor_patches] == [(0.7, 2.0), (3.0, 2.0)]
    assert env.heading[0].tolist() == pytest.approx([1.0, 0.0])


def test_a_fall_ends_the_walk_where_the_robot_fell():
    env = make_walk_env(load_policy(POLICY), STRAIGHT, seed=1)
    [result] = follow_course(env, _Falling(env, step=120), STRAIGHT, beta=0.0)
    assert (result.end, result.falls) == ("fell", 1)
    assert 0.6 < result.position[0] == pytest.approx(result.progress, abs=0.05)
    assert result.seconds == pytest.approx(120 * 0.02, abs=0.1)
    assert result.track.time[-1] <= result.seconds


def test_each_walk_ends_by_itself_and_what_comes_after_is_none_of_its_figures():
    env = make_walk_env(load_policy(POLICY), STRAIGHT, seed=1, robots=2)
    fallen, arrived = follow_course(env, _Falling(env, step=120), STRAIGHT, beta=0.0)
    assert (fallen.end, arrived.end) == ("fell", "arrived")
    assert fallen.seconds == pytest.approx(120 * 0.02, abs=0.1)
    assert arrived.seconds > fallen.seconds + 0.3
    for walk in (fallen, arrived):
        assert walk.track.time[-1] == pytest.approx(walk.seconds, abs=0.1)
        assert walk.mnl == pytest.approx(walk.track.level.mean())
    assert (fallen.gait.fall_rate, arrived.gait.fall_rate) == (1.0, 0.0)
    assert fallen.mnl != arrived.mnl


def test_an_interrupt_leaves_the_walks_that_have_ended(monkeypatch):
    env = make_walk_env(load_policy(POLICY), STRAIGHT, seed=1, robots=2)

    def stop(progress: float) -> None:
        if progress > 0.6:  # of the one that is behind, and has not fallen
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        controller = LearnedController(load_policy(POLICY), 2)
        follow_course(env, controller, STRAIGHT, beta=0.0, on_progress=stop)
    falling = _Falling(env, step=20)
    [walk] = follow_course(env, falling, STRAIGHT, beta=0.0, on_progress=_Counting(60))
    assert walk.end == "fell"


class _Counting:
    """Interrupts at the n-th step."""

    def __init__(self, left: int) -> None:
        self._left = left

    def __call__(self, _: float) -> None:
        self._left -= 1
        if not self._left:
            raise KeyboardInterrupt


def test_a_simulation_that_blows_up_ends_the_walk_and_is_no_fall(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its log of warnings into the working directory
    env = make_walk_env(load_policy(POLICY), STRAIGHT, seed=1)
    [result] = follow_course(env, _Falling(env, step=20, qpos=math.nan), STRAIGHT, beta=0.0)
    assert (result.end, result.falls) == ("unstable", 0)
    assert (result.gait.unstable, result.gait.fall_rate) == (1, 0.0)
    assert result.seconds == pytest.approx(20 * 0.02)
    assert _story(result, STRAIGHT).startswith("was stopped, as its simulation became unstable,")


def test_a_fall_before_the_first_reading_has_no_level_and_no_sound(tmp_path):
    env = make_walk_env(load_policy(POLICY), STRAIGHT, seed=1)
    notes = []
    keep = KeptWalks({0: tmp_path / "fall.wav"}, on_note=notes.append)
    [result] = follow_course(env, _Falling(env, step=5), STRAIGHT, beta=0.0, keep=keep)
    assert list(tmp_path.iterdir()) == []
    assert "fall.wav is not written: the walk ended before" in notes[0]
    assert result.end == "fell"
    assert math.isnan(result.mnl)
    assert (len(result.track.time), result.floors) == (0, ())


def test_a_robot_that_falls_behind_is_asked_for_more_only_where_the_speed_is_held():
    held, left = (_walk(STRAIGHT, beta=1.0, hold_speed=hold) for hold in (True, False))
    assert held.end == "arrived"
    assert held.command_mean > 0.37
    assert left.command_mean < 0.3601
    assert left.seconds > held.seconds


def test_a_robot_gets_louder_as_it_walks_up_to_a_microphone_that_stands_in_the_world():
    levels = _walk(STRAIGHT, microphone=Microphone((1.0, 0.0, 0.3), "world")).track.level
    assert levels[-10:].mean() > levels[:10].mean() + 3.0


def test_a_walk_is_given_up_after_twice_the_time_that_it_should_take():
    assert time_limit(STRAIGHT) == pytest.approx(10.0 + 2.0 / 0.36)
