"""An exported policy is one file that does what torch does and says all that its user needs."""

from __future__ import annotations

import dataclasses
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
import run_onnx as example
import torch
from other_go1 import write_menagerie_like_go1, write_motor_go1
from places import REPOSITORY, RESOURCES

from mute.checkpoint import save_checkpoint
from mute.command_lines.export import main
from mute.config import AgentCfg, EstimationCfg, TaskCfg, to_plain
from mute.controllers import LearnedController, load_policy
from mute.controllers.learned import Policy
from mute.controllers.onnx_export import export_policy
from mute.envs.commands import CommandsCfg
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.randomization import RandomizationCfg
from mute.envs.scene import JOINT_NAMES
from mute.learning.runner import MuteRunner, policy_part
from mute.networks.estimator import EstimatorCfg
from mute.support.errors import MuteError
from mute.tasks import make_task

EXAMPLE = REPOSITORY / "examples" / "run_onnx.py"
HIDDEN = 24


def _make_cfg(
    actor_uses_phase: bool = True, go_signal: bool = False, heading_gain: float = 0.0
) -> TaskCfg:
    estimation = EstimationCfg(
        network=EstimatorCfg(lstm_hidden=HIDDEN, latent_dim=5, phase_hidden=(8,)),
        actor_uses_phase=actor_uses_phase,
    )
    agent = AgentCfg(
        actor_hidden=(16, 8),
        critic_hidden=(8,),
        go_signal=go_signal,
        heading_gain=heading_gain,
        estimation=estimation,
    )
    env = QuadrupedEnvCfg(
        num_envs=4,
        num_threads=1,
        randomization=RandomizationCfg(enabled=False),
        commands=CommandsCfg(standing_fraction=0.0),
    )
    return TaskCfg(env=env, agent=agent)


def _write_checkpoint(path: Path, cfg: TaskCfg) -> Path:
    """Write a policy with random weights, and a normaliser that is far from the identity."""
    runner = MuteRunner("go1_mute", cfg, None)
    payload = runner.alg.save() | {"task": "go1_mute", "config": to_plain(cfg), "iter": 0}
    state = payload["actor_state_dict"]
    generator = torch.Generator().manual_seed(1)
    for name, low, high in (("_mean", -0.5, 0.5), ("_std", 0.5, 2.0)):
        buffer = state[f"obs_normalizer.{name}"]
        buffer.uniform_(low, high, generator=generator)
    state["mlp.4.weight"] *= 4.0  # the actions of an untrained actor are small
    save_checkpoint(path, policy_part(payload))
    return path


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _write_checkpoint(tmp_path_factory.mktemp("policy") / "random.pt", _make_cfg())


@pytest.fixture(scope="module")
def policy(checkpoint: Path) -> Policy:
    return load_policy(checkpoint)


