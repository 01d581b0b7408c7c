"""Run an exported policy on a Go1 model, with ONNX Runtime, NumPy and MuJoCo alone.

The program knows nothing of the project that made the policy: joints, gains, stance, the layout of
the observation and the recurrent state all come from the metadata of the ONNX file. Any MJCF of a
Go1 whose joints have the names of the metadata will do: every actuator of a leg is made a position
servo with the metadata's stiffness and damping, and keeps its torque limit. Damping that the model
gives the joints themselves stands for a servo's, so the metadata's takes its place.

    python examples/run_onnx.py --policy policy.onnx --stand 3 --vx 0.5 --beta 0.7
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import onnxruntime

GO1 = Path(__file__).resolve().parents[1] / "resources" / "go1" / "go1.xml"
RANGES = {"vx": (-2.0, 2.0), "vy": (-1.0, 1.0), "wz": (-2.0, 2.0), "beta": (0.0, 1.0)}
MOTION = ("lin_vel_x", "lin_vel_y", "ang_vel_z")
COMMAND_ARGUMENTS = {"lin_vel_x": "vx", "lin_vel_y": "vy", "ang_vel_z": "wz", "beta": "beta"}
FALLEN = 0.5
"""Cosine of the trunk's tilt below which the robot counts as fallen."""
GOING = 0.4
"""Share of the command at which the robot counts as going."""
START = 2.0
"""Time that it may take until it goes, s; half of all that it has where that is less than 4 s."""


class OnnxPolicy:
    """An exported policy: its graph, its metadata and its recurrent state."""

    def __init__(self, path: Path) -> None:
        """Load the file and start with a zero state.

        Raises:
            ValueError: If it is missing, no ONNX file, or lacks metadata.
        """
        if not path.is_file():
            raise ValueError(f"--policy: there is no file {path}")
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1  # the graph is too small to share
        try:
            self.session = onnxruntime.InferenceSession(
                path.read_bytes(), options, providers=["CPUExecutionProvider"]
            )
        except Exception as error:  # ONNX Runtime's own errors have no common class
            raise ValueError(f"--policy: ONNX Runtime cannot read {path}: {error}") from error
        metadata = self.session.get_modelmeta().custom_metadata_map
        try:
            self.joint_names = metadata["joint_names"].split(",")
            self.stiffness = _numbers(metadata["joint_stiffness"])
            self.damping = _numbers(metadata["joint_damping"])
            self.default_joint_pos = _numbers(metadata["default_joint_pos"])
            self.action_scale = _numbers(metadata["action_scale"])
            self.action_clip = float(metadata.get("action_clip", "inf"))
            self.observation_names = metadata["observation_names"].split(",")
            self.observation_scales = json.loads(metadata["observation_scales"])
            self.command_names = metadata["command_names"].split(",")
            self.control_dt = float(metadata["control_dt"])
            self.recurrent_state = json.loads(metadata["recurrent_state"])
        except KeyError as error:
            raise ValueError(f"--policy: {path} has no metadata {error}") from error
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        shapes = {node.name: node.shape for node in self.session.get_inputs()}
        self.state = {name: np.zeros(shapes[name], np.float32) for name in self.recurrent_state}

    def act(self, parts: dict[str, np.ndarray]) -> np.ndarray:
        """Return the action for one control step and move the recurrent state on.

        Args:
            parts: Each part of the observation by its name, unscaled.
        """
        obs = [self.observation_scales[name] * parts[name] for name in self.observation_names]
        inputs = {"obs": np.concatenate(obs)[None].astype(np.float32), **self.state}
        names = [node.name for node in self.session.get_outputs()]
        outputs = dict(zip(names, self.session.run(names, inputs), strict=True))
        self.state = {name: outputs[new] for name, new in self.recurrent_state.items()}
        action = np.asarray(outputs["action"])[0]
        return np.clip(action, -self.action_clip, self.action_clip)


