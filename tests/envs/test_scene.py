"""Tests of the robot's MJCF and of the scene around it."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest
from places import REPOSITORY

from mute.envs.scene import (
    FOOT_RADIUS,
    JOINT_NAMES,
    LEGS,
    STAND_HEIGHT,
    STAND_JOINT_POS,
    FloorPatch,
    SceneCfg,
    build_scene,
)
from mute.envs.sensors import sensor_slice

HIP_INERTIA = (0.000734064, 0.000468438, 0.000398719)
THIGH_INERTIA = (0.00478717, 0.00460903, 0.000709268)
RIGHT_THIGH_QUAT = (0.65243, -0.0272313, 0.0775126, 0.753383)
LEFT_THIGH_QUAT = (0.753383, 0.0775126, -0.0272313, 0.65243)

# Body: parent, position, mass, centre of mass, inertial quaternion, principal moments.
PUBLISHED_BODIES = {
    "trunk": (
        "world",
        (0.0, 0.0, 0.445),
        5.204,
        (0.0223, 0.002, -0.0005),
        (-0.00342088, 0.705204, 0.000106698, 0.708996),
        (0.0716565, 0.0630105, 0.0168101),
    ),
    "FR_hip": (
        "trunk",
        (0.1881, -0.04675, 0.0),
        0.68,
        (-0.0049166, 0.00762615, -8.865e-05),
        (0.507341, 0.514169, 0.495027, 0.482891),
        HIP_INERTIA,
    ),
    "FL_hip": (
        "trunk",
        (0.1881, 0.04675, 0.0),
        0.68,
        (-0.0049166, -0.00762615, -8.865e-05),
        (0.482891, 0.495027, 0.514169, 0.507341),
        HIP_INERTIA,
    ),
    "RR_hip": (
        "trunk",
        (-0.1881, -0.04675, 0.0),
        0.68,
        (0.0049166, 0.00762615, -8.865e-05),
        (0.495027, 0.482891, 0.507341, 0.514169),
        HIP_INERTIA,
    ),
    "RL_hip": (
        "trunk",
        (-0.1881, 0.04675, 0.0),
        0.68,
        (0.0049166, -0.00762615, -8.865e-05),
        (0.514169, 0.507341, 0.482891, 0.495027),
        HIP_INERTIA,
    ),
}
for _leg in LEGS:
    _left = _leg.endswith("L")
    PUBLISHED_BODIES[f"{_leg}_thigh"] = (
        f"{_leg}_hip",
        (0.0, 0.08 if _left else -0.08, 0.0),
        1.009,
        (-0.00304722, -0.019315 if _left else 0.019315, -0.0305004),
        LEFT_THIGH_QUAT if _left else RIGHT_THIGH_QUAT,
        THIGH_INERTIA,
    )
    PUBLISHED_BODIES[f"{_leg}_calf"] = (
        f"{_leg}_thigh",
        (0.0, 0.0, -0.213),
        0.195862,
        (0.00429862, 0.000976676, -0.146197),
        (0.691246, 0.00357467, 0.00511118, 0.722592),
        (0.00149767, 0.00148468, 3.58427e-05),
    )

# Joint kind: axis, range, armature (rotor inertia times gear ratio squared), torque limit.
PUBLISHED_JOINTS = {
    "hip": ((1, 0, 0), (-0.863, 0.863), 0.000111842 * 6**2, 23.7),
    "thigh": ((0, 1, 0), (-0.686, 4.501), 0.000111842 * 6**2, 23.7),
    "calf": ((0, 1, 0), (-2.818, -0.888), 0.000111842 * 9**2, 35.55),
}


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return build_scene(SceneCfg())


def _make_standing(model: mujoco.MjModel) -> mujoco.MjData:
    """Return data at the `stand` keyframe, everything derived from it computed."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("stand").id)
    mujoco.mj_forward(model, data)
    return data


def _make_airborne(model: mujoco.MjModel) -> mujoco.MjData:
    """Return data of a robot in the standing pose 2 m above the floor."""
    data = _make_standing(model)
    data.qpos[2] = 2.0
    mujoco.mj_forward(model, data)
    return data


def _touching_geoms(model: mujoco.MjModel, data: mujoco.MjData) -> set[str]:
    """Return the names of the robot's geoms that are in contact."""
    floor = model.geom("floor").id
    return {
        model.geom(int(geom)).name for pair in data.contact.geom for geom in pair if geom != floor
    }


