"""Physics that differs from robot to robot, and pushes while it walks.

Each simulation draws its own grip, masses and gains once, when it is made: a thousand robots
stay a thousand robots for a whole training.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch

from mute.support.ranges import Range, check_ordered, check_ranges

from .simulation import Simulation

__all__ = [
    "KNOWN",
    "PHYSICS_DIM",
    "RandomizationCfg",
    "RobotPhysics",
    "full_randomization",
    "randomize_physics",
]

_TRUNK_MASS = 5.204
"""Mass of the trunk before anything is added, kg; a configuration is checked without the model."""


@dataclass
class RandomizationCfg:
    """Ranges of the uniform draws; `enabled=False` gives every simulation the model as it is."""

    enabled: bool = True
    """Whether anything is randomised."""
    friction_factor: tuple[float, float] = (0.5, 1.5625)
    """Factor on the floor's sliding friction coefficient, which is the floor's own."""
    added_mass: tuple[float, float] = (-0.5, 1.5)
    """Mass added to the trunk, kg."""
    com_offset: tuple[float, float] = (-0.02, 0.02)
    """Offset of the trunk's centre of mass along each axis, m."""
    gain_scale: tuple[float, float] = (0.9, 1.1)
    """Factor on Kp and on Kd, drawn separately for each joint."""
    friction_loss: tuple[float, float] = (0.0, 0.5)
    """Dry friction of the joints, N m (published models lie between 0.1 and 1.0)."""
    motor_strength: tuple[float, float] = (1.0, 1.0)
    """Factor on the torque of all motors of a robot: batteries run down, and magnets get warm."""
    armature: tuple[float, float] = (1.0, 1.0)
    """Factor on the rotors' inertia, drawn for each joint."""
    floor_stiffness: tuple[float, float] = (1.0, 1.0)
    """Factor on the stiffness of the floor; its damping ratio stays."""
    action_delay: tuple[float, float] = (0.0, 0.0)
    """Time from an action to the set points that it stands for, s."""
    encoder_offset: tuple[float, float] = (0.0, 0.0)
    """What is added to what an encoder reads, which the motor controllers believe as well, rad;
    drawn for each joint."""
    imu_tilt: tuple[float, float] = (0.0, 0.0)
    """Turn of the inertial sensor against the trunk, about each axis, rad."""
    everything_share: float = 0.0
    """Share of the robots that are drawn from the ranges of `full_randomization` instead: they
    differ in everything, and the others learn to walk meanwhile."""
    push_interval: float = 8.0
    """Time between pushes, s; 0 for none."""
    push_velocity: float = 0.4
    """Largest change of the trunk's horizontal velocity by a push along each axis, m/s."""

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            ValueError: If a range is empty, or a number is out of its own.
        """
        check_ranges(self, "env.randomization", _RANGES)
        check_ordered(self, "env.randomization", *_DRAWN)

    def hull(self, name: str) -> tuple[float, float]:
        """Return the range of a field over all robots, those that differ in everything as well."""
        low, high = getattr(self, name)
        if self.everything_share == 0.0:
            return low, high
        other_low, other_high = getattr(full_randomization(), name)
        return min(low, other_low), max(high, other_high)


def full_randomization(push_interval: float = 4.0) -> RandomizationCfg:
    """Return robots that differ in everything: what a policy has to bear that leaves simulation.

    Payload and delays reach further than in DreamWaQ's training (arXiv 2301.10602: -1 to 2 kg, up
    to 15 ms), motors and gains as far, the centre of mass (50 mm there) and low friction (0.2 to
    1.25) less far.

    Args:
        push_interval: Time between pushes, s; 0 for none.
    """
    return RandomizationCfg(
        friction_factor=(0.375, 1.5625),  # 0.3 to 1.25 on a floor of 0.8
        added_mass=(-1.0, 3.0),
        com_offset=(-0.03, 0.03),
        gain_scale=(0.9, 1.1),
        friction_loss=(0.0, 0.5),
        motor_strength=(0.9, 1.1),
        armature=(0.8, 1.2),
        floor_stiffness=(0.5, 2.0),
        action_delay=(0.0, 0.02),
        encoder_offset=(-0.02, 0.02),
        imu_tilt=(-0.03, 0.03),
        push_interval=push_interval,
        push_velocity=0.5,
    )


_RANGES = {
    "friction_factor": Range(0.0, 1000.0),
    "added_mass": Range(-_TRUNK_MASS, 1000.0, above=True),  # or nothing is left of the trunk
    "com_offset": Range(-1.0, 1.0),
    "gain_scale": Range(0.0, 100.0),
    "friction_loss": Range(0.0, 1000.0),
    "motor_strength": Range(0.0, 100.0, above=True),
    "armature": Range(0.0, 100.0, above=True),
    "floor_stiffness": Range(0.0, 1000.0, above=True),
    "action_delay": Range(0.0, 1.0),
    "encoder_offset": Range(-1.0, 1.0),
    "imu_tilt": Range(-1.0, 1.0),
    "everything_share": Range(0.0, 1.0),
    "push_interval": Range(0.0, 1e12),
    "push_velocity": Range(0.0, 100.0),
}

_DRAWN = (
    "friction_factor",
    "added_mass",
    "com_offset",
    "gain_scale",
    "friction_loss",
    "motor_strength",
    "armature",
    "floor_stiffness",
    "action_delay",
    "encoder_offset",
    "imu_tilt",
)

KNOWN = ("friction_factor", "added_mass", "com_offset", "motor_strength", "action_delay")
"""What the critic knows of a robot's physics, in that order; the offset has three parts."""

