"""Hold MuJoCo Warp on a device to MuJoCo on the CPU: python -m benchmarks.gpu_engines.

Robots walk with the policy of flat ground, in the engine of the CPU. From the same state, with the
same randomised physics, Warp follows the same set points, and positions, velocities and the
downward speed of the feet at every physics step are compared. A foot whose distance to the ground
is within rounding of zero touches it a physics step earlier in one of them, and from there on the
two robots differ by what such a step moves: so only robots are compared whose contacts agreed at
every physics step until then, and how many they are is told and must be enough, from step to step.
Of all others the means over all robots must be the same: height, speed, and how fast feet land.
What is not finite is within no tolerance. Prints one JSON object.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch

from mute.command_lines.arguments import check_option, command_line, parse
from mute.controllers import LearnedController, load_policy
from mute.envs.engines import make_simulation
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.sensors import sensor_slice
from mute.envs.simulation import Simulation
from mute.evaluation.trials import evaluation_cfg
from mute.support.errors import run_cli
from mute.support.plain_data import without_nan
from mute.support.ranges import Range
from mute.support.resources import shipped_file
from mute.tasks import FLAT_TASK

from .gpu_memory import peak_of_this_process

__all__ = [
    "LEAST_AGREED",
    "MEAN_TOLERANCES",
    "TOLERANCES",
    "GpuEnginesArgs",
    "compare",
    "judge",
    "largest",
    "main",
]

TOLERANCES = {"qpos": 5e-4, "qvel": 1e-2, "downward speed of feet": 2e-3}
"""Largest difference after up to 100 control steps: m and rad, m/s and rad/s, m/s; those of the
test that holds the engines to each other on the CPU."""

MEAN_TOLERANCES = {"height": 0.01, "speed": 0.05, "landing speed": 0.1}
"""Largest relative difference between means over all robots, those that differ in contact too."""

LEAST_AGREED = 0.993
"""Share of the robots whose contacts agree that must go on to agree in each control step: half of
them are left after 100. One robot may leave in any case, for of few the share says nothing."""

_WALK_OFF = 25
"""Control steps before: every robot begins with a foot at distance zero, where rounding decides."""


@dataclass
class GpuEnginesArgs:
    """Arguments of the comparison."""

    device: str = "cuda"
    """Device of MuJoCo Warp: cuda or cpu."""
    num_envs: int = 64
    """Robots."""
    steps: int = 100
    """Control steps."""


def compare(device: str, num_envs: int, steps: int) -> dict[str, object]:
    """Return the largest differences, and whether they are within the tolerances.

    Args:
        device: Device of MuJoCo Warp.
        num_envs: Robots.
        steps: Control steps.
    """
    policy = load_policy(shipped_file(FLAT_TASK))
    cfg = evaluation_cfg(policy.cfg.env, num_envs, 30.0, seed=3, randomized=True)
    env = QuadrupedEnv(cfg)
    command = torch.zeros(num_envs, 4)
    command[:, 0] = torch.linspace(-0.6, 0.8, num_envs)
    command[:, 2] = torch.linspace(0.5, -0.5, num_envs)
    env.set_command(command)
    controller = LearnedController(policy, num_envs)
    for _ in range(_WALK_OFF):
        env.step(controller.act(env.get_observations()))
    other = make_simulation(env.model, num_envs, device, engine="warp")
    other.record("sensordata")
    _put_at_the_same(env.simulation, other)
    agreed = torch.ones(num_envs, dtype=torch.bool)
    alive = agreed.clone()
    worst = dict.fromkeys(TOLERANCES, 0.0)
    sums = {name: torch.zeros(2, 2, dtype=torch.float64) for name in MEAN_TOLERANCES}
    for _ in range(steps):
        _, _, dones, _ = env.step(controller.act(env.get_observations()))
        other.ctrl[:] = env.simulation.ctrl.to(other.device)
        other.step(cfg.decimation)
        alive &= ~dones
        agreed &= alive & (_contacts(env, env.simulation) == _contacts(env, other)).all(dim=1)
        ours, theirs = _quantities(env, env.simulation), _quantities(env, other)
        for name in TOLERANCES:
            difference = (ours[name] - theirs[name])[alive]
            worst[name] = max(worst[name], largest(difference, agreed[alive]))
        for engine, simulation in enumerate((env.simulation, other)):
            for name, values in _gait(env, simulation, alive).items():
                sums[name][engine] += torch.tensor([float(values.sum()), values.numel()])
    means = {name: (total[:, 0] / total[:, 1]).tolist() for name, total in sums.items()}
    about = {"device": device, "num_envs": num_envs, "steps": steps}
    return about | judge(worst, means, int(agreed.sum()), num_envs, steps)


def largest(difference: torch.Tensor, agreed: torch.Tensor) -> float:
    """Return the largest difference of robots that agreed; infinity if any at all is not finite.

    Args:
        difference: Of all robots. Shape: (robots, ...).
        agreed: Whose contacts agreed until now. Shape: (robots,).
    """
    if not bool(difference.isfinite().all()):
        return math.inf
    compared = difference[agreed].abs()
    return float(compared.max()) if compared.numel() else 0.0


def judge(
    worst: Mapping[str, float],
    means: Mapping[str, Sequence[float]],
    agreed: int,
    num_envs: int,
    steps: int,
) -> dict[str, object]:
    """Return what was found, and whether all of it is within the tolerances.

    Args:
        worst: Largest differences, by the names of `TOLERANCES`.
        means: Means over all robots by CPU and device, by the names of `MEAN_TOLERANCES`.
        agreed: Robots whose contacts agreed to the end.
        num_envs: Robots.
        steps: Control steps.
    """
    apart = {name: abs(theirs / ours - 1.0) for name, (ours, theirs) in means.items()}
    least = min(num_envs - 1, num_envs * LEAST_AGREED**steps)
    # NaN is no larger than a tolerance, so what is asked is whether all are at most that.
    within = all(worst[name] <= most for name, most in TOLERANCES.items()) and all(
        apart[name] <= most for name, most in MEAN_TOLERANCES.items()
    )
    return {
        "differences": dict(worst),
        "tolerances": TOLERANCES,
        "agreed": agreed / num_envs,
        "least_agreed": least / num_envs,
        "means": {name: list(pair) for name, pair in means.items()},
        "mean_differences": apart,
        "mean_tolerances": MEAN_TOLERANCES,
        "within_tolerances": within and agreed >= max(1.0, least),
    }


def _put_at_the_same(one: Simulation, other: Simulation) -> None:
    fields = {name: value for name, value in one.state_dict().items() if name.startswith("field/")}
    moving = {name: getattr(one, name).clone() for name in ("qpos", "qvel", "ctrl")}
    state = other.state_dict() | fields | moving
    other.load_state_dict({name: value.to(other.device) for name, value in state.items()})


def _contacts(env: QuadrupedEnv, simulation: Simulation) -> torch.Tensor:
    """Return what the feet's sensors found at every physics step. Shape: (num_envs, found)."""
    found = simulation.substeps["sensordata"]
    return found[:, :, sensor_slice(env.model, "FR_foot_contact", 4)].cpu().float().flatten(1)