# The robot against the published figures.


def test_the_robot_weighs_what_is_published(model):
    assert model.body_mass.sum() == pytest.approx(12.743, abs=0.001)


def test_there_are_no_bodies_but_the_published_ones(model):
    assert {model.body(i).name for i in range(1, model.nbody)} == set(PUBLISHED_BODIES)


@pytest.mark.parametrize("name", PUBLISHED_BODIES)
def test_a_body_has_the_published_place_mass_and_inertia(model, name):
    parent, pos, mass, com, quat, inertia = PUBLISHED_BODIES[name]
    body = model.body(name)
    assert model.body(int(body.parentid[0])).name == parent
    np.testing.assert_allclose(body.pos, pos, atol=1e-12)
    np.testing.assert_allclose(body.mass, mass, rtol=1e-9)
    np.testing.assert_allclose(body.ipos, com, atol=1e-12)
    np.testing.assert_allclose(body.iquat, np.array(quat) / np.linalg.norm(quat), atol=1e-9)
    np.testing.assert_allclose(body.inertia, inertia, rtol=1e-9)


@pytest.mark.parametrize("name", JOINT_NAMES)
def test_a_joint_has_the_published_axis_range_and_armature(model, name):
    axis, joint_range, armature, _ = PUBLISHED_JOINTS[name.split("_")[1]]
    joint = model.joint(name)
    np.testing.assert_array_equal(joint.axis, axis)
    np.testing.assert_allclose(joint.range, joint_range)
    assert model.jnt_limited[joint.id]
    np.testing.assert_allclose(joint.armature, armature, rtol=1e-6)
    np.testing.assert_array_equal(joint.damping, 0.0)


def test_joints_and_actuators_come_leg_by_leg_after_the_free_root(model):
    assert [model.joint(i).name for i in range(model.njnt)] == ["root", *JOINT_NAMES]
    driven = [model.joint(int(j)).name for j in model.actuator_trnid[:, 0]]
    assert driven == list(JOINT_NAMES)


def test_the_foot_is_a_rubber_sphere_at_the_end_of_the_calf(model):
    for leg in LEGS:
        geom = model.geom(f"{leg}_foot")
        assert geom.type[0] == mujoco.mjtGeom.mjGEOM_SPHERE
        assert geom.size[0] == FOOT_RADIUS
        np.testing.assert_allclose(geom.pos, (0, 0, -0.213))
        np.testing.assert_allclose(model.site(f"{leg}_foot").pos, (0, 0, -0.213))


def test_the_imu_sits_where_it_is_published(model):
    imu = model.site("imu")
    assert model.body(int(imu.bodyid[0])).name == "trunk"
    np.testing.assert_allclose(imu.pos, (-0.01592, -0.06659, -0.00617))


def test_nothing_that_is_only_looked_at_can_touch(model):
    looks = model.geom_group == 2
    assert looks.sum() > 30
    assert not (model.geom_contype | model.geom_conaffinity)[looks].any()


# The motors.


def test_a_motor_pulls_with_twenty_newton_metres_per_radian(model):
    data = _make_airborne(model)
    data.ctrl[:] = data.qpos[7:] + 0.1
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.actuator_force, 20 * 0.1, rtol=1e-9)


def test_a_motor_brakes_with_half_a_newton_metre_per_radian_a_second(model):
    data = _make_airborne(model)
    data.qvel[6:] = 3.0
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.actuator_force, -0.5 * 3.0, rtol=1e-9)


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_motor_stops_at_its_torque_limit(model, sign):
    data = _make_airborne(model)
    data.ctrl[:] = data.qpos[7:] + sign * 10.0  # asks for 200 N m
    mujoco.mj_forward(model, data)
    limits = [PUBLISHED_JOINTS[name.split("_")[1]][3] for name in JOINT_NAMES]
    np.testing.assert_allclose(data.actuator_force, np.multiply(sign, limits), rtol=1e-9)


def test_the_motor_torque_reaches_its_joint(model):
    data = _make_airborne(model)
    data.ctrl[:] = data.qpos[7:] + np.linspace(-0.5, 0.5, 12)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.qfrc_actuator[6:], 20 * np.linspace(-0.5, 0.5, 12), atol=1e-9)


# Standing.


