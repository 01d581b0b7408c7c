"""Hold MuJoCo Warp on a device to MuJoCo on the CPU: python -m benchmarks.gpu_engines.

Robots walk with the policy that ships, in the engine of the CPU. From the same state, with the same
randomised physics, Warp follows the same set points, and positions, velocities and the downward
speed of the feet at every physics step are compared. A foot whose distance to the ground is within
rounding of zero touches it a physics step earlier in one of them, and from there on the two robots
differ by what such a step moves: so only robots are compared whose contacts agreed at every physics
step until then, and how many they are is told and must be enough. Prints one JSON object.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
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
from mute.support.ranges import Range
from mute.support.resources import RESOURCES
from mute.tasks import DEFAULT_TASK

__all__ = ["TOLERANCES", "GpuEnginesArgs", "compare", "main"]

TOLERANCES = {"qpos": 5e-4, "qvel": 1e-2, "downward speed of feet": 2e-3}
"""Largest difference after up to 100 control steps: m and rad, m/s and rad/s, m/s; those of the
test that holds the engines to each other on the CPU."""

_LEAST_AGREED = 0.5
"""Share of the robots whose contacts must agree to the end, or hardly anything is compared."""

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
    policy = load_policy(RESOURCES / "go1" / f"{DEFAULT_TASK}.pt")
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
    worst = dict.fromkeys(TOLERANCES, 0.0)
    for _ in range(steps):
        _, _, dones, _ = env.step(controller.act(env.get_observations()))
        other.ctrl[:] = env.simulation.ctrl.to(other.device)
        other.step(cfg.decimation)
        agreed &= ~dones & (_contacts(env, env.simulation) == _contacts(env, other)).all(dim=1)
        ours, theirs = _quantities(env, env.simulation), _quantities(env, other)
        for name in TOLERANCES:
            difference = (ours[name] - theirs[name])[agreed].abs()
            worst[name] = max(worst[name], float(difference.max()) if len(difference) else 0.0)
    share = float(agreed.float().mean())
    within = share >= _LEAST_AGREED and all(worst[name] <= TOLERANCES[name] for name in worst)
    return {
        "device": device,
        "num_envs": num_envs,
        "steps": steps,
        "differences": worst,
        "tolerances": TOLERANCES,
        "agreed": share,
        "least_agreed": _LEAST_AGREED,
        "within_tolerances": within,
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
    columns = sensor_slice(env.model, "FR_foot_vel", 4)
    velocity = simulation.substeps["sensordata"][:, :, columns].cpu().float()
    return {
        "qpos": simulation.qpos.cpu().float(),
        "qvel": simulation.qvel.cpu().float(),
        "downward speed of feet": (-velocity[:, :, 2::3]).clamp(min=0.0).flatten(1),
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
    print(json.dumps(result))
    return int(not result["within_tolerances"])


if __name__ == "__main__":
    run_cli(main)
