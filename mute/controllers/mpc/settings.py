"""What the model-predictive controller is set to, and where each figure comes from.

They were fixed before any sound was measured, and none was chosen by it. Unitree does not publish
the controller that a Go1 ships with; its open one for the same robot (unitree_guide, 2023) has the
gait, and the Mini Cheetah's (MIT, 2019), of the same build and nearly the same mass, the weights.
What is called ours has no source but what a robot of this size needs.
"""

from __future__ import annotations

from dataclasses import dataclass

from mute.support.ranges import Range, check_ranges

__all__ = ["MpcCfg"]


@dataclass(frozen=True)
class MpcCfg:
    """Settings of the gait, the footholds and the forces; a bad value raises `ValueError`."""

    gait_period: float = 0.45
    """Time of a trot's cycle, s (unitree_guide)."""
    swing_height: float = 0.08
    """Height to which a foot is lifted, m (unitree_guide)."""
    base_height: float = 0.30
    """Height of the trunk above the ground, m (the paper's Table I)."""
    command_time: float = 0.2
    """Time constant with which the velocity that is asked for follows the command, s (Mini
    Cheetah)."""
    stance_width: float = 0.1
    """How far outside the hip's axis a foot is put, m; the hip's own offset is 0.08 (ours)."""
    foothold_gain: float = 0.03
    """How far ahead of a neutral foothold a foot is put for each m/s too fast, s (Di Carlo et al.,
    2018, after Raibert, 1986)."""
    max_foothold: float = 0.3
    """Farthest that a foothold is from below its hip, m (Mini Cheetah)."""
    horizon: int = 10
    """Steps that are looked ahead (Di Carlo et al., 2018)."""
    horizon_step: float = 0.03
    """Length of each, s; the ten of them are two thirds of a cycle (Di Carlo et al., 2018: 0.5 s at
    most)."""
    orientation_weights: tuple[float, float, float] = (0.25, 0.25, 10.0)
    """Weights of roll, pitch and yaw (Mini Cheetah)."""
    position_weights: tuple[float, float, float] = (2.0, 2.0, 50.0)
    """Weights of x, y and z in the heading frame (Mini Cheetah)."""
    angular_velocity_weights: tuple[float, float, float] = (0.0, 0.0, 0.3)
    """Weights of the turning rates (Mini Cheetah)."""
    velocity_weights: tuple[float, float, float] = (0.2, 0.2, 0.1)
    """Weights of the velocities (Mini Cheetah)."""
    force_weight: float = 4e-5
    """Weight of what forces differ by from a share of the weight, 1/N^2 (Mini Cheetah, where it
    is that of the forces themselves, and a robot stands 1.4 cm too high)."""
    friction: float = 0.6
    """Friction coefficient that forces keep to; floors have 0.8, and robots 0.4 to 1.25 (ours)."""
    max_force: float = 180.0
    """Largest vertical force of a foot, N: three times what it carries in a trot (ours)."""
    max_lead: float = 0.1
    """How far the place and the heading that are asked for may be ahead of the robot, m and rad
    (Mini Cheetah: m)."""
    still_speed: float = 0.1
    """Speed of the trunk, m/s, below which a robot that is asked to stand does so (ours)."""
    pushed_speed: float = 0.3
    """Speed of the trunk, m/s, from which on a robot that stands takes steps (ours)."""
    largest_shift: float = 0.1
    """Distance of the trunk from the middle of its feet, m, from which on it does, too (ours)."""
    search_speed: float = 0.3
    """Speed at which a foot is lowered that should stand and has not landed, m/s (ours)."""
    settling_time: float = 0.6
    """Time in which a robot that begins to stand moves over its feet, s (ours)."""
    force_time: float = 0.2
    """Time constant with which the forces of a robot that stands follow what is planned, s: what it
    measures trembles, and it should not (ours)."""
    true_velocity: bool = False
    """Whether it is told its true velocity, which no robot can measure, in place of its odometry's:
    what it could do with a perfect one."""

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ValueError: If one is out of its range.
        """
        check_ranges(self, "mpc", _RANGES)


_WEIGHT = Range(0.0, 1e9)
_POSITIVE = Range(0.0, 1e3, above=True)
_RANGES = {
    "gait_period": Range(0.1, 10.0),
    "swing_height": _POSITIVE,
    "base_height": _POSITIVE,
    "command_time": Range(0.0, 1e3, above=True),
    "stance_width": Range(0.0, 0.3),
    "foothold_gain": Range(0.0, 1.0),
    "max_foothold": _POSITIVE,
    "horizon": Range(1, 100, whole=True),
    "horizon_step": _POSITIVE,
    "orientation_weights": _WEIGHT,
    "position_weights": _WEIGHT,
    "angular_velocity_weights": _WEIGHT,
    "velocity_weights": _WEIGHT,
    "force_weight": Range(0.0, 1e9, above=True),
    "friction": _POSITIVE,
    "max_force": Range(0.0, 1e6, above=True),
    "max_lead": Range(0.0, 1e3),
    "still_speed": Range(0.0, 1e3),
    "pushed_speed": Range(0.0, 1e3),
    "largest_shift": Range(0.0, 1e3),
    "search_speed": Range(0.0, 1e3),
    "settling_time": _POSITIVE,
    "force_time": _POSITIVE,
}
