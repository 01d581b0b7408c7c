"""The sound of a walk as it goes is that of the whole walk, and none of its steps takes long."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from places import SHIPPED_POLICY

from mute.acoustics.audible_env import audible_cfg
from mute.acoustics.files.reading import read_wav
from mute.acoustics.floors import FLOORS
from mute.acoustics.listener import SAMPLE_RATE, WAV_FULL_SCALE
from mute.acoustics.live_listener import LiveListener
from mute.acoustics.live_sound import LiveSound
from mute.acoustics.metering.sound_level_meter import SoundLevelMeter
from mute.acoustics.metering.third_octaves import ThirdOctaveMeter
from mute.acoustics.recorder import Recorder
from mute.acoustics.soundscape import Soundscape
from mute.acoustics.sources.halves import halves
from mute.acoustics.sources.response import floor_response
from mute.acoustics.sources.shell import shell_response
from mute.controllers import load_policy
from mute.controllers.command import Command
from mute.envs.quadruped_env import QuadrupedEnv
from mute.evaluation.session import Session
from mute.evaluation.trials import evaluation_cfg, from_the_stance

SECONDS = 4.0
SEED = 3


def _make_session(surface: str | None, listener_wav=None) -> Session:
    policy = load_policy(SHIPPED_POLICY)
    cfg = from_the_stance(evaluation_cfg(policy.cfg.env, 1, 60.0, seed=0))
    env = QuadrupedEnv(audible_cfg(cfg, surface))
    listener = None
    if listener_wav is not None:
        listener = LiveListener(env, surface or "wood", seed=SEED, wav=listener_wav)
    command = Command(0.6, 0.0, 0.0, 0.0)
    return Session(env, policy.controller(env.cfg), command, listener=listener)


def _follow(session: Session, surface: str) -> list[NDArray[np.float32]]:
    """Let a session be followed by its sound; what comes of it is added to the list returned."""
    heard: list[NDArray[np.float32]] = []
    session.followers.append(LiveSound(session.env, surface, heard.append, SAMPLE_RATE, SEED))
    return heard


def _mnl(pressure: NDArray) -> float:
    meter = SoundLevelMeter(SAMPLE_RATE)
    meter.update(pressure[None, SAMPLE_RATE:])
    return meter.result()[0].mnl


def _third_octaves(pressure: NDArray) -> NDArray[np.float64]:
    meter = ThirdOctaveMeter(SAMPLE_RATE)
    meter.update(pressure[None, SAMPLE_RATE:])
    return np.array([band.level for band in meter.result()])


@pytest.mark.parametrize("surface", ["wood", "tile"])
def test_blocks_of_control_steps_add_up_to_the_sound_of_the_whole_walk(surface):
    session = _make_session(surface)
    whole = Recorder(session.env)
    whole.restart(np.ones(1, dtype=bool))
    heard = _follow(session, surface)
    for _ in range(round(SECONDS / session.env.step_dt)):
        session.step()
    assert {len(block) for block in heard} == {round(SAMPLE_RATE * session.env.step_dt)}
    live = np.concatenate(heard)
    block = whole.take()
    assert len(block.impacts) > 20  # it walks, and not on tiptoe
    offline = Soundscape(1, [surface], sample_rate=SAMPLE_RATE, seed=SEED).render(block)[0]
    np.testing.assert_allclose(live, offline, rtol=0.0, atol=1e-5)
    assert _mnl(live) == pytest.approx(_mnl(offline), abs=0.01)
    np.testing.assert_allclose(_third_octaves(live), _third_octaves(offline), atol=0.05)


def test_it_is_the_sound_that_a_file_of_the_walk_holds_after_a_fall_and_a_restart_too(tmp_path):
    path = tmp_path / "walk.wav"
    session = _make_session("carpet", path)
    assert session.listener is not None
    heard = _follow(session, "carpet")
    with session.listener:
        for step in range(120):
            if step == 40:
                session.env.simulation.qpos[0, 3:7] = torch.tensor((0.0, 1.0, 0.0, 0.0))  # falls
            if step == 80:
                session.restart()
            session.step()
    kept = read_wav(path)[0][0] * WAV_FULL_SCALE
    last_bit = WAV_FULL_SCALE / 2**15
    np.testing.assert_allclose(np.concatenate(heard), kept, rtol=0.0, atol=last_bit)


def test_on_the_floor_of_training_it_can_be_heard_too():
    session = _make_session(None)
    heard = _follow(session, "wood")
    for _ in range(25):
        session.step()
    assert np.concatenate(heard).shape == (SAMPLE_RATE // 2,)
    assert np.abs(heard[-1]).max() > 0.0


def test_once_it_is_closed_nothing_is_recorded_for_it():
    session = _make_session("wood")
    sound = LiveSound(session.env, "wood", print, SAMPLE_RATE)
    sound.close()
    sound.close()
    session.step()
    with pytest.raises(ValueError, match="no physics step"):
        sound.follow()


def test_the_first_landings_of_a_walk_wait_for_no_filter():
    surface, rate = "laminate", 44000  # a rate that nobody has heard before in this process
    session = _make_session(surface)
    plates = floor_response(FLOORS[surface].plate, rate), shell_response(rate)
    both = [half for plate in plates for half in halves(plate, rate)]
    assert not any(half.made for half in both)
    session.followers.append(LiveSound(session.env, surface, lambda _: None, rate))
    made = [half.made for half in both]
    assert all(made)
    for _ in range(75):
        session.step()
    assert [half.made for half in both] == made