class Robot:
    """A Go1 in MuJoCo, with the joints in the policy's order."""

    def __init__(self, model_path: Path, policy: OnnxPolicy) -> None:
        """Compile the model with the policy's gains and stand it on the floor.

        Raises:
            ValueError: If the model cannot be read or is not such a robot.
        """
        spec = mujoco.MjSpec.from_file(str(model_path))
        floor = _floor(spec)
        _set_servos(spec, policy)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        roots = np.flatnonzero(self.model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
        if len(roots) != 1:
            raise ValueError(f"--model: {model_path} has {len(roots)} free joints, a robot has 1")
        joints = [self.model.joint(name).id for name in policy.joint_names]
        self.root_pos = int(self.model.jnt_qposadr[roots[0]])
        self.root_vel = int(self.model.jnt_dofadr[roots[0]])
        self.joint_pos = self.model.jnt_qposadr[joints]
        self.joint_vel = self.model.jnt_dofadr[joints]
        driven = self.model.actuator_trnid[:, 0].tolist()
        self.servos = [driven.index(joint) for joint in joints]
        self.stand = policy.default_joint_pos
        self.substeps = max(1, round(policy.control_dt / self.model.opt.timestep))
        self.model.opt.timestep = policy.control_dt / self.substeps
        self._stand_up(floor)

    def observe(self, last_action: np.ndarray, command: np.ndarray) -> dict[str, np.ndarray]:
        """Return every part of an observation that is known here, unscaled, in the body frame."""
        qpos, qvel = self.data.qpos, self.data.qvel
        return {
            # MuJoCo gives a free joint's angular velocity in the body frame.
            "base_ang_vel": qvel[self.root_vel + 3 : self.root_vel + 6],
            "projected_gravity": self._in_body_frame(np.array([0.0, 0.0, -1.0])),
            "joint_pos": qpos[self.joint_pos] - self.stand,
            "joint_vel": qvel[self.joint_vel],
            "last_action": last_action,
            "command": command,
        }

    def step(self, set_points: np.ndarray) -> None:
        """Hold set points, in rad, for one control step."""
        self.data.ctrl[self.servos] = set_points
        mujoco.mj_step(self.model, self.data, self.substeps)

    @property
    def velocity(self) -> np.ndarray:
        """Velocity of the trunk in the body frame, m/s. Shape: (3,)."""
        return self._in_body_frame(self.data.qvel[self.root_vel : self.root_vel + 3])

    @property
    def motion(self) -> np.ndarray:
        """What commands are about: forward and sideways velocity, m/s, and yaw rate, rad/s."""
        return np.append(self.velocity[:2], self.data.qvel[self.root_vel + 5])

    @property
    def height(self) -> float:
        """Height of the trunk, m."""
        return float(self.data.qpos[self.root_pos + 2])

    @property
    def upright(self) -> float:
        """Cosine of the trunk's tilt."""
        return -float(self._in_body_frame(np.array([0.0, 0.0, -1.0]))[2])

    def _stand_up(self, floor: str) -> None:
        """Take the stance, with the lowest point of the robot on the floor."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[self.joint_pos] = self.stand
        self.data.qpos[self.root_pos + 2] = 1.0
        mujoco.mj_forward(self.model, self.data)
        collides = (self.model.geom_contype | self.model.geom_conaffinity) > 0
        shapes = np.flatnonzero(collides & (self.model.geom_bodyid > 0))
        plane = self.model.geom(floor).id
        gaps = [
            mujoco.mj_geomDistance(self.model, self.data, int(shape), plane, 2.0, None)
            for shape in shapes
        ]
        self.data.qpos[self.root_pos + 2] -= min(gaps)
        self.data.ctrl[self.servos] = self.stand
        mujoco.mj_forward(self.model, self.data)

    def _in_body_frame(self, vector: np.ndarray) -> np.ndarray:
        """Turn a vector of the world frame into the trunk's frame."""
        inverse, result = np.zeros(4), np.zeros(3)
        mujoco.mju_negQuat(inverse, self.data.qpos[self.root_pos + 3 : self.root_pos + 7])
        mujoco.mju_rotVecQuat(result, vector, inverse)
        return result


@dataclass
class Summary:
    """What a walk was like."""

    speed: float
    """Mean forward velocity, m/s."""
    min_height: float
    """Least height of the trunk, m."""
    fallen: bool
    """Whether the trunk ever tipped over."""
    followed: float
    """Share of the command that was done once the robot had had `START` for it; NaN where to stand
    was all."""


def walk(
    policy: OnnxPolicy, robot: Robot, command: dict[str, float], stand: float, seconds: float
) -> Summary:
    """Let the policy drive the robot, and print how it goes once a second.

    Args:
        policy: The policy.
        robot: The robot.
        command: What is asked for, by the policy's `command_names`.
        stand: Time that it is asked to stand before, s; it counts for falls and height alone.
        seconds: Time that it has for the command, s.
    """
    walking = np.array(list(command.values()))
    standing = np.where([name == "beta" for name in command], walking, 0.0)
    dt = policy.control_dt
    before, after = round(stand / dt), max(1, round(seconds / dt))
    action = np.zeros(len(policy.joint_names))
    motions, heights, uprights = [], [], []
    per_second = round(1.0 / dt)
    for step in range(1, before + after + 1):
        action = policy.act(robot.observe(action, standing if step <= before else walking))
        robot.step(policy.default_joint_pos + policy.action_scale * action)
        motions.append(robot.motion)
        heights.append(robot.height)
        uprights.append(robot.upright)
        if step % per_second == 0:
            recent = np.mean(motions[-per_second:], axis=0)[0]
            print(f"{step * dt:6.1f} s  {recent:6.3f} m/s  {heights[-1]:.3f} m")
    done = np.mean(motions[before + min(round(START / dt), after // 2) :], axis=0)
    speed = float(np.mean(motions[before:], axis=0)[0])
    followed = _followed(np.array([command.get(name, 0.0) for name in MOTION]), done)
    return Summary(speed, min(heights), min(uprights) < FALLEN, followed)


def _followed(asked: np.ndarray, motion: np.ndarray) -> float:
    """Return the share of what is asked that is done, of moving or turning whichever is less.

    Args:
        asked: Forward and sideways velocity, m/s, and yaw rate, rad/s. Shape: (3,).
        motion: What was done of each. Shape: (3,).
    """
    shares = []
    if asked[:2].any():
        shares.append(float(asked[:2] @ motion[:2] / (asked[:2] @ asked[:2])))
    if asked[2]:
        shares.append(float(motion[2] / asked[2]))
    return min(shares, default=math.nan)


def main() -> int:
    """Run the command line and return its exit status."""
    args = _arguments()
    try:
        _check(args)
        policy = OnnxPolicy(args.policy)
        command = {name: _command_value(args, name) for name in policy.command_names}
        robot = Robot(args.model, policy)
    except ValueError as error:
        print(f"error: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    summary = walk(policy, robot, command, args.stand, args.seconds)
    print(f"mean forward speed: {summary.speed:.3f} m/s")
    print(f"min trunk height: {summary.min_height:.3f} m")
    print(f"fell: {'yes' if summary.fallen else 'no'}")
    if not math.isnan(summary.followed):
        goes = summary.followed >= GOING and not summary.fallen
        print(f"goes as asked: {'yes' if goes else 'no'} ({summary.followed:.0%} once begun)")
    return 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Run an exported policy on a Go1 model.")
    parser.add_argument("--policy", type=Path, required=True, help="ONNX file")
    parser.add_argument("--model", type=Path, default=GO1, help="MJCF of a Go1 [%(default)s]")
    parser.add_argument("--vx", type=float, default=0.5, help="forward speed, m/s [%(default)s]")
    parser.add_argument("--vy", type=float, default=0.0, help="speed to the left, m/s")
    parser.add_argument("--wz", type=float, default=0.0, help="turning rate to the left, rad/s")
    parser.add_argument("--beta", type=float, default=0.0, help="quiet factor, 0 to 1")
    parser.add_argument("--stand", type=float, default=0.0, help="time to stand before, s")
    parser.add_argument("--seconds", type=float, default=10.0, help="simulated time [%(default)s]")
    return parser.parse_args()


def _check(args: argparse.Namespace) -> None:
    """Raise ValueError at the first argument that is out of its range."""
    for name, (low, high) in RANGES.items():
        value = getattr(args, name)
        if not low <= value <= high:
            raise ValueError(f"--{name} must be in [{low:g}, {high:g}], got {value}")
    if not (args.stand >= 0.0 and math.isfinite(args.stand)):
        raise ValueError(f"--stand must be >= 0, got {args.stand}")
    if not (args.seconds > 0.0 and math.isfinite(args.seconds)):
        raise ValueError(f"--seconds must be > 0, got {args.seconds}")


def _command_value(args: argparse.Namespace, name: str) -> float:
    if name not in COMMAND_ARGUMENTS:
        raise ValueError(f"--policy takes a command {name!r} that this program does not know")
    return getattr(args, COMMAND_ARGUMENTS[name])


def _numbers(text: str) -> np.ndarray:
    return np.array([float(word) for word in text.split(",")])


def _floor(spec: mujoco.MjSpec) -> str:
    """Return the name of the model's floor, and add one where it has none."""
    planes = [g for g in spec.worldbody.geoms if g.type == mujoco.mjtGeom.mjGEOM_PLANE]
    if not planes:
        planes = [
            spec.worldbody.add_geom(
                type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0.0, 0.0, 0.05), friction=(0.8, 0.02, 0.01)
            )
        ]
    planes[0].name = planes[0].name or "floor"
    return planes[0].name


def _set_servos(spec: mujoco.MjSpec, policy: OnnxPolicy) -> None:
    """Make the joints' actuators position servos with the policy's gains, torque limits kept.

    Raises:
        ValueError: If a joint is missing or has not exactly one actuator.
    """
    gains = zip(policy.joint_names, policy.stiffness, policy.damping, strict=True)
    for name, stiffness, damping in gains:
        joint = spec.joint(name)
        if joint is None:
            raise ValueError(f"--model has no joint {name!r}, which the policy drives")
        actuators = [actuator for actuator in spec.actuators if actuator.target == name]
        if len(actuators) != 1:
            raise ValueError(f"--model: joint {name!r} has {len(actuators)} actuators, not 1")
        actuator = actuators[0]
        is_motor = actuator.biastype == mujoco.mjtBias.mjBIAS_NONE
        if is_motor and actuator.forcerange[0] >= actuator.forcerange[1]:
            actuator.forcerange = actuator.ctrlrange  # what limits a motor's command is its torque
        actuator.set_to_position(kp=stiffness, kv=damping)
        joint.damping = np.zeros_like(joint.damping)
        actuator.ctrllimited = mujoco.mjtLimited.mjLIMITED_FALSE


if __name__ == "__main__":
    sys.exit(main())
