"""Tiny runs for the tests of learning: few robots, short episodes, small networks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch

from mute.config import AgentCfg, EstimationCfg, PPOCfg, TaskCfg
from mute.envs.commands import CommandsCfg
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.randomization import RandomizationCfg
from mute.envs.rewards import RewardsCfg, paper_terms, reward_term
from mute.learning.runner import MuteRunner
from mute.networks.estimator import EstimatorCfg

NUM_ENVS = 8
NUM_STEPS = 8


def make_cfg(iterations: int = 2, **env: Any) -> TaskCfg:
    """Return a task whose episodes (5 steps) end inside its rollouts (8 steps).

    Its curricula all ramp over the first 40 steps, and within an episode every second step brings
    new commands and every third a push: what a checkpoint forgets of them shows.
    """
    ramp = (0.0, 0.8)
    curricula: dict[str, Any] = {
        "rewards": RewardsCfg(
            quiet_ramp=ramp,
            lift_ramp=ramp,
            guide_ramp=ramp,
            following_time=0.1,
            following_acceleration=5.0,
            terms={
                **paper_terms(),
                "foot_slip": reward_term("foot_slip", -0.04),
                "stand_still": reward_term("stand_still", -0.1),
                "diagonal_support": reward_term("diagonal_support", 0.5),
                "lin_vel_following": reward_term("lin_vel_following", 1.0, width=0.1, share=0.2),
            },
        ),
        "commands": CommandsCfg(initial_share=0.2, ramp=ramp, resampling_time=0.04),
        "randomization": RandomizationCfg(push_interval=0.06),
    }
    network = EstimatorCfg(
        lstm_hidden=16, latent_dim=4, decoder_hidden=(8,), phase_hidden=(8,), activation="elu"
    )
    settings = {"num_envs": NUM_ENVS, "num_threads": 1, "episode_length": 0.1, "seed": 3}
    settings |= curricula | env
    return TaskCfg(
        env=QuadrupedEnvCfg(**settings),
        agent=AgentCfg(
            iterations=iterations,
            num_steps_per_env=NUM_STEPS,
            save_interval=1,
            actor_hidden=(16,),
            critic_hidden=(16,),
            ppo=PPOCfg(num_learning_epochs=2, num_mini_batches=2),
            estimation=EstimationCfg(network=network, num_mini_batches=2),
        ),
    )


def make_runner(log_dir: Path | None = None, iterations: int = 2, **env: Any) -> MuteRunner:
    return MuteRunner("go1_mute", make_cfg(iterations, **env), log_dir)


def before_each_update(runner: MuteRunner, hook) -> None:
    """Call `hook()` whenever a rollout is complete and nothing has been learnt from it yet."""
    update = runner.alg.update

    def hooked() -> dict[str, float]:
        hook()
        return update()

    runner.alg.update = hooked


def clone_tree(value: Any) -> Any:
    if isinstance(value, torch.Tensor):
        return value.detach().clone()
    if isinstance(value, dict):
        return {key: clone_tree(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [clone_tree(item) for item in value]
    return value


def everything(runner: MuteRunner) -> dict[str, Any]:
    """Return all that a run goes on from."""
    return clone_tree(
        {
            "learner": runner.alg.save(),
            "learning_rate": runner.alg.learning_rate,
            "world": runner.env.state_dict(),
            "observations": dict(runner.env.get_observations().items()),
            "lstm": runner.env.state,
            "averages": runner.logger.state_dict() | {"total_time": 0.0},
            "random": torch.get_rng_state(),
            "iteration": runner.current_learning_iteration,
        }
    )


def differences(one: Any, other: Any, place: str = "") -> list[str]:
    """Return the places where two trees are not bit-equal; NaN equals itself."""
    if isinstance(one, dict) and isinstance(other, dict):
        if one.keys() != other.keys():
            return [f"{place}: keys {sorted(map(str, one.keys() ^ other.keys()))}"]
        return [d for key in one for d in differences(one[key], other[key], f"{place}/{key}")]
    if isinstance(one, list | tuple) and isinstance(other, list | tuple):
        if len(one) != len(other):
            return [f"{place}: lengths {len(one)} and {len(other)}"]
        pairs = enumerate(zip(one, other, strict=True))
        return [d for i, (a, b) in pairs for d in differences(a, b, f"{place}/{i}")]
    if isinstance(one, torch.Tensor) and isinstance(other, torch.Tensor):
        same = one.dtype == other.dtype and one.shape == other.shape
        same = same and torch.allclose(one, other, rtol=0.0, atol=0.0, equal_nan=True)
        return [] if same else [place]
    return [] if one == other else [f"{place}: {one!r} and {other!r}"]
