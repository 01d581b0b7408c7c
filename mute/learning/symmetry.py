"""The mirror image of what the networks see and say: left becomes right.

The robot's two sides are nearly alike (centres of mass lie millimetres off), and so are the
commands: a network that knows that learns from one turn what the other takes. Its mean action
cannot choose a side where nothing that it sees does; the robot's bias and its past do that, or a
leading side, by which a first layer alone need not commute with the mirror.
"""

from __future__ import annotations

import torch

from mute.envs.observations import OBSERVATION_WIDTHS
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.scene import LEGS
from mute.learning.model import PreparedModel
from mute.networks.estimator import Estimator
from mute.networks.reflection import Reflection

__all__ = [
    "FEET",
    "JOINTS",
    "OBSERVATION",
    "POLAR",
    "groups",
    "heights",
    "observation",
    "tie_actor_critic",
    "tie_estimator",
]


def _each_leg(*sign: float) -> Reflection:
    """Return the reflection of what every leg has, with the signs of one leg's entries."""
    width, other_side = len(sign), {"R": "L", "L": "R"}
    mirrored = [LEGS.index(end + other_side[side]) for end, side in LEGS]
    index = tuple(width * leg + part for leg in mirrored for part in range(width))
    return Reflection(index, sign * len(LEGS))


FEET = _each_leg(1.0)
"""Of what every foot has. Width: 4."""
JOINTS = _each_leg(-1.0, 1.0, 1.0)
"""Of what every joint has: hips turn about the x axis, thighs and calves about y. Width: 12."""
POLAR = Reflection((0, 1, 2), (1.0, -1.0, 1.0))
"""Of a velocity or a direction in the body frame, whose y axis points to the left."""
AXIAL = Reflection((0, 1, 2), (-1.0, 1.0, -1.0))
"""Of an angular velocity in the body frame."""

_PARTS = {
    "base_ang_vel": AXIAL,
    "base_lin_vel": POLAR,
    "projected_gravity": POLAR,
    "joint_pos": JOINTS,
    "joint_vel": JOINTS,
    "last_action": JOINTS,
    "command": Reflection((0, 1, 2, 3), (1.0, -1.0, -1.0, 1.0)),
    "contact": FEET,
    "phase": FEET,
    # Friction, added mass, offset of the centre of mass, motor strength, delay.
    "physics": Reflection.joined([Reflection.unchanged(2), POLAR, Reflection.unchanged(2)]),
}

OBSERVATION = Reflection.joined([_PARTS[name] for name in OBSERVATION_WIDTHS])
"""Of the policy's observation. Width: 46."""


def heights(grid: torch.Tensor) -> Reflection:
    """Return the reflection of heights on a grid that lies alike on both sides.

    Args:
        grid: Points in the heading frame, m. Shape: (num_heights, 2).
    """
    mirrored = grid * grid.new_tensor((1.0, -1.0))
    # Not `cdist`, which may multiply in bfloat16 where a run allows that.
    distances = (mirrored[:, None] - grid).abs().sum(dim=2)
    return Reflection(tuple(distances.argmin(dim=1).tolist()), (1.0,) * len(grid))


def observation(obs_dim: int) -> Reflection:
    """Return the reflection of what the networks see of an observation, its first columns."""
    return Reflection(OBSERVATION.index[:obs_dim], OBSERVATION.sign[:obs_dim])


def groups(env: QuadrupedEnv, estimator: Estimator, with_phase: bool) -> dict[str, Reflection]:
    """Return the reflection of each observation group that actor and critic see.

    Args:
        env: The environment, whose groups these are.
        estimator: What makes the group `estimate`.
        with_phase: Whether that holds the phase, if it is estimated.
    """
    parts = _PARTS | {"heights": heights(env.grid)}
    estimated_heights = [parts["heights"]] if estimator.num_heights else []
    estimate = [POLAR, *estimated_heights, Reflection.swapped(estimator.cfg.latent_dim)]
    with_phase = with_phase and estimator.num_feet > 0
    return {
        "policy": observation(estimator.obs_dim),
        "privileged": Reflection.joined([parts[name] for name in env.privileged_slices]),
        "go": Reflection.unchanged(1),
        "estimate": Reflection.joined([*estimate, FEET] if with_phase else estimate),
    }


def tie_estimator(env: QuadrupedEnv, estimator: Estimator) -> None:
    """Make the estimator of an environment treat left and right alike, now and as it learns.

    Raises:
        ValueError: If the width of a layer is odd.
    """
    estimator.tie(observation(estimator.obs_dim), POLAR, heights(env.grid), FEET)


def tie_actor_critic(
    actor: PreparedModel,
    critic: PreparedModel,
    by_group: dict[str, Reflection],
    leading_side: bool = False,
) -> None:
    """Make actor and critic treat left and right alike, now and as they learn.

    Args:
        actor: The actor.
        critic: The critic.
        by_group: Reflection of each group that they see, from `groups`.
        leading_side: Whether the actor may lead with one side, and the critic know that.

    Raises:
        ValueError: If the width of a layer is odd.
    """
    for model, target in ((actor, JOINTS), (critic, Reflection.unchanged(1))):
        source = Reflection.joined([by_group[name] for name in model.obs_groups])
        model.tie(source, target, leading_side)
