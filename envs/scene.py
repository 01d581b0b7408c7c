"""Robot, floor and sensors, assembled into one MuJoCo model with MjSpec.

The robot itself is `resources/go1/go1.xml`. This module adds what surrounds it: the floor, the
light and the sky, the sensors that the environment reads, and the solver's options. Stepping the
model is left to `envs.simulation`, finding what the sensors read to `envs.sensors`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import mujoco

from mute.support.ranges import Range, check_number, check_ranges

from .menagerie import dress_in_menagerie

LEGS: tuple[str, ...] = ("FR", "FL", "RR", "RL")
"""The legs, in the order of every per-leg array."""

JOINT_NAMES: tuple[str, ...] = tuple(
    f"{leg}_{joint}_joint" for leg in LEGS for joint in ("hip", "thigh", "calf")
)
"""The actuated joints, in the order of every per-joint array and of the actuators."""

# fmt: off
STAND_JOINT_POS: tuple[float, ...] = (
    -0.1, 0.8, -1.5,
    0.1, 0.8, -1.5,
    -0.1, 1.0, -1.5,
    0.1, 1.0, -1.5,
)
# fmt: on
"""Joint angles of the standing pose, in rad, in the order of `JOINT_NAMES`."""

STAND_HEIGHT = 0.32475
"""Trunk height in m at which a level robot in the standing pose touches flat ground."""

FOOT_RADIUS = 0.023
"""Radius of the spherical rubber feet, in m."""

Look = Literal["primitives", "menagerie"]
Integrator = Literal["euler", "implicit", "implicitfast"]
Cone = Literal["pyramidal", "elliptic"]
Solver = Literal["newton", "cg"]

GROUND_BOX = "ground_{}"
"""Names of the boxes that ground is laid of, by their number."""

_QUARTER_TURN = (0.5**0.5, 0.0, 0.0, 0.5**0.5)
"""About the vertical, which leaves the normal exactly vertical."""

_PATCH_THICKNESS = 0.1
"""Thickness of a patch of floor, in m; its top is level."""

_ROBOT_FILE = Path(__file__).resolve().parents[1] / "resources" / "go1" / "go1.xml"

_INTEGRATORS: dict[Integrator, mujoco.mjtIntegrator] = {
    "euler": mujoco.mjtIntegrator.mjINT_EULER,
    "implicit": mujoco.mjtIntegrator.mjINT_IMPLICIT,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
}
_CONES: dict[Cone, mujoco.mjtCone] = {
    "pyramidal": mujoco.mjtCone.mjCONE_PYRAMIDAL,
    "elliptic": mujoco.mjtCone.mjCONE_ELLIPTIC,
}
_SOLVERS: dict[Solver, mujoco.mjtSolver] = {
    "newton": mujoco.mjtSolver.mjSOL_NEWTON,
    "cg": mujoco.mjtSolver.mjSOL_CG,
}


@dataclass(frozen=True)
class FloorPatch:
    """A rectangle of floor with its own contact parameters; a bad value raises `ValueError`."""

    low: tuple[float, float]
    """Corner with the smallest x and y, in m."""

    high: tuple[float, float]
    """Corner with the largest x and y, in m."""

    friction: float
    """Sliding friction coefficient."""

    solref: tuple[float, float]
    """Time constant (s) and damping ratio."""

    rgba: tuple[float, float, float, float] = (0.6, 0.6, 0.6, 1.0)
    """Colour in pictures."""

    def __post_init__(self) -> None:
        """Refuse an empty or endless rectangle, and numbers out of their range."""
        place = "env.scene.floor_patches"
        check_ranges(self, place, _PATCH_RANGES)
        if not (self.low[0] < self.high[0] and self.low[1] < self.high[1]):
            raise ValueError(
                f"{place}.low must be < {place}.high in x and y, got {self.low} and {self.high}"
            )
        _require_solref(f"{place}.solref", self.solref)


_PATCH_RANGES = {
    "low": Range(-1e6, 1e6),
    "high": Range(-1e6, 1e6),
    "friction": Range(0.0, 10.0, above=True),
    "rgba": Range(0.0, 1.0),
}


@dataclass(frozen=True)
class SceneCfg:
    """Choose the physics and the look of the scene; a bad value raises `ValueError`."""

    timestep: float = 0.005
    """Physics step in s."""

    integrator: Integrator = "implicitfast"
    """Integrator; `implicitfast` treats the motors' damping implicitly."""

    cone: Cone = "pyramidal"
    """Friction cone."""

    solver: Solver = "newton"
    """Constraint solver."""

    iterations: int = 10
    """Upper bound on the solver's iterations; robots that drop and stumble come out as with 100."""

    ls_iterations: int = 20
    """Upper bound on the line search's iterations; robots come out as with 50."""

    floor_friction: float = 0.8
    """Sliding friction coefficient of every contact with the floor."""

    floor_solref: tuple[float, float] = (0.02, 1.0)
    """Time constant (s) and damping ratio of every contact with the floor."""

    floor_patches: tuple[FloorPatch, ...] = ()
    """Floors side by side, level with each other; none leaves one endless floor."""

    ground_boxes: int = 0
    """Boxes for ground of its own under each robot, which stand on the floor; as many as the kind
    of ground takes (`envs.terrain`), unless there are to be more."""

    stiffness: float = 20.0
    """Kp of the joints' position controllers, N m/rad."""

    damping: float = 0.5
    """Kd of the joints' position controllers, N m s/rad."""

    longest_delay: float = 0.0
    """Longest time from an action to its set points that a motor can have, s; as long as the
    randomisation may draw, unless it is to be longer."""

    foot_forces: bool = False
    """Whether to measure what sound needs and walking does not: contact forces and turning rates
    of the feet."""

    look: Look = "primitives"
    """Shapes to show: our own, or the meshes of the `mujoco_menagerie` package."""

    def __post_init__(self) -> None:
        """Refuse values that MuJoCo would silently take or repair."""
        check_ranges(self, "env.scene", _SCENE_RANGES)
        _require_choice("integrator", self.integrator, get_args(Integrator))
        _require_choice("cone", self.cone, get_args(Cone))
        _require_choice("solver", self.solver, get_args(Solver))
        _require_choice("look", self.look, get_args(Look))
        _require_solref("env.scene.floor_solref", self.floor_solref, self.timestep)
        for index, patch in enumerate(self.floor_patches):
            name = f"env.scene.floor_patches[{index}].solref"
            _require_solref(name, patch.solref, self.timestep)


