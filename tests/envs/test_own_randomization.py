"""What is randomised reaches the motion or the sensors of the robot that has drawn it, alone."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.randomization import RandomizationCfg, full_randomization
from mute.envs.terrain import TerrainCfg

ROBOTS, ONE, STEPS = 4, 2, 12
_RANDOMIZED = (
    "geom_friction",
    "geom_solref",
    "body_mass",
    "body_inertia",
    "body_ipos",
    "actuator_gainprm",
    "actuator_biasprm",
    "actuator_forcerange",
    "actuator_delay",
    "dof_frictionloss",
    "dof_armature",
)
"""Fields of the model that differ between robots."""

OTHER = {
    "friction_factor": (0.1, 0.2),
    "added_mass": (3.0, 3.5),
    "com_offset": (0.03, 0.04),
    "gain_scale": (0.7, 0.8),
    "friction_loss": (0.6, 0.8),
    "motor_strength": (0.3, 0.4),
    "armature": (1.5, 2.0),
    "floor_stiffness": (0.2, 0.3),
    "action_delay": (0.015, 0.02),
    "encoder_offset": (0.03, 0.04),
    "imu_tilt": (0.04, 0.05),
}
"""Ranges beside those of `full_randomization`, of every field."""


def _env(kind: str, physics: RandomizationCfg) -> QuadrupedEnv:
    terrain = TerrainCfg(kind=kind, first_levels=(3, 3))
    env = QuadrupedEnv(
        QuadrupedEnvCfg(num_envs=ROBOTS, num_threads=1, terrain=terrain, randomization=physics)
    )
    env.autoreset = False  # or the draws of all robots would follow from one that falls
    return env


def _give(env: QuadrupedEnv, other: QuadrupedEnv, robot: int) -> None:
    """Make a robot of an environment the one that it is in another."""
    for name in _RANDOMIZED:
        env.simulation.field(name)[robot] = other.simulation.field(name)[robot]
    env.simulation.set_const()
    assert env.imu is not None
    assert other.imu is not None
    env.encoder_offset[robot], env.imu[robot] = other.encoder_offset[robot], other.imu[robot]


def _walk(env: QuadrupedEnv) -> tuple[torch.Tensor, torch.Tensor]:
    """Return the state and what is observed at every step. Shape of each: (steps, robots, ...)."""
    generator = torch.Generator().manual_seed(1)
    states, seen = [], []
    for _ in range(STEPS):
        observations = env.step(1.5 * torch.randn(ROBOTS, 12, generator=generator))[0]
        simulation = env.simulation
        states.append(torch.cat((simulation.qpos, simulation.qvel), dim=1))
        seen.append(observations["policy"])
    return torch.stack(states), torch.stack(seen)


@pytest.fixture(scope="module", params=["flat", "stairs_down"])
def usual(request: pytest.FixtureRequest) -> tuple[str, tuple[torch.Tensor, torch.Tensor]]:
    """Return a kind of ground, and how robots walk there that nobody has changed."""
    return request.param, _walk(_env(request.param, full_randomization()))


def test_all_that_is_randomised_is_here():
    fields = vars(full_randomization())
    assert {name for name, value in fields.items() if isinstance(value, tuple)} == OTHER.keys()


@pytest.mark.parametrize("field", OTHER)
def test_what_one_robot_has_drawn_moves_it_and_no_other(field, usual):
    kind, before = usual
    physics = full_randomization()
    mixed = _env(kind, physics)
    _give(mixed, _env(kind, replace(physics, **{field: OTHER[field]})), ONE)
    others, differences = torch.arange(ROBOTS) != ONE, []
    for one, other in zip(before, _walk(mixed), strict=True):
        assert torch.equal(one[:, others], other[:, others])
        differences.append(float((one - other)[:, ONE].abs().max()))
    moved, seen = differences
    assert seen > 1e-3
    # An inertial sensor changes no motion where nobody acts on what it reads.
    assert moved == 0.0 if field == "imu_tilt" else moved > 1e-3
