"""`play.py` walks, prints figures or one JSON object, and tells bad input in one line."""

from __future__ import annotations

import contextlib
import dataclasses
import io
import json
import math
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from places import REPOSITORY
from standing import Standing

from mute.acoustics.files.reading import read_wav
from mute.acoustics.listener import SAMPLE_RATE, WAV_FULL_SCALE
from mute.acoustics.metering.sound_level_meter import SoundLevelMeter
from mute.checkpoint import save_checkpoint
from mute.command_lines.play import PlayArgs, main
from mute.command_lines.play_figures import captions, page_captions, report, stretch, summary
from mute.config import AgentCfg, EstimationCfg, TaskCfg, to_plain
from mute.controllers.command import Command
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.terrain import GROUNDS, BoxGround, Ground
from mute.evaluation.session import Session
from mute.evaluation.trials import evaluation_cfg
from mute.learning.runner import MuteRunner, policy_part
from mute.networks.estimator import EstimatorCfg
from mute.support.errors import MuteError

REPORTED = {
    "beta", "command", "num_envs", "seconds", "speed", "velocity_error_sq", "landing_speed_mean",
    "landing_speed_rms", "apex_mean", "duty_factor", "stride_frequency", "power", "fall_rate",
    "unstable", "invalid_actions", "did_as_asked", "figures_from",
}  # fmt: skip
HEADLESS = {
    key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")
} | {"OMP_NUM_THREADS": "1"}


def _make_session(num_envs: int = 2) -> Session:
    cfg = evaluation_cfg(QuadrupedEnvCfg(num_threads=1), num_envs, seconds=10.0, seed=0)
    return Session(QuadrupedEnv(cfg), Standing(num_envs), Command(0.5, 0.0, 0.0, 0.5), 0.1)


def _play(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "play.py", *words],
        cwd=REPOSITORY,
        env=HEADLESS,
        capture_output=True,
        text=True,
        check=False,
    )


def _play_here(*words: str) -> subprocess.CompletedProcess[str]:
    """Run the command in this process, which spares its start."""
    with (
        contextlib.redirect_stdout(io.StringIO()) as out,
        contextlib.redirect_stderr(io.StringIO()) as errors,
    ):
        status = main(words)
    return subprocess.CompletedProcess(words, status, out.getvalue(), errors.getvalue())