_SCENE_RANGES = {
    "timestep": Range(0.0, 0.02, above=True),
    "iterations": Range(1, 10**6, whole=True),
    "ls_iterations": Range(1, 10**6, whole=True),
    "floor_friction": Range(0.0, 10.0, above=True),
    "ground_boxes": Range(0, 1000, whole=True),
    "stiffness": Range(0.0, 1e4, above=True),
    "damping": Range(0.0, 1e3),
    "longest_delay": Range(0.0, 1.0),
}


def build_scene(cfg: SceneCfg, pictured: bool = True) -> mujoco.MjModel:
    """Compile the scene that `cfg` describes.

    Args:
        cfg: The scene.
        pictured: See `make_spec`.

    Raises:
        SceneError: The look needs a package or meshes that are not there.
    """
    return make_spec(cfg, pictured).compile()


def make_spec(cfg: SceneCfg, pictured: bool = True) -> mujoco.MjSpec:
    """Assemble robot, floor and sensors, open to further editing before it is compiled.

    Args:
        cfg: The scene.
        pictured: Whether to keep what is only to be seen: shapes that touch nothing, materials,
            light and sky. Without them a physics step takes a tenth less.

    Raises:
        SceneError: The look needs a package or meshes that are not there.
    """
    spec = mujoco.MjSpec.from_file(str(_ROBOT_FILE))
    spec.modelname = "go1_scene"
    _set_options(spec, cfg)
    _set_gains(spec, cfg)
    if pictured:
        _add_surroundings(spec)
    else:
        spec.compiler.discardvisual = True
    _add_floor(spec, cfg)
    for patch in cfg.floor_patches:
        _add_patch(spec, patch)
    for index in range(cfg.ground_boxes):
        _add_ground_box(spec, cfg, index)
    _add_foot_sensors(spec)
    _add_contact_sensors(spec)
    if cfg.longest_delay:
        _delay_motors(spec, cfg)
    if cfg.foot_forces:
        _add_force_sensors(spec)
    if pictured and cfg.look == "menagerie":
        dress_in_menagerie(spec)
    return spec


