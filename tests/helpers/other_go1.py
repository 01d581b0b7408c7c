"""Models of a Go1 that are not the project's: what else a policy is run on."""

from __future__ import annotations

from pathlib import Path

import mujoco
from places import REPOSITORY

from mute.envs.scene import JOINT_NAMES

__all__ = ["write_menagerie_like_go1", "write_motor_go1"]

_OURS = REPOSITORY / "resources" / "go1" / "go1.xml"


def write_motor_go1(path: Path) -> Path:
    """Write a Go1 driven by torque motors, and without a floor."""
    text = _OURS.read_text()
    start, end = text.index("<actuator>"), text.index("</actuator>")
    motors = "".join(
        f'<motor name="{name}" joint="{name}" ctrlrange="-20 20"/>' for name in JOINT_NAMES
    )
    text = text[:start] + "<actuator>" + motors + text[end:]
    start, end = text.index("<keyframe>"), text.index("</keyframe>") + len("</keyframe>")
    path.write_text(text[:start] + text[end:])
    return path


def write_menagerie_like_go1(path: Path) -> Path:
    """Write a Go1 with the figures of MuJoCo Menagerie's: its joints, contacts and solver.

    They are those of `unitree_go1/go1.xml` at its commit 28ffb48: joints damped by 1 and 2 N m
    s/rad in place of a servo's damping, an armature of 0.01 kg m^2, 0.2 N m of dry friction, stiff
    servos, soft feet with torsional and rolling friction, elliptic cones and steps of 2 ms.
    """
    spec = mujoco.MjSpec.from_file(str(_OURS))
    spec.option.timestep = 0.002
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 100.0
    for joint in spec.joints:
        if joint.name not in JOINT_NAMES:
            continue
        joint.damping = (1.0 if joint.name.endswith("hip_joint") else 2.0, 0.0, 0.0)
        joint.armature, joint.frictionloss = 0.01, 0.2
    for actuator in spec.actuators:
        limit = 35.55 if actuator.target.endswith("calf_joint") else 23.7
        actuator.forcerange = (-limit, limit)
        actuator.set_to_position(kp=100.0, kv=0.0)
    for geom in spec.geoms:
        if geom.name.endswith("_foot"):
            geom.priority, geom.condim = 1, 6
            geom.solimp = (0.015, 1.0, 0.031, 0.5, 2.0)
    path.write_text(spec.to_xml())
    return path
