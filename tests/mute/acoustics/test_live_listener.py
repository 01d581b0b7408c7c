"""The first robot of a walk is heard: its level is that of its sound, and its file is whole."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
import torch
from tensordict import TensorDict

from mute.acoustics.audible_env import audible_cfg
from mute.acoustics.files.reading import read_wav
from mute.acoustics.floors import FLOORS
from mute.acoustics.listener import SAMPLE_RATE, WAV_FULL_SCALE
from mute.acoustics.live_listener import LiveListener
from mute.acoustics.metering.sound_level_meter import SoundLevelMeter
from mute.acoustics.microphone import Microphone
from mute.acoustics.sources.fan import FAN_LEVEL
from mute.controllers.command import Command
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.scene import SceneCfg
from mute.evaluation.session import Session
from mute.evaluation.trials import evaluation_cfg


class _Stamp:
    """Lifts and drops a diagonal pair of legs, twice a second, or stands."""

    def __init__(self, num_envs: int, lift: float) -> None:
        self.num_envs = num_envs
        self._lift = lift
        self._steps = 0

    def reset(self, mask: torch.Tensor | None = None) -> None:
        pass

    def act(self, observations: TensorDict) -> torch.Tensor:
        self._steps += 1
        beat, within = divmod(self._steps, 25)
        actions = torch.zeros(self.num_envs, 4, 3)
        if within < 10:
            actions[:, [beat % 2, 3 - beat % 2], 2] = -self._lift
        return actions.flatten(1)


def _make_session(
    surface: str | None = None, lift: float = 0.0, wav: Path | None = None, num_envs: int = 1
) -> tuple[Session, LiveListener]:
    cfg = evaluation_cfg(QuadrupedEnvCfg(num_threads=1), num_envs, seconds=60.0, seed=0)
    env = QuadrupedEnv(audible_cfg(cfg, surface))
    listener = LiveListener(env, surface or "wood", settle_time=0.5, wav=wav)
    return Session(
        env, _Stamp(num_envs, lift), Command(0.0, 0.0, 0.0, 0.5), 0.5, listener
    ), listener


def _walk(session: Session, steps: int) -> None:
    for _ in range(steps):
        session.step()


# -- levels --------------------------------------------------------------------------------------


def test_a_standing_robot_is_heard_by_its_fan_on_the_floor_of_training():
    session, listener = _make_session()
    _walk(session, 100)
    assert listener.level() == pytest.approx(FAN_LEVEL, abs=0.3)


def test_a_source_can_be_heard_alone_from_elsewhere():
    env = QuadrupedEnv(
        audible_cfg(evaluation_cfg(QuadrupedEnvCfg(num_threads=1), 1, 60.0, 0), None)
    )
    place = Microphone((0.0, 2.0, 0.3), "beside")
    listener = LiveListener(env, "wood", microphone=place, sources=("fan",))
    _walk(Session(env, _Stamp(1, 0.5), Command(0.0, 0.0, 0.0, 0.5), 0.5, listener), 50)
    assert listener.level() < FAN_LEVEL - 6.0


def test_before_a_first_step_there_is_no_level():
    _, listener = _make_session()
    assert math.isnan(listener.level())
    assert all(math.isnan(level) for level in listener.levels().values())


def test_the_start_is_left_out_of_the_levels():
    session, listener = _make_session()
    with listener:
        _walk(session, 5)  # all feet have stood: the first contact is no landing
        session.env.simulation.qpos[0, 2] += 0.06
        _walk(session, 20)
        assert listener.level() > FAN_LEVEL + 5.0
        _walk(session, 50)
    assert listener.levels()["pnl"] < FAN_LEVEL + 3.0


def test_a_restart_forgets_the_levels_and_not_the_sound(tmp_path):
    path = tmp_path / "walk.wav"
    session, listener = _make_session("tile", 2.0, path)
    with listener:
        _walk(session, 60)
        loud = listener.levels()
        session.controller = _Stamp(1, lift=0.0)
        session.restart()
        _walk(session, 60)
    assert loud["pnl"] > FAN_LEVEL + 6.0
    assert listener.levels()["pnl"] < FAN_LEVEL + 3.0
    assert read_wav(path)[0].shape == (1, 120 * SAMPLE_RATE // 50)


def test_figures_of_another_driver_hold_nothing_of_the_one_before_while_the_meter_goes_on(tmp_path):
    path = tmp_path / "walk.wav"
    session, listener = _make_session("tile", 2.0, path)
    with listener:
        _walk(session, 60)
        loud, now = listener.levels(), listener.level()
        session.drive_with(_Stamp(1, lift=0.0))
        assert listener.level() == now
        assert all(math.isnan(level) for level in listener.levels().values())
        _walk(session, 10)
        assert math.isnan(listener.levels()["mnl"])  # what was before still rings in the meter
        _walk(session, 65)
    assert loud["mnl"] > FAN_LEVEL + 6.0
    for level in listener.levels().values():
        assert level == pytest.approx(FAN_LEVEL, abs=1.0)
    assert read_wav(path)[0].shape == (1, 135 * SAMPLE_RATE // 50)


def test_figures_that_begin_anew_before_a_first_step_are_those_of_the_walk():
    levels = []
    for begins_anew in (False, True):
        session, listener = _make_session("tile", 2.0)
        with listener:
            if begins_anew:
                listener.begin_anew()
            _walk(session, 60)
        levels.append(listener.levels())
    assert levels[0] == levels[1]


def test_a_robot_that_falls_is_in_the_levels_only_once_it_has_settled_again():
    session, listener = _make_session("tile")
    with listener:
        _walk(session, 60)
        session.env.simulation.qpos[0, 3:7] = torch.tensor([0.0, 1.0, 0.0, 0.0])
        session.env.simulation.qpos[0, 2] += 0.3
        _walk(session, 1)
        session.env.simulation.qpos[0, 2] += 0.1  # before it has touched the ground again
        _walk(session, 60)
    assert session.gait().fall_rate == 1.0
    assert listener.levels()["pnl"] < FAN_LEVEL + 3.0


def test_other_robots_are_not_heard():
    session, listener = _make_session(num_envs=2)
    _walk(session, 30)
    session.env.simulation.qpos[1, 2] += 0.3
    _walk(session, 30)
    assert listener.level() == pytest.approx(FAN_LEVEL, abs=0.5)


@pytest.mark.parametrize(("timestep", "expected"), [(0.005, True), (0.002, True), (0.003, False)])
def test_a_training_floor_is_heard_where_readings_fall_on_its_steps(timestep, expected):
    cfg = QuadrupedEnvCfg(scene=SceneCfg(timestep=timestep))
    heard = audible_cfg(cfg, None)
    assert heard.scene.foot_forces is expected
    scene = dataclasses.replace(heard.scene, foot_forces=False)
    assert dataclasses.replace(heard, scene=scene) == cfg


def test_a_surface_brings_its_friction_and_steps_of_a_millisecond():
    heard = audible_cfg(QuadrupedEnvCfg(), "tile")
    assert (heard.scene.timestep, heard.decimation) == (0.001, 20)
    assert heard.scene.floor_friction == FLOORS["tile"].friction


# -- sound ---------------------------------------------------------------------------------------


def test_the_levels_are_those_of_the_sound(tmp_path):
    path = tmp_path / "walk.wav"
    session, listener = _make_session("tile", 2.0, path)
    with listener:
        _walk(session, 125)
    samples = read_wav(path)[0] * WAV_FULL_SCALE
    meter = SoundLevelMeter(SAMPLE_RATE)
    meter.update(samples[:, SAMPLE_RATE // 2 :])
    heard, modelled = meter.result()[0], listener.levels()
    assert heard.mnl > FAN_LEVEL + 5.0
    assert modelled["mnl"] == pytest.approx(heard.mnl, abs=0.7)
    assert modelled["laeq"] == pytest.approx(heard.laeq, abs=0.7)


def test_keeping_the_sound_changes_no_level(tmp_path):
    levels = []
    for wav in (tmp_path / "walk.wav", None):
        session, listener = _make_session("wood", 1.0, wav)
        with listener:
            _walk(session, 60)
        levels.append(listener.levels())
    assert levels[0] == levels[1]


def test_an_interrupt_after_the_physics_of_a_control_step_leaves_a_whole_file(tmp_path):
    path = tmp_path / "walk.wav"
    session, listener = _make_session("tile", 2.0, path)
    steps = iter(range(35))

    def go_on_or_stop() -> None:
        if next(steps, None) is None:
            raise KeyboardInterrupt

    session.env.physics_listeners.insert(0, go_on_or_stop)
    with pytest.raises(KeyboardInterrupt), listener:
        _walk(session, 50)
    samples, rate = read_wav(path)
    # 35 whole steps came, in stretches of 10.
    assert samples.shape == (1, 30 * rate // 50)
    assert np.abs(samples).max() > 0.0
    assert math.isfinite(listener.levels()["laeq"])
