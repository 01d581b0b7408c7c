"""What quiet terms cost a landing: python -m benchmarks.quiet_terms.

Terms of the literature are compared by one recipe (`mute.tasks`), for which they have to weigh as
much. This measures what each costs per landing on a walk of one policy, scaled to one at 0.5 m/s.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from mute.command_lines.arguments import MANY_ROBOTS, check_option, check_seed, command_line, parse
from mute.controllers import LearnedController, load_policy
from mute.controllers.learned import Policy
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.rewards import RewardTermCfg
from mute.evaluation.tables import print_table, write_json
from mute.evaluation.usual_robots import robots_cfg
from mute.support.errors import run_cli
from mute.support.provenance import current_commit, machine_kind
from mute.support.ranges import Range
from mute.support.resources import shipped_file
from mute.tasks import FLAT_TASK, QUIET_TERM_TASKS, make_task

__all__ = ["QuietTermsArgs", "costs", "main"]

_SPEED = 0.5
"""Landing speed that costs are told for, m/s."""


@dataclass
class QuietTermsArgs:
    """Arguments of the measurement."""

    policy: Path = shipped_file(FLAT_TASK)
    """Whose landings are measured, at beta 0."""
    robots: int = 48
    """Number of robots."""
    seconds: float = 10.0
    """Time that they walk, s."""
    seed: int = 0
    """Seed of the robots and of their first states."""
    out: Path | None = None
    """JSON file to write."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Raises:
        MuteError: If an argument is bad or the policy cannot be used.
    """
    argv = command_line() if argv is None else list(argv)
    args = parse(QuietTermsArgs, argv, "What quiet terms cost a landing.")
    check_option("robots", args.robots, MANY_ROBOTS)
    check_option("seconds", args.seconds, Range(1.0, 1000.0))
    check_seed(args.seed)
    rows = costs(load_policy(args.policy), args.robots, args.seconds, args.seed)
    print_table(f"costs of a landing at {_SPEED:g} m/s", rows, list(rows[0]))
    if args.out is not None:
        about = {"commit": current_commit(), "machine": machine_kind(), "seed": args.seed}
        write_json(args.out, about | {"robots": args.robots, "rows": rows})
    return 0


def costs(policy: Policy, robots: int, seconds: float, seed: int) -> list[dict[str, Any]]:
    """Return what each task's quiet terms cost per landing at `_SPEED`, as plain data.

    Costs grow with the square of the landing speed, as what is measured is scaled by.

    Args:
        policy: Whose walk is measured, at 0.5 m/s and beta 0.
        robots: Number of robots.
        seconds: Time that they walk, s.
        seed: Seed of the robots and of their first states.
    """
    terms = _terms()
    cfg = robots_cfg(policy, robots, seconds, seed)
    scene = dataclasses.replace(cfg.scene, foot_forces=True)
    rewards = dataclasses.replace(cfg.rewards, terms=terms)
    env = QuadrupedEnv(dataclasses.replace(cfg, scene=scene, rewards=rewards))
    command = torch.tensor((_SPEED, 0.0, 0.0, 0.0))
    env.set_command(command)
    controller = LearnedController(policy, robots)
    sums, landings = dict.fromkeys(terms, 0.0), [torch.zeros(0)]
    for _ in range(round(seconds / env.step_dt)):
        _, _, dones, extras = env.step(controller.act(env.get_observations()))
        landings.append(env.footfalls.landing_speed[env.footfalls.touchdown].clone())
        for name in sums:
            sums[name] -= float(extras["log"][f"Reward/{name}"])
        if bool(dones.any()):
            controller.reset(dones)
            env.set_command(command)
    speeds = torch.cat(landings)
    # Sums of what all robots pay on the mean, per second, over control steps.
    each = robots / len(speeds) * _SPEED**2 / float(speeds.square().mean())
    return [
        {
            "task": task,
            "weights": ", ".join(
                f"{name.removeprefix(f'{task}_')} {term.weight:g}"
                for name, term in terms.items()
                if name.startswith(f"{task}_")
            ),
            "cost of a landing": each * sum(sums[n] for n in terms if n.startswith(f"{task}_")),
            "landings": len(speeds),
            "landing speed, rms": float(speeds.square().mean().sqrt()),
        }
        for task in QUIET_TERM_TASKS
    ]


def _terms() -> dict[str, RewardTermCfg]:
    """Return the quiet terms of all tasks, each by its task and name, scaled by nothing."""
    return {
        f"{task}_{name}": dataclasses.replace(copy.deepcopy(term), group="other")
        for task in QUIET_TERM_TASKS
        for name, term in make_task(task).env.rewards.terms.items()
        if term.group == "phase" and term.weight != 0.0
    }


if __name__ == "__main__":
    run_cli(main)
