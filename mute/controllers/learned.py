"""A trained policy as a controller: estimator and actor, without anything of learning."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from tensordict import TensorDict

from mute.checkpoint import CheckpointError, first_line, load_checkpoint
from mute.config import TaskCfg, from_plain
from mute.controllers.heading_hold import heading_hold
from mute.envs.observations import OBS_DIM
from mute.envs.quadruped_env import NUM_ACTIONS
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.learning.estimated_env import actor_groups, make_estimator, policy_group
from mute.learning.model import PreparedModel
from mute.learning.saved_state import check_form, check_iteration, check_weights, entry
from mute.networks.encoders import forgotten
from mute.networks.estimator import Estimate, Estimator

__all__ = ["LearnedController", "Policy", "load_policy", "make_policy"]


@dataclass
class Policy:
    """A trained policy and what it was trained on."""

    task: str
    """Name of the task."""
    cfg: TaskCfg
    """Configuration that it was trained with."""
    iteration: int
    """Last finished iteration."""
    estimator: Estimator
    """The estimator, in evaluation mode."""
    actor: PreparedModel
    """The actor, its normaliser inside, in evaluation mode."""

    @property
    def quiet_factor(self) -> bool:
        """Whether it was trained with beta, and sees it."""
        return self.cfg.agent.quiet_factor

    def with_heading_gain(self, gain: float) -> Policy:
        """Return the same policy with another `agent.heading_gain`; with 0 it holds no heading."""
        agent = dataclasses.replace(self.cfg.agent, heading_gain=gain)
        return dataclasses.replace(self, cfg=dataclasses.replace(self.cfg, agent=agent))

    def controller(self, cfg: QuadrupedEnvCfg) -> LearnedController:
        """Return what drives the robots of an environment with it, without a past."""
        return LearnedController(self, cfg.num_envs)


def load_policy(path: Path) -> Policy:
    """Load the policy of a checkpoint, or of the small file that ships.

    Its physics takes the threads that suit this machine, whatever suited the one it was trained on.

    Raises:
        CheckpointError: If the file is missing, damaged, foreign, or does not fit this version.
    """
    saved = load_checkpoint(path)
    try:
        return _with_own_threads(make_policy(saved))
    except (ValueError, RuntimeError) as error:
        reason = first_line(error)
        raise CheckpointError(f"{path} holds no policy that fits this version: {reason}") from error


def _with_own_threads(policy: Policy) -> Policy:
    env = dataclasses.replace(policy.cfg.env, num_threads=0)
    return dataclasses.replace(policy, cfg=dataclasses.replace(policy.cfg, env=env))


def make_policy(saved: dict[str, Any]) -> Policy:
    """Make a policy of its own, on the CPU, from what `runner.policy_part` returns.

    Raises:
        ValueError: If that is incomplete, does not fit, or has weights that are not finite.
        RuntimeError: If there is no memory for such networks.
    """
    task, iteration = entry(saved, "task"), check_iteration(saved)
    check_form(task, "", "task")
    cfg = from_plain(entry(saved, "config"))
    estimator = make_estimator(cfg)
    actor = _actor(cfg, estimator)
    for name, network in (("estimator", estimator), ("actor", actor)):
        weights = entry(saved, f"{name}_state_dict")
        check_weights(weights, network, f"{name}_state_dict")
        network.load_state_dict(weights)
    return Policy(task, cfg, iteration, estimator.eval(), actor.eval())


class LearnedController:
    """Drives robots with a trained policy; keeps the estimator's state and heading of each."""

    def __init__(self, policy: Policy, num_envs: int) -> None:
        """Start with no past.

        Args:
            policy: What to drive with.
            num_envs: Number of robots.
        """
        self.policy = policy
        self.num_envs = num_envs
        self._hold = heading_hold(policy.cfg)
        self._turned = torch.zeros(num_envs, 1)
        self._state = policy.estimator.initial_state(num_envs)
        self.estimate: Estimate | None = None
        """What the estimator said at the last `act`, None before. Shapes: (num_envs, ...)."""

    def reset(self, mask: torch.Tensor | None = None) -> None:
        """Forget the past of the masked robots, or of all. Mask shape: (num_envs,)."""
        if mask is None:
            mask = torch.ones(self.num_envs, dtype=torch.bool)
        self._turned, *state = forgotten((self._turned, *self._state), mask)
        self._state = tuple(state)

    @torch.no_grad()
    def act(self, observations: TensorDict) -> torch.Tensor:
        """Return the mean actions for one control step. Shape: (num_envs, 12)."""
        policy, obs = self.policy, observations["policy"]
        if self._hold is not None:
            obs, self._turned = self._hold.step(obs, self._turned)
        obs = policy_group(obs, policy.estimator)
        self.estimate, self._state = policy.estimator.step(obs, self._state)
        with_phase = policy.cfg.agent.estimation.actor_uses_phase
        groups = actor_groups(obs, self.estimate, policy.estimator, policy.cfg.env, with_phase)
        return policy.actor(TensorDict(groups, batch_size=[self.num_envs]))


def _actor(cfg: TaskCfg, estimator: Estimator) -> PreparedModel:
    """Build the actor's network with the class that learns, from the sizes of its inputs."""
    with torch.no_grad():
        obs = policy_group(torch.zeros(1, OBS_DIM), estimator)
        estimate, _ = estimator.step(obs, estimator.initial_state(1))
    with_phase = cfg.agent.estimation.actor_uses_phase
    groups = actor_groups(obs, estimate, estimator, cfg.env, with_phase)
    example = TensorDict(groups, batch_size=[1])
    train_cfg = cfg.agent.rsl_rl()
    settings = {key: value for key, value in train_cfg["actor"].items() if key != "class_name"}
    return PreparedModel(example, train_cfg["obs_groups"], "actor", NUM_ACTIONS, **settings)