def _set_gains(spec: mujoco.MjSpec, cfg: SceneCfg) -> None:
    """Set the gains of the joints' position controllers."""
    for actuator in spec.actuators:
        actuator.gainprm[0] = cfg.stiffness
        actuator.biasprm[1:3] = -cfg.stiffness, -cfg.damping


def _require_solref(name: str, solref: tuple[float, float], timestep: float | None = None) -> None:
    """Refuse a contact reference out of its range, for any time step or for the one given (s)."""
    if len(solref) != 2:
        raise ValueError(
            f"{name} must be two numbers, a time constant (s) and a damping ratio, got {solref}"
        )
    # Below two physics steps MuJoCo would stretch the time constant without a word (refsafe).
    time = Range(0.0, 1.0, above=True) if timestep is None else Range(2 * timestep, 1.0)
    for index, allowed in enumerate((time, Range(0.0, 10.0, above=True))):
        check_number(f"{name}[{index}]", solref[index], allowed)


def _require_choice(name: str, value: str, allowed: tuple[str, ...]) -> None:
    """Refuse a word that is not among the `allowed` ones."""
    if value not in allowed:
        raise ValueError(f"env.scene.{name} must be one of {', '.join(allowed)}, got {value!r}")


def _set_options(spec: mujoco.MjSpec, cfg: SceneCfg) -> None:
    """Set the physics options."""
    spec.option.timestep = cfg.timestep
    spec.option.integrator = _INTEGRATORS[cfg.integrator]
    spec.option.cone = _CONES[cfg.cone]
    spec.option.solver = _SOLVERS[cfg.solver]
    spec.option.iterations = cfg.iterations
    spec.option.ls_iterations = cfg.ls_iterations
    # Islands are robots that do not touch each other, solved one by one. Here is one robot alone.
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ISLAND)


def _add_surroundings(spec: mujoco.MjSpec) -> None:
    """Add sky, light and an off-screen buffer large enough for full-HD video."""
    visual: Any = spec.visual  # the stubs name its parts by classes that have no public fields
    visual.global_.offwidth, visual.global_.offheight = 1920, 1080
    visual.headlight.ambient = (0.3, 0.3, 0.3)
    visual.headlight.diffuse = (0.5, 0.5, 0.5)
    visual.headlight.specular = (0.1, 0.1, 0.1)
    visual.quality.shadowsize = 4096
    visual.rgba.haze = (0.9, 0.93, 0.96, 1.0)
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=(0.93, 0.95, 0.97),
        rgb2=(0.55, 0.66, 0.78),
        width=256,
        height=256 * 6,
    )
    spec.body("trunk").add_light(
        # The light keeps its place above the robot, so that the shadow never leaves the shadow map.
        mode=mujoco.mjtCamLight.mjCAMLIGHT_TRACKCOM,
        type=mujoco.mjtLightType.mjLIGHT_SPOT,
        pos=(0.9, -1.2, 3.0),
        dir=(-0.3, 0.4, -1.0),
        cutoff=60.0,
        exponent=1.0,
        diffuse=(0.6, 0.6, 0.6),
        specular=(0.3, 0.3, 0.3),
    )


def _add_floor(spec: mujoco.MjSpec, cfg: SceneCfg) -> None:
    """Add an endless checkered floor whose contact parameters decide for every contact."""
    spec.add_texture(
        name="floor",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        mark=mujoco.mjtMark.mjMARK_EDGE,
        rgb1=(0.55, 0.60, 0.66),
        rgb2=(0.48, 0.53, 0.60),
        markrgb=(0.70, 0.74, 0.78),
        width=300,
        height=300,
    )
    material = spec.add_material(name="floor", texrepeat=(2, 2), texuniform=True, reflectance=0.03)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "floor"
    spec.worldbody.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        # Under patches the endless floor is but a backdrop: level, it would touch as well.
        pos=(0.0, 0.0, -_PATCH_THICKNESS if cfg.floor_patches else 0.0),
        # Of a shape whose frame is the world's own, MuJoCo keeps no place that could be moved.
        quat=_QUARTER_TURN if cfg.ground_boxes else (1.0, 0.0, 0.0, 0.0),
        size=(0.0, 0.0, 0.05),
        material="floor",
        contype=1,
        conaffinity=0,
        condim=3,
        # Without priority MuJoCo takes the larger friction of a pair: no floor could be slippery.
        priority=1,
        friction=(cfg.floor_friction, 0.02, 0.01),
        solref=cfg.floor_solref,
    )


