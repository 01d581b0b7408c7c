"""Tests of the listener: what counts for the levels, and files that are whole."""

from __future__ import annotations

import math
from itertools import count

import numpy as np
import pytest
import torch
from places import SHIPPED_POLICY

from mute.acoustics.audible_env import listening_cfg, make_listening_env
from mute.acoustics.files.reading import read_wav
from mute.acoustics.listener import SAMPLE_RATE, Listener
from mute.acoustics.metering.levels import LevelDetector
from mute.acoustics.tally import HeardLevels
from mute.controllers import LearnedController, load_policy
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.evaluation.trials import evaluation_cfg, run_trial
from mute.support.errors import MuteError

SETTLE = 0.5


def _make_env(num_envs: int = 2) -> QuadrupedEnv:
    still = QuadrupedEnvCfg(num_threads=1, initial_joint_noise=0.0, initial_velocity=0.0)
    cfg = evaluation_cfg(still, num_envs, seconds=60.0, seed=0)
    return QuadrupedEnv(listening_cfg(cfg, "tile"))


def _stamp(env: QuadrupedEnv, step: int) -> torch.Tensor:
    """Lift and drop a diagonal pair of legs, twice a second."""
    beat, within = divmod(step, 25)
    actions = torch.zeros(env.num_envs, 4, 3)
    if within < 10:
        actions[:, [beat % 2, 3 - beat % 2], 2] = -1.0
    return actions.flatten(1)


def _walk(env: QuadrupedEnv, listener: Listener, steps: int, upset: int | None = None) -> None:
    """Stamp; at a step, turn the second robot on its back, whereupon it is reset."""
    for step in range(steps):
        if step == upset:
            env.simulation.qpos[1, 3:7] = torch.tensor([0.0, 1.0, 0.0, 0.0])
            env.simulation.qpos[1, 2] += 0.5
        _, _, dones, _ = env.step(_stamp(env, step))
        assert dones.tolist() == [False, step == upset]
        listener.listen(dones)


def _policy_trial(upset: int | None, from_energies: bool) -> tuple[HeardLevels, float]:
    """Return the levels of a robot that may be upset in mid-trial, and its loudest reading."""
    policy = load_policy(SHIPPED_POLICY)
    env = make_listening_env(evaluation_cfg(policy.cfg.env, 1, 20.0, seed=1), "tile")
    listener = Listener(env, ["tile"], from_energies=from_energies)
    steps = count()

    def hear(_: object, dones: torch.Tensor) -> None:
        listener.listen(dones)
        step = next(steps)
        if step == upset:
            env.simulation.qpos[0, 3:7] = torch.tensor([0.0, 1.0, 0.0, 0.0])
        elif upset is not None and step == upset + 10:
            env.simulation.qpos[0, 2] += 0.4  # it stumbles as it gets going again

    command = torch.tensor((0.5, 0.0, 0.0, 0.0))
    with listener:
        meter = run_trial(env, LearnedController(policy, 1), command, 400, hear)
    assert meter.gait().fall_rate == (0.0 if upset is None else 1.0)
    return listener.levels()[0], float(listener._all_readings().max())


@pytest.mark.parametrize("from_energies", [False, True])
def test_a_robot_upset_in_mid_trial_has_the_peak_of_one_that_is_not(from_energies):
    calm, _ = _policy_trial(None, from_energies)
    fallen, loudest = _policy_trial(150, from_energies)
    assert loudest > calm.pnl + 3.0
    # Of one robot in 3 s: its steps are others after a fall, and its peak is one of them.
    assert fallen.pnl == pytest.approx(calm.pnl, abs=2.5)
    assert fallen.mnl == pytest.approx(calm.mnl, abs=1.0)
    assert fallen.laeq == pytest.approx(calm.laeq, abs=1.0)


def test_a_reading_counts_once_robot_and_detector_have_settled_after_start_and_fall():
    env = _make_env()
    listener = Listener(env, ["tile"], settle_time=SETTLE, from_energies=True)
    with listener:
        _walk(env, listener, 150, upset=75)  # a fall within the step from 1.50 s to 1.52 s
    kept = ~np.isnan(listener.readings())
    times = listener.reading_times()
    assert times[kept[0]] == pytest.approx(np.arange(20, 61) / 20)
    before, after = times[kept[1]][:11], times[kept[1]][11:]
    assert before == pytest.approx(np.arange(20, 31) / 20)
    assert after == pytest.approx(np.arange(51, 61) / 20)