@pytest.fixture(scope="module")
def exported(policy: Policy, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("export") / "policy.onnx"
    export_policy(policy, path)
    return path


class _OnnxSide:
    """Runs the file for one robot, as another program would."""

    def __init__(self, path: Path):
        self.session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
        self.shapes = {each.name: each.shape for each in self.session.get_inputs()}
        self.recurrent = json.loads(_metadata(path)["recurrent_state"])
        self.reset()

    def reset(self) -> None:
        self.state = {name: np.zeros(self.shapes[name], np.float32) for name in self.recurrent}

    def step(self, obs: torch.Tensor) -> dict[str, np.ndarray]:
        names = [each.name for each in self.session.get_outputs()]
        values = self.session.run(names, {"obs": obs.numpy()} | self.state)
        outputs = dict(zip(names, map(np.asarray, values), strict=True))
        self.state = {name: outputs.pop(after) for name, after in self.recurrent.items()}
        return outputs


def _metadata(path: Path) -> dict[str, str]:
    return {entry.key: entry.value for entry in onnx.load(path).metadata_props}


def _run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=REPOSITORY,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def _assert_same_outputs(policy: Policy, path: Path, steps: int) -> int:
    """Compare torch, which drives one noisy robot, with ONNX; return the number of episodes."""
    env = QuadrupedEnv(dataclasses.replace(policy.cfg.env, num_envs=1, episode_length=4.0))
    torch_side, onnx_side = LearnedController(policy, 1), _OnnxSide(path)
    observations, episodes = env.get_observations(), 1
    for _ in range(steps):
        expected = torch_side.act(observations)
        outputs = onnx_side.step(observations["policy"])
        estimate = torch_side.estimate
        assert estimate is not None
        wanted = {"action": expected, "base_lin_vel": estimate.base_lin_vel}
        if policy.estimator.num_feet:
            wanted["phase"] = estimate.phase
        assert outputs.keys() == wanted.keys()
        for name, value in wanted.items():
            np.testing.assert_allclose(outputs[name], value, rtol=0.0, atol=1e-4, err_msg=name)
        observations, _, dones, _ = env.step(expected)
        if bool(dones.any()):
            torch_side.reset(dones)
            onnx_side.reset()
            episodes += 1
    return episodes


def test_onnx_runtime_reproduces_torch_over_500_closed_loop_steps(policy: Policy, exported: Path):
    assert _assert_same_outputs(policy, exported, steps=500) >= 3


def test_a_policy_whose_actor_ignores_the_phase_is_reproduced_too(tmp_path: Path):
    cfg = _make_cfg(actor_uses_phase=False)
    policy = load_policy(_write_checkpoint(tmp_path / "random.pt", cfg))
    export_policy(policy, tmp_path / "policy.onnx")
    _assert_same_outputs(policy, tmp_path / "policy.onnx", steps=20)


def test_a_policy_with_a_history_and_no_quiet_factor_is_reproduced_too(tmp_path: Path):
    cfg = _make_cfg()
    task = make_task("go1_dreamwaq").agent
    agent = dataclasses.replace(cfg.agent, quiet_factor=False, estimation=task.estimation)
    rewards = dataclasses.replace(cfg.env.rewards, phase_source="true")
    cfg = TaskCfg(env=dataclasses.replace(cfg.env, rewards=rewards), agent=agent)
    policy = load_policy(_write_checkpoint(tmp_path / "random.pt", cfg))
    export_policy(policy, tmp_path / "policy.onnx")
    assert json.loads(_metadata(tmp_path / "policy.onnx")["recurrent_state"]) == {
        "history_in": "history_out"
    }
    assert _assert_same_outputs(policy, tmp_path / "policy.onnx", steps=250) >= 2


@pytest.mark.parametrize("standing", [0.0, 1.0])
def test_a_policy_that_is_told_whether_to_go_is_reproduced_too(tmp_path: Path, standing: float):
    cfg = _make_cfg(go_signal=True)
    commands = dataclasses.replace(cfg.env.commands, standing_fraction=standing)
    cfg = dataclasses.replace(cfg, env=dataclasses.replace(cfg.env, commands=commands))
    policy = load_policy(_write_checkpoint(tmp_path / "told.pt", cfg))
    export_policy(policy, tmp_path / "told.onnx")
    _assert_same_outputs(policy, tmp_path / "told.onnx", steps=20)


def test_a_policy_that_holds_its_heading_is_reproduced_too(tmp_path: Path):
    cfg = _make_cfg(heading_gain=1.5)
    ahead = dataclasses.replace(cfg.env.commands, single_axis_fraction=1.0, standing_fraction=0.2)
    cfg = dataclasses.replace(cfg, env=dataclasses.replace(cfg.env, commands=ahead))
    policy = load_policy(_write_checkpoint(tmp_path / "holds.pt", cfg))
    export_policy(policy, tmp_path / "holds.onnx")
    assert json.loads(_metadata(tmp_path / "holds.onnx")["recurrent_state"])["turned_in"] == (
        "turned_out"
    )
    assert _assert_same_outputs(policy, tmp_path / "holds.onnx", steps=500) >= 2


def test_two_robots_driven_by_torch_and_by_onnx_stay_together(policy: Policy, exported: Path):
    quiet = dataclasses.replace(policy.cfg.env.observations, noise_level=0.0)
    cfg = dataclasses.replace(policy.cfg.env, num_envs=1, observations=quiet, initial_velocity=0.0)
    one, other = QuadrupedEnv(cfg), QuadrupedEnv(cfg)
    torch_side, onnx_side = LearnedController(policy, 1), _OnnxSide(exported)
    start = one.simulation.qpos.clone()
    for _ in range(100):
        _, _, ended, _ = one.step(torch_side.act(one.get_observations()))
        action = onnx_side.step(other.get_observations()["policy"])["action"]
        other.step(torch.from_numpy(action))
        assert not bool(ended.any())
    torch.testing.assert_close(other.simulation.qpos, one.simulation.qpos, rtol=0.0, atol=1e-3)
    assert float((one.simulation.qpos - start).abs().max()) > 0.05


def test_the_graph_has_the_agreed_inputs_and_outputs(exported: Path):
    session = onnxruntime.InferenceSession(exported, providers=["CPUExecutionProvider"])
    inputs = {node.name: node.shape for node in session.get_inputs()}
    outputs = {node.name: node.shape for node in session.get_outputs()}
    assert inputs == {"obs": [1, 46], "h_in": [1, HIDDEN], "c_in": [1, HIDDEN]}
    assert outputs == {
        "action": [1, 12],
        "phase": [1, 4],
        "base_lin_vel": [1, 3],
        "h_out": [1, HIDDEN],
        "c_out": [1, HIDDEN],
    }


def test_the_opset_is_at_least_17(exported: Path):
    versions = {entry.domain: entry.version for entry in onnx.load(exported).opset_import}
    assert versions[""] >= 17


@pytest.mark.parametrize("shipped", [False, True])
def test_the_file_is_of_the_oldest_format_that_has_its_opset(exported: Path, shipped: bool):
    # ONNX Runtime 1.17 refuses formats above 9, and the format came before its operators' version.
    path = RESOURCES / "go1" / "go1_mute.onnx" if shipped else exported
    model = onnx.load(path)
    (opset,) = (entry.version for entry in model.opset_import if not entry.domain)
    assert model.ir_version == onnx.helper.find_min_ir_version_for(model.opset_import) == 8
    assert opset == 18
    onnx.checker.check_model(model, full_check=True)


def test_activations_are_one_operation_each(exported: Path):
    graph = onnx.load(exported).graph
    operations = {node.op_type for node in graph.node} | {
        node.op_type for function in onnx.load(exported).functions for node in function.node
    }
    assert {"Elu", "Tanh"} <= operations
    assert not operations & {"Exp", "Pow", "Max"}


def test_everything_is_in_one_file(exported: Path):
    assert [path.name for path in exported.parent.iterdir()] == ["policy.onnx"]
    model = onnx.load(exported, load_external_data=False)
    locations = {tensor.data_location for tensor in model.graph.initializer}
    assert locations == {onnx.TensorProto.DEFAULT}


def test_the_file_names_no_path_of_the_machine_that_made_it(exported: Path):
    content = exported.read_bytes()
    assert str(REPOSITORY).encode() not in content
    assert b".py" not in content


def test_the_metadata_says_how_the_joints_are_driven(exported: Path):
    metadata = _metadata(exported)
    front, rear = ["0.8", "-1.5"], ["1.0", "-1.5"]
    stance = ["-0.1", *front, "0.1", *front, "-0.1", *rear, "0.1", *rear]
    assert metadata["joint_names"] == ",".join(JOINT_NAMES)
    assert metadata["joint_stiffness"] == ",".join(["20.0"] * 12)
    assert metadata["joint_damping"] == ",".join(["0.5"] * 12)
    assert metadata["default_joint_pos"] == ",".join(stance)
    assert metadata["action_scale"] == ",".join(["0.25"] * 12)
    assert metadata["action_clip"] == "10.0"
    assert metadata["control_dt"] == "0.02"


def test_the_metadata_says_how_the_observation_is_made(exported: Path):
    metadata = _metadata(exported)
    names = [
        "base_ang_vel",
        "projected_gravity",
        "joint_pos",
        "joint_vel",
        "last_action",
        "command",
    ]
    factors = [0.25, 1.0, 1.0, 0.05, 1.0, 1.0]
    assert metadata["observation_names"] == ",".join(names)
    assert json.loads(metadata["observation_scales"]) == dict(zip(names, factors, strict=True))
    assert metadata["command_names"] == "lin_vel_x,lin_vel_y,ang_vel_z,beta"
    assert json.loads(metadata["recurrent_state"]) == {"h_in": "h_out", "c_in": "c_out"}


def test_the_metadata_follows_the_configuration(policy: Policy, tmp_path: Path):
    env = dataclasses.replace(policy.cfg.env, action_scale=0.3, decimation=2)
    cfg = dataclasses.replace(policy.cfg, env=env)
    export_policy(dataclasses.replace(policy, cfg=cfg), tmp_path / "policy.onnx")
    metadata = _metadata(tmp_path / "policy.onnx")
    assert metadata["action_scale"] == ",".join(["0.3"] * 12)
    assert metadata["control_dt"] == "0.01"


def test_a_failed_write_leaves_the_previous_file_whole(
    policy: Policy, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    out = tmp_path / "policy.onnx"
    out.write_bytes(b"previous")

    def fail(source: Path, target: Path) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("mute.support.files.os.replace", fail)
    with pytest.raises(MuteError, match=r"cannot write .*policy\.onnx: No space left on device"):
        export_policy(policy, out)
    assert [path.name for path in tmp_path.iterdir()] == ["policy.onnx"]
    assert out.read_bytes() == b"previous"


def test_the_command_line_writes_the_file_and_says_where(
    checkpoint: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
):
    out = tmp_path / "made" / "policy.onnx"
    assert main(["--policy", str(checkpoint), "--out", str(out)]) == 0
    assert out.is_file()
    assert capfd.readouterr() == (f"wrote {out}\n", "")


def test_a_missing_policy_gives_one_line_and_exit_status_2(tmp_path: Path):
    result = _run("-m", "mute.export", "--policy", str(tmp_path / "no.pt"))
    assert result.returncode == 2
    assert result.stdout == ""
    assert len(result.stderr.splitlines()) == 1
    assert "no.pt" in result.stderr


def test_the_example_walks_for_a_second(exported: Path):
    result = _run(str(EXAMPLE), "--policy", str(exported), "--seconds", "1")
    assert result.returncode == 0, result.stderr
    assert "mean forward speed: " in result.stdout
    assert "min trunk height: " in result.stdout


def test_the_example_stands_before_it_goes_and_says_whether_it_goes_as_asked(exported: Path):
    asked = ("--stand", "1", "--seconds", "1", "--vx", "0.4", "--wz", "0.2")
    result = _run(str(EXAMPLE), "--policy", str(exported), *asked)
    assert result.returncode == 0, result.stderr
    assert [line.split(" s ")[0].strip() for line in result.stdout.splitlines()[:2]] == [
        "1.0",
        "2.0",
    ]
    assert re.search(r"^goes as asked: no \(-?\d+% once begun\)$", result.stdout, re.M)
    result = _run(str(EXAMPLE), "--policy", str(exported), "--seconds", "0.1", "--vx", "0")
    assert "goes as asked" not in result.stdout  # to stand was all
    result = _run(str(EXAMPLE), "--policy", str(exported), "--stand", "-1")
    assert (result.returncode, result.stderr) == (2, "error: --stand must be >= 0, got -1.0\n")


@pytest.mark.parametrize(
    ("asked", "motion", "share"),
    [
        ((0.5, 0.0, 0.0), (0.25, 9.0, 9.0), 0.5),
        ((0.0, 0.0, -0.5), (9.0, 9.0, -0.4), 0.8),
        ((0.3, 0.4, 1.0), (0.3, 0.4, 0.1), 0.1),  # moves as asked, and hardly turns
    ],
)
def test_the_example_tells_which_share_of_a_command_is_done(asked, motion, share):
    assert example._followed(np.array(asked), np.array(motion)) == pytest.approx(share)


def test_the_example_needs_neither_torch_nor_this_project():
    code = (
        f"import runpy, sys; runpy.run_path({str(EXAMPLE)!r}, run_name='example'); "
        "print(sorted({'torch', 'mute', 'envs', 'networks'} & set(sys.modules)))"
    )
    result = _run("-c", code)
    assert result.stdout == "[]\n", result.stderr


def test_the_example_observes_what_the_environment_does(policy: Policy, exported: Path):
    quiet = dataclasses.replace(policy.cfg.env.observations, noise_level=0.0)
    env = QuadrupedEnv(dataclasses.replace(policy.cfg.env, num_envs=1, observations=quiet))
    action = torch.linspace(-1.0, 1.0, 12)
    for _ in range(5):
        env.step(action.unsqueeze(0))
    runner = example.OnnxPolicy(exported)
    robot = example.Robot(example.GO1, runner)
    robot.data.qpos[:] = env.simulation.qpos[0]
    robot.data.qvel[:] = env.simulation.qvel[0]
    parts = robot.observe(action.numpy(), env.commands.command[0].numpy())
    obs = [runner.observation_scales[name] * parts[name] for name in runner.observation_names]
    expected = env.get_observations()["policy"][0]
    np.testing.assert_allclose(np.concatenate(obs), expected, rtol=0.0, atol=1e-5)
    np.testing.assert_allclose(robot.velocity, env.base_lin_vel[0], rtol=0.0, atol=1e-5)


def test_the_example_stands_the_robot_on_the_floor(exported: Path):
    robot = example.Robot(example.GO1, example.OnnxPolicy(exported))
    # The stance's own keyframe touches the ground at this height.
    assert robot.height == pytest.approx(0.32475, abs=1e-4)


def test_the_example_turns_motors_into_servos_that_keep_their_torque_limit(
    exported: Path, tmp_path: Path
):
    robot = example.Robot(write_motor_go1(tmp_path / "motors.xml"), example.OnnxPolicy(exported))
    # 20 N m/rad * 0.1 rad - 0.5 N m s/rad * 0.
    robot.step(robot.stand)
    robot.data.qvel[:] = 0.0
    robot.data.qpos[robot.joint_pos] = robot.stand
    robot.data.ctrl[robot.servos] = robot.stand + 0.1
    example.mujoco.mj_forward(robot.model, robot.data)
    np.testing.assert_allclose(robot.data.actuator_force[robot.servos], 2.0, atol=1e-9)
    robot.data.ctrl[robot.servos] = robot.stand + 3.0
    example.mujoco.mj_forward(robot.model, robot.data)
    np.testing.assert_allclose(robot.data.actuator_force[robot.servos], 20.0, atol=1e-9)


def test_the_example_takes_the_damping_of_joints_for_that_of_a_servo(
    exported: Path, tmp_path: Path
):
    model = write_menagerie_like_go1(tmp_path / "damped.xml")
    robot = example.Robot(model, example.OnnxPolicy(exported))
    robot.data.qvel[:] = 1.0
    robot.data.ctrl[robot.servos] = robot.stand
    example.mujoco.mj_forward(robot.model, robot.data)
    servo = robot.data.actuator_force[robot.servos]
    np.testing.assert_allclose(servo, -0.5, atol=1e-9)
    np.testing.assert_allclose(robot.data.qfrc_damper, 0.0)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--policy", "no.onnx"], "no.onnx"),
        (["--policy", str(EXAMPLE)], "ONNX Runtime cannot read"),
        (["--beta", "1.2"], "--beta must be in [0, 1], got 1.2"),
        (["--seconds", "0"], "--seconds must be > 0, got 0.0"),
        (["--vx", "nan"], "--vx must be in [-2, 2], got nan"),
        (["--model", "no.xml"], "no.xml"),
    ],
)
def test_the_example_tells_bad_input_in_one_line(arguments: list[str], told: str, exported: Path):
    result = _run(str(EXAMPLE), "--policy", str(exported), *arguments)
    assert result.returncode != 0
    assert result.stdout == ""
    assert len(result.stderr.splitlines()) == 1
    assert told in result.stderr
