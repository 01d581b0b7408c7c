"""The legs' geometry and dynamics are the model's."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from mute.controllers.mpc.body import Body
from mute.controllers.mpc.leg_dynamics import LegDynamics
from mute.controllers.mpc.legs import (
    foot_jacobians,
    foot_positions,
    joints_of_feet,
    sole_jacobians,
)
from mute.envs.base_state import GRAVITY
from mute.envs.scene import FOOT_RADIUS, LEGS, SceneCfg, build_scene

MODEL = build_scene(SceneCfg(), pictured=False)
STAND = MODEL.key("stand").qpos


def _poses(seed: int, still_hips: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Return joint positions and speeds around the stance. Shapes: (5, 4, 3)."""
    generator = np.random.default_rng(seed)
    joint_pos = STAND[7:].reshape(4, 3) + generator.uniform(-0.4, 0.4, (5, 4, 3))
    joint_vel = generator.uniform(-6.0, 6.0, (5, 4, 3))
    if still_hips:
        joint_vel[..., 0] = 0.0
    return joint_pos, joint_vel


def _moved(joint_pos: np.ndarray, joint_vel: np.ndarray | None = None) -> mujoco.MjData:
    """Return the model, its trunk level, at the origin and at rest, in the air."""
    data = mujoco.MjData(MODEL)
    data.qpos[:3], data.qpos[3:7], data.qpos[7:] = 0.0, (1.0, 0.0, 0.0, 0.0), joint_pos.ravel()
    data.qpos[2] = 5.0
    if joint_vel is not None:
        data.qvel[6:] = joint_vel.ravel()
    mujoco.mj_forward(MODEL, data)
    return data


def test_feet_and_their_jacobians_are_the_models():
    joint_pos, _ = _poses(0)
    feet, jacobians = foot_positions(joint_pos), foot_jacobians(joint_pos)
    for pose in range(len(joint_pos)):
        data = _moved(joint_pos[pose])
        for leg, name in enumerate(LEGS):
            site = MODEL.site(f"{name}_foot").id
            np.testing.assert_allclose(feet[pose, leg], data.site_xpos[site] - (0, 0, 5), atol=1e-6)
            jacobian = np.zeros((3, MODEL.nv))
            mujoco.mj_jacSite(MODEL, data, jacobian, None, site)
            own = jacobian[:, 6 + 3 * leg : 9 + 3 * leg]
            np.testing.assert_allclose(jacobians[pose, leg], own, atol=1e-6)


def test_a_sole_moves_as_a_point_that_is_fixed_to_the_calf():
    joint_pos, _ = _poses(1)
    below = np.array([[[0.0, 0.0, -FOOT_RADIUS]]])
    jacobians = foot_jacobians(joint_pos) + sole_jacobians(joint_pos, below)
    for pose in range(len(joint_pos)):
        data = _moved(joint_pos[pose])
        for leg, name in enumerate(LEGS):
            point = data.site_xpos[MODEL.site(f"{name}_foot").id] - (0.0, 0.0, FOOT_RADIUS)
            jacobian = np.zeros((3, MODEL.nv))
            calf = MODEL.body(f"{name}_calf").id
            mujoco.mj_jac(MODEL, data, jacobian, None, point, calf)
            own = jacobian[:, 6 + 3 * leg : 9 + 3 * leg]
            np.testing.assert_allclose(jacobians[pose, leg], own, atol=1e-6)


def test_joints_that_put_feet_somewhere_put_them_there():
    joint_pos, _ = _poses(2)
    np.testing.assert_allclose(joints_of_feet(foot_positions(joint_pos)), joint_pos, atol=1e-6)


def test_a_foot_out_of_reach_is_brought_as_near_as_the_leg_gets():
    feet = foot_positions(STAND[None, 7:].reshape(1, 4, 3))
    feet[..., 2] -= 1.0
    joint_pos = joints_of_feet(feet)
    assert np.isfinite(joint_pos).all()
    there = foot_positions(joint_pos)
    assert (there[..., 2] < -0.4).all()


def test_the_body_is_the_models():
    body = Body.of(MODEL)
    data = mujoco.MjData(MODEL)
    mujoco.mj_resetDataKeyframe(MODEL, data, MODEL.key("stand").id)
    mujoco.mj_forward(MODEL, data)
    assert body.mass == pytest.approx(MODEL.body_mass.sum())
    np.testing.assert_allclose(body.com, data.subtree_com[1] - data.xpos[1], atol=1e-6)
    expected = np.zeros((3, 3))
    for index in range(1, MODEL.nbody):
        turn = data.ximat[index].reshape(3, 3)
        arm = data.xipos[index] - data.subtree_com[1]
        mass = MODEL.body_mass[index]
        expected += turn @ np.diag(MODEL.body_inertia[index]) @ turn.T
        expected += mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    np.testing.assert_allclose(body.inertia, expected, atol=1e-6)
    np.testing.assert_array_equal(body.stiffness, 20.0)
    np.testing.assert_array_equal(body.damping, 0.5)


def _inertia(joint_pos: np.ndarray) -> np.ndarray:
    """Return what it takes to speed up each joint alone, all else at rest. Shape: (n, 4, 3, 3)."""
    legs, still = LegDynamics(MODEL), np.zeros_like(joint_pos)
    nothing = np.zeros((len(joint_pos), 3))
    columns = [
        legs.torques(joint_pos, still, still + np.eye(3)[joint], nothing) for joint in range(3)
    ]
    return np.stack(columns, axis=-1)


def test_inertias_of_legs_are_the_models_to_a_few_percent():
    joint_pos, _ = _poses(3)
    inertia = _inertia(joint_pos)
    for pose in range(len(joint_pos)):
        data = _moved(joint_pos[pose])
        whole = np.zeros((MODEL.nv, MODEL.nv))
        mujoco.mj_fullM(MODEL, data, whole)
        for leg in range(4):
            block = slice(6 + 3 * leg, 9 + 3 * leg)
            error = np.abs(inertia[pose, leg] - whole[block, block]).max()
            assert error < 0.05 * np.abs(whole[block, block]).max()


def test_torques_of_a_motion_are_the_models_where_hips_keep_still():
    joint_pos, joint_vel = _poses(4, still_hips=True)
    legs = LegDynamics(MODEL)
    gravity = np.tile((0.0, 0.0, -GRAVITY), (len(joint_pos), 1))
    torque = legs.torques(joint_pos, joint_vel, np.zeros_like(joint_pos), gravity)
    for pose in range(len(joint_pos)):
        data = _moved(joint_pos[pose], joint_vel[pose])
        expected = data.qfrc_bias[6:].reshape(4, 3)
        np.testing.assert_allclose(torque[pose, :, 1:], expected[:, 1:], atol=2e-3)
        np.testing.assert_allclose(torque[pose, :, 0], expected[:, 0], atol=0.02)