def _quantities(env: QuadrupedEnv, simulation: Simulation) -> dict[str, torch.Tensor]:
    """Return what `TOLERANCES` names. Shapes: (num_envs, ...)."""
    return {
        "qpos": simulation.qpos.cpu().float(),
        "qvel": simulation.qvel.cpu().float(),
        "downward speed of feet": _downward(env, simulation).clamp(min=0.0).flatten(1),
    }


def _downward(env: QuadrupedEnv, simulation: Simulation) -> torch.Tensor:
    """Return the feet's downward speed, m/s. Shape: (num_envs, physics steps, 4)."""
    columns = sensor_slice(env.model, "FR_foot_vel", 4)
    return -simulation.substeps["sensordata"][:, :, columns].cpu().float()[:, :, 2::3]


def _gait(
    env: QuadrupedEnv, simulation: Simulation, alive: torch.Tensor
) -> dict[str, torch.Tensor]:
    """Return what `MEAN_TOLERANCES` names of robots that have not fallen: a value each time."""
    columns = sensor_slice(env.model, "FR_foot_contact", 4)
    touching = simulation.substeps["sensordata"][:, :, columns].cpu() > 0.0
    lands = touching[:, 1:] & ~touching[:, :-1] & alive[:, None, None]
    return {
        "height": simulation.qpos.cpu().float()[alive, 2],
        "speed": simulation.qvel.cpu().float()[alive, :2].norm(dim=1),
        "landing speed": _downward(env, simulation)[:, :-1][lands].clamp(min=0.0),
    }


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status: 1 beyond the tolerances.

    Raises:
        MuteError: If an argument is bad.
    """
    argv = command_line() if argv is None else list(argv)
    args = parse(GpuEnginesArgs, argv, "Hold MuJoCo Warp on a device to MuJoCo on the CPU.")
    check_option("num-envs", args.num_envs, Range(1, 2**20, whole=True))
    check_option("steps", args.steps, Range(1, 10**4, whole=True))
    result = compare(args.device, args.num_envs, args.steps)
    result["peak_gpu_memory_mb"] = peak_of_this_process(args.device)
    print(json.dumps(without_nan(result)))
    return int(not result["within_tolerances"])


if __name__ == "__main__":
    run_cli(main)
