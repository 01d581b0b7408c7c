"""What the ranks of `test_distributed.py` do: they learn, and write what each of them ends with."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import torch
from learning_helpers import clone_tree, everything, make_cfg
from tensordict import TensorDict

import mute.networks.estimator
from mute.config import TaskCfg
from mute.learning.distributed import Ranks, joined_ranks
from mute.learning.runner import MuteRunner

_STORED = ("rewards", "actions", "dones", "values", "actions_log_prob")
SPLIT_ENVS = 16
"""Robots of the rollouts that the ranks share."""


def whole_batch_cfg(num_envs: int, ranks: int = 1) -> TaskCfg:
    """Return a task whose updates are one step each, over the whole rollout."""
    cfg = make_cfg(iterations=3, num_envs=num_envs // ranks)
    cfg.agent.ppo.num_mini_batches = cfg.agent.ppo.num_learning_epochs = 1
    cfg.agent.estimation.num_mini_batches = 1
    return cfg


def use_latent_means() -> None:
    """Leave the noise of the latent out, which no two ranks share."""
    mute.networks.estimator._sample = lambda mean, log_var, generator: mean


def record_rollout(runner: MuteRunner) -> dict[str, Any]:
    """Return a copy of the rollout that is about to be learnt from."""
    storage = runner.alg.storage
    stored = {name: getattr(storage, name) for name in _STORED} | {
        "observations": dict(storage.observations.items()),
        "distribution_params": list(storage.distribution_params or ()),
        "last_observations": dict(runner.env.get_observations().items()),
        "lstm_state": list(runner.alg._rollout_state),
    }
    return clone_tree(stored)


def learn_from(runner: MuteRunner, rollout: dict[str, Any], robots: slice) -> dict[str, Any]:
    """Learn from some robots of a recorded rollout; return gradients, normalisers and rates."""
    alg, storage = runner.alg, runner.alg.storage
    for name in _STORED:
        getattr(storage, name).copy_(rollout[name][:, robots])
    for name, value in rollout["observations"].items():
        storage.observations[name].copy_(value[:, robots])
    storage.distribution_params = tuple(part[:, robots] for part in rollout["distribution_params"])
    alg._rollout_state = tuple(part[robots] for part in rollout["lstm_state"])
    last = {name: value[robots] for name, value in rollout["last_observations"].items()}
    with torch.inference_mode():
        alg.compute_returns(TensorDict(last, batch_size=[runner.env.num_envs]))
    alg.update()
    networks_of = {"actor": alg.actor, "critic": alg.critic, "estimator": alg.trainer.estimator}
    gradients = {
        f"{name}.{key}": parameter.grad
        for name, network in networks_of.items()
        for key, parameter in network.named_parameters()
        if parameter.grad is not None
    }
    normalisers = {
        f"{name}.{key}": value
        for name in ("actor", "critic")
        for key, value in networks_of[name].obs_normalizer.state_dict().items()
    }
    return clone_tree(gradients | normalisers | {"rate": torch.tensor(alg.learning_rate)})


def _share_rollouts(ranks: Ranks, recorded: dict[str, Any]) -> list[dict[str, Any]]:
    runner = MuteRunner(
        "go1_mute", whole_batch_cfg(SPLIT_ENVS, ranks.world_size), None, ranks=ranks
    )
    runner.alg.load(recorded["start"], None, True)
    size = SPLIT_ENVS // ranks.world_size
    own = slice(ranks.rank * size, (ranks.rank + 1) * size)
    return [learn_from(runner, rollout, own) for rollout in recorded["rollouts"]]


def _estimate_is_current(ranks: Ranks) -> bool:
    """Tell whether a run begins with what its networks say, which are the first rank's."""
    runner = MuteRunner("go1_mute", make_cfg(), None, ranks=ranks)
    runner._agree()
    env = runner.env
    current, _ = env.estimator.step(env.get_observations()["policy"], env.state_before)
    # Estimated with gradients now and without them then: equal up to rounding.
    return torch.allclose(env.estimate.base_lin_vel, current.base_lin_vel, rtol=0.0, atol=1e-5)


def _train(ranks: Ranks, log_dir: Path, resume: Path | None) -> dict[str, Any]:
    runner = MuteRunner("go1_mute", make_cfg(4), log_dir, ranks=ranks)
    if resume is not None:
        runner.load(str(resume))
    assert runner.train()
    return everything(runner)


def main(directory: Path) -> None:
    torch.set_num_threads(1)
    with joined_ranks() as ranks:
        whole = _train(ranks, directory / "whole", None)
        resumed = _train(ranks, directory / "resumed", directory / "whole" / "model_1.pt")
        use_latent_means()
        recorded = torch.load(directory / "recorded.pt", weights_only=True)
        shared = _share_rollouts(ranks, recorded)
        current = _estimate_is_current(ranks)
        seen = {"whole": whole, "resumed": resumed, "shared": shared, "current": current}
        torch.save(seen, directory / f"rank_{ranks.rank}.pt")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