def _add_patch(spec: mujoco.MjSpec, patch: FloorPatch) -> None:
    """Add a slab whose top is at height 0."""
    (x0, y0), (x1, y1) = patch.low, patch.high
    half = 0.5 * _PATCH_THICKNESS
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=(0.5 * (x0 + x1), 0.5 * (y0 + y1), -half),
        size=(0.5 * (x1 - x0), 0.5 * (y1 - y0), half),
        rgba=patch.rgba,
        contype=1,
        conaffinity=0,
        condim=3,
        priority=1,  # as for the endless floor
        friction=(patch.friction, 0.02, 0.01),
        solref=patch.solref,
    )


def _add_ground_box(spec: mujoco.MjSpec, cfg: SceneCfg, index: int) -> None:
    """Add a box out of the way below the floor; `envs.terrain` lays it."""
    spec.worldbody.add_geom(
        name=GROUND_BOX.format(index),
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=(0.0, 0.0, -10.0),
        quat=_QUARTER_TURN,  # as for the floor
        size=(0.1, 0.1, 0.1),
        rgba=(0.62, 0.60, 0.56, 1.0),
        contype=1,
        conaffinity=0,
        condim=3,
        priority=1,
        friction=(cfg.floor_friction, 0.02, 0.01),
        solref=cfg.floor_solref,
    )


def _add_foot_sensors(spec: mujoco.MjSpec) -> None:
    """Add position (m) and linear velocity (m/s) of every foot's centre, in the world frame."""
    for suffix, kind in (
        ("pos", mujoco.mjtSensor.mjSENS_FRAMEPOS),
        ("vel", mujoco.mjtSensor.mjSENS_FRAMELINVEL),
    ):
        for leg in LEGS:
            spec.add_sensor(
                name=f"{leg}_foot_{suffix}",
                type=kind,
                objtype=mujoco.mjtObj.mjOBJ_SITE,
                objname=f"{leg}_foot",
            )


def _add_contact_sensors(spec: mujoco.MjSpec) -> None:
    """Add the number of contacts of every collision shape: feet, trunk, head, then leg by leg."""
    feet = [f"{leg}_foot" for leg in LEGS]
    limbs = [f"{leg}_{part}" for leg in LEGS for part in ("thigh", "shank")]
    for geom in (*feet, "trunk", "head", *limbs):
        add_contact_sensor(spec, geom)


def add_contact_sensor(spec: mujoco.MjSpec, geom: str) -> None:
    """Add the number of contacts of a shape, as the sensor `GEOM_contact`."""
    spec.add_sensor(
        name=f"{geom}_contact",
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        objtype=mujoco.mjtObj.mjOBJ_GEOM,
        objname=geom,
        # What to report (found), how to choose among contacts (any), how many to report.
        intprm=(1 << int(mujoco.mjtConDataField.mjCONDATA_FOUND), 0, 1),
    )


def _delay_motors(spec: mujoco.MjSpec, cfg: SceneCfg) -> None:
    """Let motors keep their last set points, of which a delay takes an earlier one."""
    for actuator in spec.actuators:
        actuator.delay = cfg.longest_delay
        actuator.nsample = math.ceil(cfg.longest_delay / cfg.timestep - 1e-9) + 1


def _add_force_sensors(spec: mujoco.MjSpec) -> None:
    """Add, for every foot, the net contact force (N) and the angular velocity (rad/s), world."""
    for leg in LEGS:
        spec.add_sensor(
            name=f"{leg}_foot_force",
            type=mujoco.mjtSensor.mjSENS_CONTACT,
            objtype=mujoco.mjtObj.mjOBJ_GEOM,
            objname=f"{leg}_foot",
            # What to report (force), how to reduce (net force, world frame), how many to report.
            intprm=(1 << int(mujoco.mjtConDataField.mjCONDATA_FORCE), 3, 1),
        )
    for leg in LEGS:
        spec.add_sensor(
            name=f"{leg}_foot_angvel",
            type=mujoco.mjtSensor.mjSENS_FRAMEANGVEL,
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            objname=f"{leg}_foot",
        )