def test_the_stand_keyframe_is_the_standing_pose(model):
    key = model.key("stand")
    np.testing.assert_allclose(key.qpos[7:], STAND_JOINT_POS)
    np.testing.assert_allclose(key.ctrl, STAND_JOINT_POS)
    assert key.qpos[2] == STAND_HEIGHT


def test_the_lowest_feet_just_touch_in_the_stand_keyframe(model):
    data = _make_standing(model)
    lowest = min(data.geom(f"{leg}_foot").xpos[2] for leg in LEGS) - FOOT_RADIUS
    assert lowest == pytest.approx(0.0, abs=5e-5)


def test_the_robot_settles_on_its_feet_alone(model):
    data = _make_standing(model)
    for _ in range(200):
        mujoco.mj_step(model, data)
        assert _touching_geoms(model, data) <= {f"{leg}_foot" for leg in LEGS}
    assert _touching_geoms(model, data) == {f"{leg}_foot" for leg in LEGS}
    assert 0.25 < data.qpos[2] < STAND_HEIGHT


def _balance(model: mujoco.MjModel) -> mujoco.MjData:
    """Return data of a robot in the standing pose, its feet pushed only upwards, at rest.

    The trunk is pitched so that all feet reach the floor, and the targets lead the pose by the
    torque that the weight asks for: without that lead, springs of 20 N m/rad sag by centimetres.
    """
    data = _make_standing(model)
    front, rear = data.site("FR_foot").xpos.copy(), data.site("RR_foot").xpos.copy()
    pitch = math.atan2(front[2] - rear[2], front[0] - rear[0])
    data.qpos[3:7] = (math.cos(pitch / 2), 0.0, math.sin(pitch / 2), 0.0)
    mujoco.mj_forward(model, data)
    # Where two feet share the weight, MuJoCo's soft contact gives way by less than a millimetre.
    data.qpos[2] += FOOT_RADIUS - data.site("FR_foot").xpos[2] - 0.0005
    mujoco.mj_forward(model, data)
    lift = np.zeros((model.nv, 4))  # generalised force of one newton upwards at each foot
    for column, leg in enumerate(LEGS):
        jacobian = np.zeros((3, model.nv))
        site = model.site(f"{leg}_foot").id
        mujoco.mj_jacSite(model, data, jacobian, None, site)
        lift[:, column] = jacobian[2]
    weights = np.linalg.lstsq(lift[:6], data.qfrc_bias[:6], rcond=None)[0]
    torque = data.qfrc_bias[6:] - (lift @ weights)[6:]
    data.ctrl[:] = data.qpos[7:] + torque / 20.0
    return data


def test_the_robot_stands_still_for_five_seconds(model):
    data = _balance(model)
    for _ in range(200):
        mujoco.mj_step(model, data)
    before = data.qpos.copy()
    for _ in range(1000):
        mujoco.mj_step(model, data)
        assert _touching_geoms(model, data) == {f"{leg}_foot" for leg in LEGS}
    np.testing.assert_allclose(data.qpos[:3], before[:3], atol=1e-3)
    np.testing.assert_allclose(data.qpos[3:7], before[3:7], atol=2e-3)
    np.testing.assert_allclose(data.qpos[7:], STAND_JOINT_POS, atol=0.03)


def test_few_solver_iterations_walk_the_same_path_as_many():
    paths = []
    for iterations, ls_iterations in ((SceneCfg().iterations, SceneCfg().ls_iterations), (100, 50)):
        model = build_scene(SceneCfg(iterations=iterations, ls_iterations=ls_iterations))
        data = _make_standing(model)
        data.qpos[2] += 0.1
        data.qpos[3:7] = (0.99, 0.1, -0.05, 0.05)
        rng = np.random.default_rng(3)
        path = []
        for _ in range(100):
            data.ctrl[:] = STAND_JOINT_POS + rng.normal(0, 0.25, 12)
            mujoco.mj_step(model, data, nstep=4)
            path.append(data.qpos.copy())
        paths.append(path)
    np.testing.assert_allclose(paths[0], paths[1], atol=1e-6)


# The sensors.


def test_foot_position_sensors_report_the_foot_centre(model):
    data = _make_standing(model)
    reported = data.sensordata[sensor_slice(model, "FR_foot_pos", 4)].reshape(4, 3)
    expected = [data.geom(f"{leg}_foot").xpos for leg in LEGS]
    np.testing.assert_allclose(reported, expected, atol=1e-12)