PHYSICS_DIM = 7
"""Width of what the critic knows."""


@dataclass
class RobotPhysics:
    """What differs between robots beside the fields of their models."""

    known: torch.Tensor
    """What the critic knows (`KNOWN`), each scaled to about [-1, 1]; 0 where all robots are alike.
    Shape: (num_envs, PHYSICS_DIM)."""
    encoder_offset: torch.Tensor
    """What is added to what encoders read, rad. Shape: (num_envs, 12)."""
    imu: torch.Tensor | None
    """Rotation from the trunk's frame to that of the inertial sensor, None where they are one.
    Shape: (num_envs, 3, 3)."""


def randomize_physics(
    simulation: Simulation, cfg: RandomizationCfg, generator: torch.Generator
) -> RobotPhysics:
    """Draw the physics of every simulation.

    What all robots have as the model has it is not drawn, so that it changes no other draw.

    Args:
        simulation: The simulations; their model fields are written.
        cfg: Ranges.
        generator: Source of the draws.
    """
    num_envs, model, device = simulation.num_envs, simulation.model, simulation.device
    exact = torch.zeros(num_envs, model.nu, device=device)
    if not cfg.enabled:
        return RobotPhysics(torch.zeros(num_envs, PHYSICS_DIM, device=device), exact, None)

    bounds_of = _bounds(cfg, num_envs, device)

    def draw(name: str, size: int) -> torch.Tensor:
        unit = torch.rand(
            num_envs, size, generator=generator, dtype=torch.float64, device=simulation.device
        )
        low, high = bounds_of(name)
        return low + (high - low) * unit

    def draw_if(name: str, neutral: float, size: int) -> torch.Tensor:
        if cfg.hull(name) == (neutral, neutral):
            return torch.full((num_envs, size), neutral, dtype=torch.float64, device=device)
        return draw(name, size)

    friction = draw("friction_factor", 1)
    # The floor has priority and decides; the other geoms are written for whatever meets them.
    simulation.field("geom_friction")[:, :, 0] *= friction
    trunk = model.body("trunk").id
    added_mass = draw("added_mass", 1)
    ratio = (model.body_mass[trunk] + added_mass) / model.body_mass[trunk]
    simulation.field("body_mass")[:, trunk] *= ratio[:, 0]
    simulation.field("body_inertia")[:, trunk] *= ratio
    com_offset = draw("com_offset", 3)
    simulation.field("body_ipos")[:, trunk] += com_offset
    _randomize_gains(simulation, draw("gain_scale", model.nu), draw("gain_scale", model.nu))
    simulation.field("dof_frictionloss")[:, 6:] = draw("friction_loss", model.nv - 6)
    strength = draw_if("motor_strength", 1.0, 1)
    _randomize_gains(simulation, strength, strength)
    simulation.field("actuator_forcerange")[:] *= strength[:, :, None]
    simulation.field("dof_armature")[:, 6:] *= draw_if("armature", 1.0, model.nv - 6)
    if cfg.hull("floor_stiffness") != (1.0, 1.0):
        _soften_floor(simulation, draw("floor_stiffness", 1))
    delay = draw_if("action_delay", 0.0, 1)
    if cfg.hull("action_delay")[1] > 0.0:
        simulation.field("actuator_delay")[:] = delay
    offset = draw_if("encoder_offset", 0.0, model.nu)
    turns = draw_if("imu_tilt", 0.0, 3)
    simulation.set_const()
    known = torch.cat(
        (
            _unit(friction, cfg.hull("friction_factor")),
            _unit(added_mass, cfg.hull("added_mass")),
            _unit(com_offset, cfg.hull("com_offset")),
            _unit(strength, cfg.hull("motor_strength")),
            _unit(delay, cfg.hull("action_delay")),
        ),
        dim=1,
    )
    turned = cfg.hull("imu_tilt") != (0.0, 0.0)
    return RobotPhysics(known.float(), offset.float(), _rotation(turns) if turned else None)


