"""Which fields of a configuration may change where a training is resumed.

Each is applied, or refused with its name: an option that is read and not heeded would leave a run
whose `config.yaml` tells of another training than the one that took place.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Literal

from mute.config import TaskCfg

__all__ = ["RULES", "Rule", "check_resumption", "flat_fields", "rule_of"]

Rule = Literal["applied", "kept", "robots"]
"""What becomes of a changed field: `applied` from the next iteration on; `kept`, and so refused,
since the trained weights are made with it or for it; or `robots`: a part of the robots' saved
state, which may change where they begin anew, and is refused elsewhere."""

RULES: dict[str, Rule] = {
    "env.num_envs": "robots",
    "env.seed": "kept",
    "env.engine": "applied",  # another engine than the saved state's refuses that by itself
    "env.num_threads": "applied",
    "env.decimation": "kept",
    "env.episode_length": "applied",
    "env.action_scale": "kept",
    "env.action_clip": "applied",
    "env.max_tilt": "applied",
    "env.initial_joint_noise": "applied",
    "env.initial_velocity": "applied",
    "env.random_heading": "applied",
    "env.scene": "robots",
    "env.scene.timestep": "kept",
    "env.scene.integrator": "applied",
    "env.scene.cone": "applied",
    "env.scene.solver": "applied",
    "env.scene.iterations": "applied",
    "env.scene.ls_iterations": "applied",
    "env.scene.floor_solref": "applied",
    "env.terrain.kind": "robots",
    "env.terrain.first_levels": "robots",  # which robots start with
    "env.terrain": "applied",
    "env.footfall": "robots",
    "env.height_map": "kept",
    "env.commands": "applied",
    "env.observations.scales": "kept",
    "env.observations.noise": "applied",
    "env.observations.noise_level": "applied",
    "env.observations.sensors": "robots",
    "env.observations.accelerometer_noise": "applied",
    "env.rewards": "applied",
    "env.randomization": "robots",  # drawn once, when the robots are made
    "env.randomization.push_interval": "applied",
    "env.randomization.push_velocity": "applied",
    "agent.iterations": "applied",
    "agent.num_steps_per_env": "applied",
    "agent.settling_share": "applied",
    "agent.late_entropy_share": "applied",
    "agent.entropy_iterations": "applied",
    "agent.save_interval": "applied",
    "agent.noise_interval": "applied",
    "agent.actor_hidden": "kept",
    "agent.critic_hidden": "kept",
    "agent.activation": "kept",
    "agent.symmetric": "kept",
    "agent.leading_side": "kept",
    "agent.go_signal": "kept",
    "agent.quiet_factor": "kept",
    "agent.heading_gain": "applied",
    "agent.init_std": "kept",  # what has been learnt took its place
    "agent.std_range": "applied",
    "agent.matmul_precision": "applied",
    "agent.ppo": "applied",
    "agent.estimation.network": "kept",
    "agent.estimation.learning_rate": "applied",
    "agent.estimation.lambda_fwd": "applied",
    "agent.estimation.lambda_phase": "applied",
    "agent.estimation.lambda_kl": "applied",
    "agent.estimation.robots_share": "applied",
    "agent.estimation.num_mini_batches": "applied",
    "agent.estimation.max_grad_norm": "applied",
    "agent.estimation.actor_uses_phase": "kept",
    "agent.estimation.adaptive_bootstrap": "kept",
}
"""What becomes of each field, or of all fields of a part that have no entry of their own."""


def rule_of(path: str) -> Rule | None:
    """Return the rule of a field, by its own path or the longest that it lies under."""
    while path:
        if path in RULES:
            return RULES[path]
        path = path.rpartition(".")[0]
    return None


def flat_fields(cfg: TaskCfg) -> dict[str, Any]:
    """Return the value of every field, by its path."""
    return _flat(asdict(cfg), "")


def check_resumption(saved: TaskCfg, asked: TaskCfg, robots_anew: bool) -> None:
    """Check that a training may go on with another configuration than it had.

    Args:
        saved: What it had.
        asked: What it is to go on with.
        robots_anew: Whether the robots begin anew, so that nothing of theirs needs to fit.

    Raises:
        ValueError: If a field has changed that cannot be applied; names all of these.
    """
    old, new = flat_fields(saved), flat_fields(asked)
    refused = [
        f"{path}: a resumed run keeps {old.get(path)!r}, got {new.get(path)!r}"
        for path in dict.fromkeys((*old, *new))
        if old.get(path) != new.get(path) and not _may_change(path, robots_anew)
    ]
    if refused:
        raise ValueError("; ".join(refused))


def _may_change(path: str, robots_anew: bool) -> bool:
    rule = rule_of(path)
    return rule == "applied" or (rule == "robots" and robots_anew)


def _flat(value: Any, path: str) -> dict[str, Any]:  # noqa: ANN401
    if not isinstance(value, dict):
        return {path: value}
    return {
        name: item
        for key, part in value.items()
        for name, item in _flat(part, f"{path}.{key}" if path else str(key)).items()
    }