def test_foot_velocity_sensors_agree_with_finite_differences(model):
    data = _make_airborne(model)
    rng = np.random.default_rng(0)
    data.qvel[:] = rng.normal(0, 1, model.nv)
    mujoco.mj_forward(model, data)
    reported = data.sensordata[sensor_slice(model, "FR_foot_vel", 4)].copy()

    positions = []
    start, velocity = data.qpos.copy(), data.qvel.copy()
    for dt in (-1e-5, 1e-5):
        data.qpos[:] = start
        mujoco.mj_integratePos(model, data.qpos, velocity, dt)
        mujoco.mj_forward(model, data)
        positions.append(data.sensordata[sensor_slice(model, "FR_foot_pos", 4)].copy())
    np.testing.assert_allclose(reported, (positions[1] - positions[0]) / 2e-5, atol=1e-6)


def _sunk(model: mujoco.MjModel, geom: str) -> mujoco.MjData:
    """Return data of a robot turned and lowered until `geom` is its lowest shape, in the floor."""
    data = _make_airborne(model)
    for quat in ((1, 0, 0, 0), (0, 1, 0, 0), (1, 1, 0, 0), (1, -1, 0, 0), (1, 0, 1, 0)):
        for joints in ([0, 0.8, -1.5] * 4, [0, 0.0, -2.7] * 4, [0, 2.5, -2.7] * 4):
            data.qpos[2:] = (2.0, *(np.array(quat) / np.linalg.norm(quat)), *joints)
            if _lower_until_touch(model, data, geom):
                return data
    raise AssertionError(f"no pose found in which {geom} touches first")


def _lower_until_touch(model: mujoco.MjModel, data: mujoco.MjData, geom: str) -> bool:
    """Lower the robot until `geom` touches; say whether it is the first of its leg to do so."""
    for height in np.arange(0.5, 0.0, -0.002):
        data.qpos[2] = height
        mujoco.mj_forward(model, data)
        touching = _touching_geoms(model, data)
        if geom in touching:
            return True
        if len(touching) > 4:
            return False
    return False


CONTACT_GEOMS = (
    *(f"{leg}_foot" for leg in LEGS),
    "trunk",
    "head",
    *(f"{leg}_{part}" for leg in LEGS for part in ("thigh", "shank")),
)


@pytest.mark.parametrize("geom", CONTACT_GEOMS)
def test_a_contact_sensor_fires_for_its_own_geom(model, geom):
    data = _sunk(model, geom)
    contacts = data.sensordata[sensor_slice(model, "FR_foot_contact", len(CONTACT_GEOMS))]
    fired = {name for name, found in zip(CONTACT_GEOMS, contacts, strict=True) if found > 0}
    assert fired == _touching_geoms(model, data)
    assert geom in fired


def test_no_contact_sensor_fires_in_the_air(model):
    data = _make_airborne(model)
    contacts = data.sensordata[sensor_slice(model, "FR_foot_contact", len(CONTACT_GEOMS))]
    np.testing.assert_array_equal(contacts, 0.0)


def test_sensors_come_in_the_promised_order(model):
    names = [model.sensor(i).name for i in range(model.nsensor)]
    assert names == [
        *(f"{leg}_foot_pos" for leg in LEGS),
        *(f"{leg}_foot_vel" for leg in LEGS),
        *(f"{geom}_contact" for geom in CONTACT_GEOMS),
    ]


# The scene's configuration.


@pytest.mark.parametrize(
    ("field", "value", "allowed"),
    [
        ("timestep", 0.0, "> 0"),
        ("timestep", 0.1, "<= 0.02"),
        ("timestep", math.nan, "> 0"),
        ("integrator", "rk4", "euler, implicit, implicitfast"),
        ("cone", "round", "pyramidal, elliptic"),
        ("solver", "pgs", "newton, cg"),
        ("iterations", 0, ">= 1"),
        ("ls_iterations", -3, ">= 1"),
        ("floor_friction", -0.5, "> 0"),
        ("floor_solref", (0.005, 1.0), ">= 0.01"),
        ("floor_solref", (0.02, 0.0), "> 0"),
        ("floor_solref", (0.02,), "two numbers"),
        ("look", "cartoon", "primitives, menagerie"),
    ],
)
def test_a_bad_value_is_refused_with_its_name_and_what_is_allowed(field, value, allowed):
    with pytest.raises(ValueError, match=rf"^env\.scene\.{field}.* must be .*{allowed}.*, got "):
        SceneCfg(**{field: value})