_Bounds = Callable[[str], tuple[float | torch.Tensor, float | torch.Tensor]]


def _bounds(cfg: RandomizationCfg, num_envs: int, device: torch.device) -> _Bounds:
    """Return what tells the lowest and the highest value of a field: of all, or (num_envs, 1)."""
    if cfg.everything_share == 0.0:
        return lambda name: getattr(cfg, name)
    everything = full_randomization()
    # Robot k by the place k sqrt(2), modulo 1: as many as the share says, and of every kind of
    # ground, whose places the golden ratio gives.
    robots = torch.arange(num_envs, dtype=torch.float64, device=device)
    differs = ((robots + 0.5) * math.sqrt(2.0) % 1.0 < cfg.everything_share)[:, None].double()

    def bounds(name: str) -> tuple[torch.Tensor, torch.Tensor]:
        own, other = getattr(cfg, name), getattr(everything, name)
        return (
            own[0] + (other[0] - own[0]) * differs,
            own[1] + (other[1] - own[1]) * differs,
        )

    return bounds


def _soften_floor(simulation: Simulation, stiffness: torch.Tensor) -> None:
    """Scale the stiffness of the floor's contacts: with a time constant goes its root's inverse."""
    model = simulation.model
    floor = np.flatnonzero(model.geom_bodyid == 0)
    solref = simulation.field("geom_solref")
    # Below two physics steps MuJoCo would stretch the time constant without a word (refsafe).
    shortest = 2.0 * model.opt.timestep
    time = (solref[:, floor, 0] / stiffness.sqrt()).clamp(min=shortest)
    solref[:, floor, 0] = time.to(solref.dtype)


def _rotation(turns: torch.Tensor) -> torch.Tensor:
    """Return rotations by turns about x, y and z, rad. Shape: (n, 3) -> (n, 3, 3)."""
    skew = torch.zeros(len(turns), 3, 3, dtype=turns.dtype, device=turns.device)
    x, y, z = turns.unbind(dim=1)
    skew[:, 0, 1], skew[:, 0, 2], skew[:, 1, 2] = -z, y, -x
    skew[:, 1, 0], skew[:, 2, 0], skew[:, 2, 1] = z, -y, x
    return torch.linalg.matrix_exp(skew).float()


def _randomize_gains(simulation: Simulation, kp: torch.Tensor, kd: torch.Tensor) -> None:
    # A MuJoCo position actuator: force = gainprm[0] ctrl + biasprm[1] q + biasprm[2] qdot.
    simulation.field("actuator_gainprm")[:, :, 0] *= kp
    simulation.field("actuator_biasprm")[:, :, 1] *= kp
    simulation.field("actuator_biasprm")[:, :, 2] *= kd


def _unit(value: torch.Tensor, bounds: tuple[float, float]) -> torch.Tensor:
    centre, half = (bounds[0] + bounds[1]) / 2, max((bounds[1] - bounds[0]) / 2, 1e-9)
    return (value - centre) / half