@pytest.fixture(scope="module")
def policy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a small policy with random weights."""
    estimation = EstimationCfg(network=EstimatorCfg(lstm_hidden=8, latent_dim=4, phase_hidden=(8,)))
    agent = AgentCfg(actor_hidden=(8,), critic_hidden=(8,), estimation=estimation)
    cfg = TaskCfg(QuadrupedEnvCfg(num_envs=4, num_threads=1), agent)
    runner = MuteRunner("go1_mute", cfg, None)
    path = tmp_path_factory.mktemp("policy") / "random.pt"
    payload = {"task": "go1_mute", "config": to_plain(cfg), "iter": 0}
    save_checkpoint(path, policy_part(runner.alg.save() | payload))
    return path


@pytest.fixture(scope="module")
def heard(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict, Path]:
    """Return what two seconds of the shipped policy on tile print, and their sound."""
    path = tmp_path_factory.mktemp("sound") / "new" / "tile.wav"
    words = ("--beta", "0", "--vx", "1", "--surface", "tile", "--seconds", "2", "--json")
    run = _play_here(*words, "--wav", str(path))
    assert run.returncode == 0, run.stderr
    return json.loads(run.stdout), path


# -- the command line, really run ----------------------------------------------------------------


def test_json_prints_one_object_on_standard_output_and_nothing_else(policy):
    words = ("--beta", "0.7", "--vx", "-0.3", "--num-envs", "2", "--seconds", "1", "--json")
    run = _play("--policy", str(policy), *words)
    assert run.returncode == 0, run.stderr
    printed = json.loads(run.stdout)
    assert set(printed) == REPORTED
    assert (printed["beta"], printed["command"]) == (0.7, [-0.3, 0.0, 0.0])
    assert (printed["num_envs"], printed["seconds"]) == (2, 1.0)
    assert isinstance(printed["speed"], float)
    assert 0.0 <= printed["duty_factor"] <= 1.0


def test_without_a_display_each_second_is_a_line_and_a_summary_ends_it(policy):
    run = _play_here("--policy", str(policy), "--seconds", "2")
    assert run.returncode == 0, run.stderr
    seconds = [line for line in run.stdout.splitlines() if line.startswith(("  1.0 s", "  2.0 s"))]
    assert len(seconds) == 2
    for figure in ("speed", "tracking error", "landing speed", "strides"):
        assert all(figure in line for line in seconds)
    assert all(re.search(r"level \d\d\.\d dBA", line) for line in seconds)
    assert "over 2.0 s, 1 robot:" in run.stdout.splitlines()
    # The floor is training's: wood is but what it is heard as.
    assert re.search(r"MNL +\d\d\.\d dBA \(modelled, sounding as wood\)", run.stdout)


def test_a_level_is_said_to_be_of_the_floor_walked_on_and_of_the_first_of_several_robots(policy):
    words = ("--seconds", "2", "--surface", "tile", "--num-envs", "2")
    run = _play_here("--policy", str(policy), *words)
    assert run.returncode == 0, run.stderr
    assert "sounding as" not in run.stdout
    assert re.search(r"MNL +\d\d\.\d dBA \(modelled, on tile, first robot\)", run.stdout)
    assert re.search(r"level \d\d\.\d dBA \(first robot\)", run.stdout)


@pytest.mark.parametrize(
    ("kind", "kinds"),
    [("stairs", {"stairs"}), ("indoor", set(GROUNDS["indoor"]))],
)
def test_robots_are_put_on_ground_of_the_kind_and_level_that_is_asked_for(
    kind, kinds, policy, monkeypatch
):
    grounds: list[Ground] = []
    step = Session.step

    def noted(session: Session) -> None:
        grounds.append(session.env.ground)
        step(session)

    monkeypatch.setattr(Session, "step", noted)
    words = ("--terrain", kind, "--level", "3", "--num-envs", "5", "--seconds", "1", "--json")
    run = _play_here("--policy", str(policy), "--viewer", "none", *words)
    assert run.returncode == 0, run.stderr
    assert set(json.loads(run.stdout)) == REPORTED
    ground = grounds[-1]
    assert isinstance(ground, BoxGround)
    assert (set(ground.kinds), ground.level.tolist()) == (kinds, [3, 3, 3, 3, 3])


def test_a_surface_adds_its_name_and_levels_above_the_fans_to_the_object(heard):
    printed, _ = heard
    assert set(printed) == REPORTED | {"surface", "mnl", "pnl", "laeq"}
    assert printed["surface"] == "tile"
    assert 55.0 < printed["mnl"] <= printed["pnl"] < 100.0
    assert 55.0 < printed["laeq"] < 100.0


def test_the_wav_file_has_the_whole_walk_and_is_louder_than_the_fan(heard):
    samples, rate = read_wav(heard[1])
    assert (rate, samples.shape) == (SAMPLE_RATE, (1, 2 * SAMPLE_RATE))
    meter = SoundLevelMeter(rate)
    meter.update(samples * WAV_FULL_SCALE)
    assert 58.0 < meter.result()[0].laeq < 100.0  # the fan alone: 55


def test_a_bad_beta_is_one_line_and_status_2():
    run = _play("--beta", "1.2")
    assert run.returncode == 2
    assert run.stderr == "error: --beta must be >= 0 and <= 1, got 1.2\n"
    assert run.stdout == ""


# -- bad input -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--beta", "-0.1"), "--beta must be >= 0 and <= 1, got -0.1"),
        (("--beta", "nan"), "--beta must be .* got nan"),
        (("--vx", "2.5"), "--vx must be >= -2 and <= 2, got 2.5"),
        (("--wz", "inf"), "--wz must be .* got inf"),
        (("--seconds", "0"), "--seconds must be > 0 .* got 0"),
        (("--num-envs", "-3"), "--num-envs must be an integer >= 1 .* got -3"),
        (("--seed", "-1"), "--seed must be an integer >= 0 .* got -1"),
        (("--task", "go2"), "--task must be one of go1_mute, .* got 'go2'"),
        (
            ("--terrain", "moon"),
            "--terrain must be one of indoor, rough, flat, slopes, .* got 'moon'",
        ),
        (("--terrain", "indoor"), "--terrain indoor is flat, rooms, .* --num-envs 5, got 1"),
        (("--level", "5"), "--level must be an integer >= 0 and <= 4, got 5"),
        (("--surface", "ice"), "--surface must be one of wood, parquet, .* got 'ice'"),
        (("--wav", "walk.mp3"), "--wav must name a .wav file, got 'walk.mp3'"),
        (("--sources", "fan,voice"), "--sources must be of impacts, body, drive, scuffing, fan"),
        (("--microphone", "0,1,-1"), "--microphone must be within 100 m and not below the ground"),
        (("--video", "walk.avi"), "--video must name an .mp4 file, got 'walk.avi'"),
        (("--video", "walk.mp4", "--viewer", "native"), "not with --viewer native"),
        (("--beta", "soft"), "--beta.*'soft'; see --help"),
        (("--bta", "1"), "Unrecognized options: --bta"),
        (("--viewer", "tv"), "invalid choice 'tv' for argument '--viewer'"),
    ],
)
def test_a_bad_argument_is_told_with_its_name_and_value(words, message, capsys):
    with pytest.raises(MuteError, match=message):
        main(["--viewer", "none", *words] if "--viewer" not in words else words)
    assert capsys.readouterr() == ("", "")


def test_a_missing_policy_is_told_by_its_path(tmp_path):
    with pytest.raises(MuteError, match=r"nothing\.pt"):
        main(["--viewer", "none", "--policy", str(tmp_path / "nothing.pt")])


def test_a_task_without_a_shipped_policy_says_how_to_learn_one():
    with pytest.raises(MuteError, match=r"train\.py --task go1_mute_paper"):
        main(["--viewer", "none", "--task", "go1_mute_paper"])


def test_a_file_of_another_program_is_refused(tmp_path):
    path = tmp_path / "foreign.pt"
    torch.save({"weights": torch.zeros(3)}, path)
    with pytest.raises(MuteError, match="written by another program"):
        main(["--viewer", "none", "--policy", str(path)])


def test_a_policy_of_another_task_than_asked_for_is_refused(policy):
    with pytest.raises(MuteError, match="is of task 'go1_mute', not 'go1_mute_paper'"):
        main(["--viewer", "none", "--policy", str(policy), "--task", "go1_mute_paper"])


def test_a_window_without_a_display_is_refused(monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(MuteError, match="--viewer native: there is no display"):
        main(["--viewer", "native"])


def test_a_sound_that_cannot_be_written_is_told_by_its_path(policy, tmp_path):
    path = tmp_path / "folder.wav"
    path.mkdir()
    with pytest.raises(MuteError, match=r"cannot write .*folder\.wav"):
        main(["--viewer", "none", "--policy", str(policy), "--wav", str(path), "--json"])


def test_a_walk_stopped_at_once_leaves_no_sound_and_says_so(policy, tmp_path, monkeypatch, capsys):
    def stop(session):
        raise KeyboardInterrupt

    monkeypatch.setattr(Session, "step", stop)
    path = tmp_path / "walk.wav"
    words = ["--viewer", "none", "--policy", str(policy), "--wav", str(path), "--json"]
    assert main(words) == 130
    assert f"{path} is not written: the walk ended before its sound began\n" in (
        capsys.readouterr().err
    )
    assert not path.exists()


# -- from a stand --------------------------------------------------------------------------------


def _first_frames(policy: Path, monkeypatch: pytest.MonkeyPatch, *words: str) -> list[torch.Tensor]:
    """Return the joints and all velocities at first, then the commands in force at each step."""
    frames: list[torch.Tensor] = []
    step = Session.step

    def noted(session: Session) -> None:
        env = session.env
        if not frames:
            frames.append(torch.cat((env.joint_pos, env.simulation.qvel), dim=1))
        step(session)
        frames.append(env.commands.command.clone())

    monkeypatch.setattr(Session, "step", noted)
    run = _play_here(
        "--policy",
        str(policy),
        "--viewer",
        "none",
        "--seconds",
        "1",
        "--json",
        *words,
    )
    assert run.returncode == 0, run.stderr
    return frames


def test_a_robot_begins_in_the_exact_stance_at_rest_and_stands_a_moment(policy, monkeypatch):
    first, *commands = _first_frames(policy, monkeypatch, "--vx", "0.4", "--beta", "0.3")
    assert float(first.abs().max()) == pytest.approx(0.0, abs=1e-6)
    forward = [round(float(command[0, 0]), 6) for command in commands]
    # A quarter of the walk: 12 steps, as half of 0.5 is rounded to the even.
    assert forward == [0.0] * 12 + [0.4] * 38
    assert all(float(command[0, 3]) == pytest.approx(0.3) for command in commands)


def test_several_robots_begin_at_rest_each_a_little_different(policy, monkeypatch):
    first, *_ = _first_frames(policy, monkeypatch, "--num-envs", "3")
    joints, velocities = first[:, :12], first[:, 12:]
    assert float(velocities.abs().max()) == 0.0
    assert 0.0 < float(joints.abs().max()) <= 0.1
    assert not torch.equal(joints[0], joints[1])


def test_a_robot_that_begins_moving_has_its_command_at_once(policy, monkeypatch):
    first, *commands = _first_frames(policy, monkeypatch, "--vx", "0.4", "--begin", "moving")
    joints, velocities = first[:, :12], first[:, 12:]
    assert float(joints.abs().max()) > 0.01
    assert float(velocities.abs().max()) > 0.01
    assert [round(float(command[0, 0]), 6) for command in commands] == [0.4] * 50


def _told(command: Command, seconds: float, num_envs: int = 1) -> tuple[str, float | None]:
    """Return what is said of robots that hold the stance, in text and as a number."""
    cfg = evaluation_cfg(QuadrupedEnvCfg(num_threads=1), num_envs, seconds=10.0, seed=0)
    session = Session(QuadrupedEnv(cfg), Standing(num_envs), command)
    for _ in range(round(50 * seconds)):
        session.step()
    return summary(session, None)["did as asked"], report(session)["did_as_asked"]


def test_the_summary_says_whether_a_robot_did_what_it_was_asked():
    stand, go = Command(0.0, 0.0, 0.0, 0.5), Command(0.5, 0.0, 0.0, 0.5)
    assert _told(stand, 3.0) == ("yes", 1.0)
    assert _told(go, 3.0) == ("no: it went at less than 40 % of the command", 0.0)
    several = "0 of 2 robots: 2 went at less than 40 % of the command"
    assert _told(go, 3.0, num_envs=2) == (several, 0.0)
    assert _told(stand, 3.0, num_envs=2) == ("2 of 2 robots", 1.0)
    assert _told(go, 1.0) == ("too short to tell: a command needs 2.5 s", None)


# -- what is walked and what is reported ---------------------------------------------------------


def test_every_command_within_the_limits_passes_the_check():
    args = PlayArgs(beta=1.0, vx=-2.0, vy=1.0, wz=2.0, seconds=0.02, num_envs=1)
    args.check()
    with pytest.raises(MuteError, match="--vx must be"):
        dataclasses.replace(args, vx=-2.01).check()


def test_what_went_wrong_is_told_and_is_no_fall(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its log of warnings into the working directory
    session = _make_session()
    session.step()
    assert not {"unstable", "invalid actions"} & set(summary(session, None))
    session.env.simulation.qpos[1, 0] = math.nan
    session.step()
    monkeypatch.setattr(session.controller, "act", lambda _: torch.full((2, 12), math.nan))
    for _ in range(3):
        session.step()
    printed = report(session)
    assert (printed["unstable"], printed["invalid_actions"], printed["fall_rate"]) == (1, 6, 0.0)
    shown = summary(session, None)
    assert shown["unstable"].startswith("1 times")
    assert shown["invalid actions"].startswith("6, ")


def test_the_time_that_figures_are_of_is_told():
    session = _make_session()
    for _ in range(10):
        session.step()
    assert stretch(session) == "over 0.2 s"
    assert report(session)["figures_from"] == 0.0
    session.drive_with(session.controller)
    for _ in range(15):
        session.step()
    assert stretch(session) == "over the last 0.3 of 0.5 s, since another driver took over"
    assert report(session)["figures_from"] == 0.2


def test_a_page_shows_what_a_line_does_and_the_mishaps():
    session = _make_session()
    for _ in range(20):
        session.step()
    shown = page_captions(session)
    assert shown["speed"].endswith("m/s")
    assert not {"fell", "unstable"} & set(shown)
    session.env.simulation.qpos[1, 3:7] = torch.tensor((0.0, 1.0, 0.0, 0.0))
    session.step()
    assert page_captions(session)["fell"] == "50 % of the robots"


def test_what_was_not_measured_is_null_in_the_report_and_a_dash_on_the_screen():
    session = _make_session()
    printed = json.loads(json.dumps(report(session), allow_nan=False))
    assert printed["landing_speed_mean"] is None
    assert printed["speed"] is None
    assert printed["fall_rate"] == 0.0
    assert captions(session.gait())["landing speed"] == "-"
