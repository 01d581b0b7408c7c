"""Walks are filmed: the camera follows the robot, and films are whole, with their sound."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from pathlib import Path

import imageio.v3 as imageio
import numpy as np
import pytest
from film_helpers import dark_pixels, rendering_environment, sound_of
from places import REPOSITORY

from mute.acoustics.listener import SAMPLE_RATE
from mute.checkpoint import save_checkpoint
from mute.config import AgentCfg, EstimationCfg, TaskCfg, to_plain
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.learning.runner import MuteRunner, policy_part
from mute.networks.estimator import EstimatorCfg
from mute.support.threads import core_share

FILM = """
import resource
import sys
from pathlib import Path
import torch
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.rendering.video import Video
from mute.support.errors import MuteError

folder = Path(sys.argv[1])
env = QuadrupedEnv(QuadrupedEnvCfg(num_envs=2, num_threads=1, random_heading=False))
env.simulation.qpos[0, :2] = torch.zeros(2)
with Video(folder / "new" / "whole.mp4", env, sound=folder / "gone.wav") as video:
    env.simulation.qpos[0, :2] = torch.tensor((7.0, -3.0))
    for _ in range(4):
        video.record()
print(video.silent_because)
try:
    with Video(folder / "broken.mp4", env) as video:
        raise ValueError("broken walk")
except ValueError:
    print("broken walk")
# No file may grow further, as on a full disk; the encoder finds out as it completes the film.
resource.setrlimit(resource.RLIMIT_FSIZE, (4096, resource.RLIM_INFINITY))
try:
    with Video(folder / "full.mp4", env) as video:
        video.record()
except MuteError as error:
    print(error)
"""


@pytest.fixture(scope="module")
def environ() -> dict[str, str]:
    return rendering_environment()


def _write_policy(path: Path) -> None:
    estimation = EstimationCfg(network=EstimatorCfg(lstm_hidden=8, latent_dim=4, phase_hidden=(8,)))
    agent = AgentCfg(actor_hidden=(8,), critic_hidden=(8,), estimation=estimation)
    cfg = TaskCfg(QuadrupedEnvCfg(num_envs=4, num_threads=1), agent)
    state = MuteRunner("go1_mute", cfg, None).alg.save()
    state["actor_state_dict"]["mlp.2.weight"] *= 20.0  # an untrained actor hardly moves
    save_checkpoint(
        path, policy_part(state | {"task": "go1_mute", "config": to_plain(cfg), "iter": 0})
    )


@pytest.fixture(scope="module")
def films(tmp_path_factory: pytest.TempPathFactory, environ: dict[str, str]) -> Path:
    """Return a folder after a film of a robot that jumps away, and a walk that broke."""
    folder = tmp_path_factory.mktemp("films")
    run = subprocess.run(
        [sys.executable, "-c", FILM, str(folder)],
        cwd=REPOSITORY,
        env=environ,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    reason, walk, encoder = run.stdout.splitlines()
    assert "No such file" in reason
    assert walk == "broken walk"
    assert encoder == (
        f"--video: cannot write {folder / 'full.mp4'}: the encoder broke off; is the disk full?"
    )
    assert run.stderr == ""
    return folder


def test_the_camera_follows_the_robot(films):
    frames = imageio.imread(films / "new" / "whole.mp4")
    assert frames.shape[1:] == (720, 1280, 3)
    first, last = dark_pixels(frames[0]), dark_pixels(frames[-1])
    assert len(first) > 1000
    assert not np.array_equal(frames[0], frames[-1])  # the floor has moved
    np.testing.assert_allclose(last.mean(axis=0), first.mean(axis=0), atol=20.0)


def test_a_film_has_its_name_when_it_is_whole_and_a_broken_one_leaves_nothing(films):
    assert [path for path in films.rglob("*") if path.is_file()] == [films / "new" / "whole.mp4"]


def test_a_film_is_encoded_on_the_processors_of_this_process_alone(films):
    # x264 writes how it was set into every film.
    (threads,) = re.findall(rb" threads=(\d+) ", (films / "new" / "whole.mp4").read_bytes())
    assert int(threads) == core_share()


def test_play_finds_a_backend_and_a_film_that_is_interrupted_is_kept(tmp_path, environ):
    policy, path = tmp_path / "random.pt", tmp_path / "walk.mp4"
    _write_policy(policy)
    words = ("--policy", str(policy), "--seconds", "600", "--video", str(path))
    without_choice = {key: value for key, value in environ.items() if key != "MUJOCO_GL"}
    walk = subprocess.Popen(
        [sys.executable, "play.py", *words],
        cwd=REPOSITORY,
        env=without_choice,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert walk.stdout is not None
    while (line := walk.stdout.readline()) and "  1.0 s" not in line:
        pass
    walk.send_signal(signal.SIGINT)
    _, stderr = walk.communicate(timeout=120)
    assert walk.returncode == 130, stderr
    assert f"{path} holds what was filmed so far" in stderr
    frames = imageio.imread(path)
    assert len(frames) >= 25
    assert np.abs(frames[0].astype(int) - frames[20]).max() > 100  # the robot moves
    sound = sound_of(path)
    assert len(sound) > 0.5 * SAMPLE_RATE
    assert np.abs(sound).max() > 0.0  # the fan at least
    assert sorted(tmp_path.iterdir()) == [policy, path]