def test_a_stretch_costs_the_same_however_long_the_walk_has_been(monkeypatch):
    asked, from_number = [], LevelDetector.reading_times_from
    monkeypatch.setattr(
        LevelDetector,
        "reading_times_from",
        lambda detector, number: asked.append(len(new := from_number(detector, number))) or new,
    )
    env = _make_env()
    listener = Listener(env, ["tile"], settle_time=SETTLE, from_energies=True, stretch=0.1)
    with listener:
        _walk(env, listener, 100)
    assert asked == [0, 0, 0, 0, 1] + 15 * [2]  # a reading every 0.05 s, from 0.5 s on
    assert listener.readings().shape == (2, 31)


def test_the_power_is_the_integral_over_the_physics_steps_that_count():
    env = _make_env()
    listener = Listener(env, ["tile"], settle_time=SETTLE, from_energies=True)
    powers = []

    def record_power() -> None:
        steps = env.simulation.substeps
        torque, velocity = steps["actuator_force"], steps["qvel"][:, :, 6:]
        powers.extend((torque * velocity).abs().sum(dim=2).T.tolist())

    env.physics_listeners.append(record_power)
    with listener:
        _walk(env, listener, 100, upset=50)
    first, second = np.array(powers).T
    settle = round(SETTLE * 1000)
    whole = [first[settle:], np.append(second[settle:1000], second[1020 + settle :])]
    power = [levels.power for levels in listener.levels()]
    assert power == pytest.approx([own.mean() for own in whole], rel=1e-4)


def test_the_equivalent_level_leaves_out_what_does_not_count():
    env = _make_env()
    listener = Listener(env, ["tile"], settle_time=SETTLE, sources=("fan",), from_energies=True)
    with listener:
        _walk(env, listener, 120, upset=60)
    assert [levels.laeq for levels in listener.levels()] == pytest.approx([55.0, 55.0], abs=0.2)
    counted = [levels.seconds for levels in listener.levels()]
    assert counted == pytest.approx([2.4 - SETTLE, 2.4 - 2 * SETTLE - 0.02])


def test_a_simulation_that_blows_up_is_not_heard(tmp_path):
    env, path = _make_env(), tmp_path / "walk.wav"
    listener = Listener(env, ["tile"], settle_time=SETTLE, wav={1: path})
    with listener:
        for step in range(150):
            if step == 75:
                env.simulation.qvel[1, 8] = math.nan
            _, _, dones, _ = env.step(_stamp(env, step) * 0.0)
            listener.listen(dones)
    assert env.unstable_count == 1
    assert all(levels.pnl < 58.0 for levels in listener.levels())
    assert np.isfinite(listener.levels()[1].laeq)
    begin = round((1.5 - SETTLE) * SAMPLE_RATE)
    assert np.abs(read_wav(path)[0][0, begin : begin + 960]).max() < 0.02


def test_a_file_begins_once_the_robot_has_settled(tmp_path):
    env, path = _make_env(), tmp_path / "walk.wav"
    listener = Listener(env, ["tile"], settle_time=SETTLE, wav=path)
    with listener:
        _walk(env, listener, 60)
    assert read_wav(path)[0].shape == (1, round((1.2 - SETTLE) * SAMPLE_RATE))
    assert listener.clipped == {0: 0}


def test_a_file_is_whole_however_the_walk_ends(tmp_path):
    env, path = _make_env(), tmp_path / "walk.wav"
    listener = Listener(env, ["tile"], settle_time=0.0, wav=path, stretch=0.2)
    with pytest.raises(KeyboardInterrupt), listener:
        _walk(env, listener, 35)
        raise KeyboardInterrupt
    assert read_wav(path)[0].shape == (1, round(0.6 * SAMPLE_RATE))


def test_one_file_that_cannot_be_opened_leaves_the_others_closed(tmp_path):
    env, path = _make_env(), tmp_path / "walk.wav"
    listener = Listener(env, ["tile"], wav={0: path, 1: tmp_path})
    with pytest.raises(MuteError, match="Is a directory"), listener:
        pass
    assert listener.clipped == {0: 0}
