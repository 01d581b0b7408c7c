"""Physics that differs from robot to robot, and pushes while it walks.

Each simulation draws its own grip, masses and gains once, when it is made: a thousand robots
stay a thousand robots for a whole training.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch

from mute.support.ranges import Range, check_ordered, check_ranges

from .simulation import Simulation

__all__ = ["RandomizationCfg", "randomize_physics"]

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
        pairs = ("friction_factor", "added_mass", "com_offset", "gain_scale", "friction_loss")
        check_ordered(self, "env.randomization", *pairs)


_RANGES = {
    "friction_factor": Range(0.0, 1000.0),
    "added_mass": Range(-_TRUNK_MASS, 1000.0, above=True),  # or nothing is left of the trunk
    "com_offset": Range(-1.0, 1.0),
    "gain_scale": Range(0.0, 100.0),
    "friction_loss": Range(0.0, 1000.0),
    "push_interval": Range(0.0, 1e12),
    "push_velocity": Range(0.0, 100.0),
}


PHYSICS_DIM = 5
"""Width of what `randomize_physics` returns."""


def randomize_physics(
    simulation: Simulation, cfg: RandomizationCfg, generator: torch.Generator
) -> torch.Tensor:
    """Draw the physics of every simulation.

    Args:
        simulation: The simulations; their model fields are written.
        cfg: Ranges.
        generator: Source of the draws.

    Returns:
        What the critic may know: the friction's factor, added mass, centre of mass offset, each
        scaled to about [-1, 1]. Shape: (num_envs, PHYSICS_DIM).
    """
    num_envs, model = simulation.num_envs, simulation.model
    if not cfg.enabled:
        return torch.zeros(num_envs, PHYSICS_DIM, device=simulation.device)

    def draw(bounds: tuple[float, float], *shape: int) -> torch.Tensor:
        unit = torch.rand(
            num_envs, *shape, generator=generator, dtype=torch.float64, device=simulation.device
        )
        return bounds[0] + (bounds[1] - bounds[0]) * unit

    friction = draw(cfg.friction_factor, 1)
    # The floor has priority and decides; the other geoms are written for whatever meets them.
    simulation.field("geom_friction")[:, :, 0] *= friction
    trunk = model.body("trunk").id
    added_mass = draw(cfg.added_mass, 1)
    ratio = (model.body_mass[trunk] + added_mass) / model.body_mass[trunk]
    simulation.field("body_mass")[:, trunk] *= ratio[:, 0]
    simulation.field("body_inertia")[:, trunk] *= ratio
    com_offset = draw(cfg.com_offset, 3)
    simulation.field("body_ipos")[:, trunk] += com_offset
    _randomize_gains(simulation, draw(cfg.gain_scale, model.nu), draw(cfg.gain_scale, model.nu))
    simulation.field("dof_frictionloss")[:, 6:] = draw(cfg.friction_loss, model.nv - 6)
    simulation.set_const()
    known = torch.cat(
        (
            _unit(friction, cfg.friction_factor),
            _unit(added_mass, cfg.added_mass),
            _unit(com_offset, cfg.com_offset),
        ),
        dim=1,
    )
    return known.float()


def _randomize_gains(simulation: Simulation, kp: torch.Tensor, kd: torch.Tensor) -> None:
    # A MuJoCo position actuator: force = gainprm[0] ctrl + biasprm[1] q + biasprm[2] qdot.
    simulation.field("actuator_gainprm")[:, :, 0] *= kp
    simulation.field("actuator_biasprm")[:, :, 1] *= kp
    simulation.field("actuator_biasprm")[:, :, 2] *= kd


def _unit(value: torch.Tensor, bounds: tuple[float, float]) -> torch.Tensor:
    centre, half = (bounds[0] + bounds[1]) / 2, max((bounds[1] - bounds[0]) / 2, 1e-9)
    return (value - centre) / half
