"""The program of the forces is the rigid body's, and its solution the best that is allowed."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from mute.controllers.mpc.body import Body
from mute.controllers.mpc.forces import ForceProgram, Outlook
from mute.controllers.mpc.settings import MpcCfg
from mute.envs.base_state import GRAVITY
from mute.envs.scene import SceneCfg, build_scene

BODY = Body.of(build_scene(SceneCfg(), pictured=False))
CFG = MpcCfg(horizon=4)
TROT = np.array([[True, False, False, True]] * 2 + [[False, True, True, False]] * 2)


def _outlook(stance: np.ndarray, seed: int = 0, calm: bool = False) -> Outlook:
    """Return one robot's, somewhat off what is wanted, or exactly there."""
    generator = np.random.default_rng(seed)
    steps = len(stance)
    feet = np.array(
        [[0.2, -0.13, -0.3], [0.2, 0.13, -0.3], [-0.2, -0.13, -0.3], [-0.2, 0.13, -0.3]]
    )
    size = 0.0 if calm else 1.0
    return Outlook(
        pose=size * generator.uniform(-0.05, 0.05, (1, 6)),
        velocity=size * generator.uniform(-0.3, 0.3, (1, 6)),
        pose_wanted=size * generator.uniform(-0.05, 0.05, (1, steps, 6)),
        velocity_wanted=size * generator.uniform(-0.3, 0.3, (1, steps, 6)),
        feet=feet + size * generator.uniform(-0.03, 0.03, (1, steps, 4, 3)),
        stance=stance[None],
        turn=_tilted(size * 0.1),
    )


def _tilted(angle: float) -> np.ndarray:
    """Return a trunk that is pitched and rolled by an angle. Shape: (1, 3, 3)."""
    cos, sin = np.cos(angle), np.sin(angle)
    pitch = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
    roll = np.array([[1.0, 0.0, 0.0], [0.0, cos, -sin], [0.0, sin, cos]])
    return (pitch @ roll)[None]


def _cost(outlook: Outlook, forces: np.ndarray) -> float:
    """Return the cost of forces (N, 4, 3) by going through the steps, one after the other."""
    dt, cost = CFG.horizon_step, 0.0
    pose, velocity = outlook.pose[0].copy(), outlook.velocity[0].copy()
    pose_weights = np.array(CFG.orientation_weights + CFG.position_weights)
    velocity_weights = np.array(CFG.angular_velocity_weights + CFG.velocity_weights)
    for step, pushed in enumerate(forces):
        torque = np.cross(outlook.feet[0, step], pushed).sum(axis=0)
        push = pushed.sum(axis=0) / BODY.mass - (0.0, 0.0, GRAVITY)
        turn = outlook.turn[0]
        inertia = turn @ BODY.inertia @ turn.T
        acceleration = np.concatenate((np.linalg.solve(inertia, torque), push))
        pose = pose + dt * velocity + 0.5 * dt**2 * acceleration
        velocity = velocity + dt * acceleration
        cost += pose_weights @ (pose - outlook.pose_wanted[0, step]) ** 2
        cost += velocity_weights @ (velocity - outlook.velocity_wanted[0, step]) ** 2
    stance = outlook.stance[0]
    share = np.zeros_like(forces)
    share[..., 2] = stance * BODY.mass * GRAVITY / stance.sum(axis=1, keepdims=True)
    return 0.5 * float(cost + CFG.force_weight * np.square(forces - share).sum())


def _spread(values: np.ndarray, stance: np.ndarray) -> np.ndarray:
    """Return a program's variables as forces (N, 4, 3)."""
    forces = np.zeros((*stance.shape, 3))
    forces[stance] = values.reshape(3, -1)[[1, 2, 0]].T
    return forces


@pytest.mark.parametrize("stance", [TROT, np.ones((4, 4), dtype=bool)])
def test_the_program_is_the_cost_of_going_through_the_steps(stance):
    outlook, program = _outlook(stance), ForceProgram(BODY, CFG)
    programs = program.programs(outlook, np.array([0]), stance.sum(axis=1))
    hessian, gradient = programs.hessian[0], programs.gradient[0]
    generator = np.random.default_rng(1)
    nothing = _cost(outlook, np.zeros((4, 4, 3)))
    for _ in range(5):
        values = generator.uniform(-50.0, 50.0, len(gradient))
        cost = 0.5 * values @ hessian @ values + gradient @ values
        assert cost + nothing == pytest.approx(_cost(outlook, _spread(values, stance)), rel=1e-9)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_forces_are_the_best_that_a_reference_solver_finds(seed):
    outlook, program = _outlook(TROT, seed), ForceProgram(BODY, CFG)
    feet_down = TROT.sum(axis=1)
    programs = program.programs(outlook, np.array([0]), feet_down)
    hessian, gradient = programs.hessian[0], programs.gradient[0]
    count = int(feet_down.sum())
    rows, upper, _ = program.bounds(count)
    constraints = {
        "type": "ineq",
        "fun": lambda f: upper[count:] - rows @ f,
        "jac": lambda f: -rows,
    }
    start = np.concatenate((np.full(count, 60.0), np.zeros(2 * count)))
    found = minimize(
        lambda f: (0.5 * f @ hessian @ f + gradient @ f, hessian @ f + gradient),
        start,
        jac=True,
        bounds=[(0.0, CFG.max_force)] * count + [(None, None)] * (2 * count),
        constraints=constraints,
        method="SLSQP",
        options={"maxiter": 1000, "ftol": 1e-12},
    )
    assert found.success
    expected = _spread(found.x, TROT)[0]
    np.testing.assert_allclose(program.solve(outlook)[0], expected, atol=0.3)


def test_forces_keep_to_friction_and_bounds_and_air_carries_nothing():
    program = ForceProgram(BODY, CFG)
    for seed in range(20):
        forces = program.solve(_outlook(TROT, seed))[0]
        assert (forces[~TROT[0]] == 0.0).all()
        up = forces[:, 2]
        assert (up >= -1e-6).all()
        assert (up <= CFG.max_force + 1e-6).all()
        assert (np.abs(forces[:, :2]) <= CFG.friction * up[:, None] + 1e-6).all()


def test_a_robot_that_is_where_it_should_be_carries_its_weight():
    stance = np.ones((10, 4), dtype=bool)
    forces = ForceProgram(BODY, MpcCfg()).solve(_outlook(stance, calm=True))[0]
    np.testing.assert_allclose(forces[:, 2], 0.25 * BODY.mass * GRAVITY, rtol=1e-6)
    np.testing.assert_allclose(forces[:, :2], 0.0, atol=1e-6)


def test_robots_of_different_gaits_are_solved_each_for_itself():
    standing, trotting = _outlook(np.ones((4, 4), dtype=bool), 3), _outlook(TROT, 4)
    fields = ("pose", "velocity", "pose_wanted", "velocity_wanted", "feet", "stance", "turn")
    both = Outlook(
        **{
            name: np.concatenate((getattr(standing, name), getattr(trotting, name)))
            for name in fields
        }
    )
    program = ForceProgram(BODY, CFG)
    together = program.solve(both)
    np.testing.assert_allclose(together[0], program.solve(standing)[0], atol=1e-9)
    np.testing.assert_allclose(together[1], program.solve(trotting)[0], atol=1e-9)


def test_a_robot_in_the_air_has_no_forces():
    assert (ForceProgram(BODY, CFG).solve(_outlook(np.zeros((4, 4), dtype=bool))) == 0.0).all()