def test_the_configuration_reaches_the_model():
    model = build_scene(
        SceneCfg(
            timestep=0.002,
            integrator="euler",
            cone="elliptic",
            solver="cg",
            iterations=7,
            ls_iterations=9,
            floor_friction=0.3,
            floor_solref=(0.01, 0.8),
        )
    )
    assert model.opt.timestep == 0.002
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_EULER
    assert model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
    assert model.opt.solver == mujoco.mjtSolver.mjSOL_CG
    assert (model.opt.iterations, model.opt.ls_iterations) == (7, 9)


def test_a_slippery_floor_decides_over_the_rubber_feet():
    model = build_scene(SceneCfg(floor_friction=0.3, floor_solref=(0.05, 0.8)))
    data = _make_standing(model)
    assert data.ncon > 0
    assert data.contact.friction[0, 0] == pytest.approx(0.3)
    np.testing.assert_allclose(data.contact.solref[0], (0.05, 0.8))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"low": (1.0, 0.0)}, r"low must be < .*\.high in x and y"),
        ({"high": (math.inf, 1.0)}, "high must be .*got .inf, 1.0"),
        ({"friction": 0.0}, r"^env\.scene\.floor_patches\.friction must be > 0 .*got 0\.0"),
        ({"friction": math.nan}, "friction must be .*got nan"),
        ({"solref": (0.0, 1.0)}, r"solref\[0\] must be > 0 .*got 0\.0"),
        ({"solref": (0.02, -1.0)}, r"solref\[1\] must be > 0 .*got -1\.0"),
        ({"solref": (0.02,)}, "solref must be two numbers"),
        ({"rgba": (0.0, 0.0, 0.0, 1.5)}, "rgba must be .*<= 1"),
    ],
)
def test_a_patch_refuses_a_bad_value_by_name(values, message):
    good = {"low": (0.0, 0.0), "high": (1.0, 1.0), "friction": 0.8, "solref": (0.02, 1.0)}
    with pytest.raises(ValueError, match=message):
        FloorPatch(**(good | values))


def test_a_patch_stiffer_than_the_physics_steps_allow_is_refused_by_its_index():
    soft, hard = (FloorPatch((0.0, 0.0), (1.0, 1.0), 0.8, (time, 1.0)) for time in (0.02, 0.008))
    SceneCfg(timestep=0.004, floor_patches=(soft, hard))
    with pytest.raises(ValueError, match=r"floor_patches\[1\]\.solref\[0\] must be >= 0\.01"):
        SceneCfg(timestep=0.005, floor_patches=(soft, hard))


def test_a_scene_that_nobody_sees_has_the_shapes_that_collide_and_the_same_physics():
    seen, stepped = build_scene(SceneCfg()), build_scene(SceneCfg(), pictured=False)
    collides = (seen.geom_contype != 0) | (seen.geom_conaffinity != 0)
    assert stepped.ngeom == collides.sum() == 15
    assert seen.ngeom > 3 * stepped.ngeom
    assert (stepped.nlight, stepped.ntex, stepped.nmat) == (0, 0, 0)
    for name in ("body_mass", "body_inertia", "body_pos", "jnt_range", "dof_armature", "site_pos",
                 "dof_frictionloss", "actuator_gainprm", "sensor_adr", "key_qpos"):  # fmt: skip
        np.testing.assert_array_equal(getattr(stepped, name), getattr(seen, name), name)
    for name in ("geom_size", "geom_friction", "geom_solref", "geom_pos"):
        np.testing.assert_array_equal(getattr(stepped, name), getattr(seen, name)[collides], name)


def test_the_gains_are_the_robots_own_unless_others_are_asked_for():
    own = mujoco.MjModel.from_xml_path(str(REPOSITORY / "resources" / "go1" / "go1.xml"))
    usual, stiff = (build_scene(cfg) for cfg in (SceneCfg(), SceneCfg(stiffness=28.0, damping=0.7)))
    for name in ("actuator_gainprm", "actuator_biasprm"):
        np.testing.assert_array_equal(getattr(usual, name), getattr(own, name))
    assert set(stiff.actuator_gainprm[:, 0]) == {28.0}
    assert set(stiff.actuator_biasprm[:, 1]) == {-28.0}
    assert set(stiff.actuator_biasprm[:, 2]) == {-0.7}
