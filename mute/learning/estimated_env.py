"""The estimator in the loop: an environment that also publishes what is estimated of it.

rsl_rl sees two more observation groups, `estimate` and `go`; its PPO and its models stay as they
are, and no policy gradient can reach the estimator.
"""

from __future__ import annotations

from typing import Any

import torch
from rsl_rl.env import VecEnv
from tensordict import TensorDict

from mute.config import TaskCfg
from mute.envs.commands import BETA
from mute.envs.observations import OBS_DIM, OBSERVATION_WIDTHS, slices
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.learning.bootstrapping import AdaptiveBootstrap
from mute.networks.encoders import State, forgotten
from mute.networks.estimator import Estimate, Estimator
from mute.support.threads import use_collection_threads, use_learning_threads

__all__ = ["EstimatedEnv", "actor_groups", "estimate_group", "go_group", "make_estimator"]

_COMMAND = slices(OBSERVATION_WIDTHS)["command"]
_VELOCITY_COMMAND = slice(_COMMAND.start, _COMMAND.start + BETA)
_SLOWEST = 0.01
"""Size of a velocity command, m/s and rad/s taken together, that rounding alone does not make."""
_ROUNDING = 1e-3
"""Share of a size that rounding may take away."""


def make_estimator(cfg: TaskCfg) -> Estimator:
    """Return a new estimator for a task's observations, in the scale of its height map."""
    heights = cfg.env.height_map
    return Estimator(
        OBS_DIM if cfg.agent.quiet_factor else OBS_DIM - 1,
        heights.grid().shape[0],
        cfg.agent.estimation.network,
        height_offset=heights.offset,
        height_scale=heights.scale,
    )


def policy_group(obs: torch.Tensor, estimator: Estimator) -> torch.Tensor:
    """Return what the networks see of an observation: all, or all but its last column, beta.

    Args:
        obs: The environment's group `policy`. Shape: (num_envs, OBS_DIM).
        estimator: The estimator, made for a task with the quiet factor or without.
    """
    return obs[:, : estimator.obs_dim]


def estimate_group(estimate: Estimate, estimator: Estimator, with_phase: bool) -> torch.Tensor:
    """Return the observation group `estimate`: velocity, normalised heights, latent, phase.

    Args:
        estimate: Estimates of one step. Shapes: (num_envs, ...).
        estimator: The estimator that made them, for the heights' scale.
        with_phase: Whether the phase is part of the group.
    """
    parts = [estimate.base_lin_vel, estimator.normalised(estimate.heights), estimate.latent]
    return torch.cat([*parts, estimate.phase] if with_phase else parts, dim=-1)


def go_group(obs: torch.Tensor, cfg: QuadrupedEnvCfg) -> torch.Tensor:
    """Return the observation group `go`: 1 for robots that are asked to move, 0 to stand.

    A command that is smaller than the deadband of the training's is one to stand.

    Args:
        obs: The group `policy`, with a command that bears no noise. Shape: (num_envs, obs_dim).
        cfg: The environment of the training.

    Returns:
        Shape (num_envs, 1).
    """
    slowest = max(_SLOWEST, (1.0 - _ROUNDING) * cfg.commands.deadband)
    seen = abs(cfg.observations.scales["command"]) * slowest
    size_sq = obs[:, _VELOCITY_COMMAND].square().sum(dim=-1, keepdim=True)
    return (size_sq > seen**2).to(obs.dtype)


def actor_groups(
    obs: torch.Tensor,
    estimate: Estimate,
    estimator: Estimator,
    cfg: QuadrupedEnvCfg,
    with_phase: bool,
) -> dict[str, torch.Tensor]:
    """Return all observation groups that an actor may see.

    Args:
        obs: The group `policy`, from `policy_group`. Shape: (num_envs, obs_dim).
        estimate: What is estimated from it. Shapes: (num_envs, ...).
        estimator: The estimator that did.
        cfg: The environment of the training.
        with_phase: Whether the phase is part of the group `estimate`.
    """
    return {
        "policy": obs,
        "estimate": estimate_group(estimate, estimator, with_phase),
        "go": go_group(obs, cfg),
    }


class EstimatedEnv(VecEnv):
    """Wraps an environment and runs the estimator between it and the algorithm.

    Order within `step`: the phase estimated from o_t goes to the environment, which rewards by it;
    the environment steps; the estimator forgets finished episodes; o_{t+1}, which is the new
    episode's first observation there, is consumed. Nothing is changed in place: rsl_rl keeps
    references.
    """

    def __init__(
        self,
        env: QuadrupedEnv,
        estimator: Estimator,
        device: str,
        with_phase: bool = True,
        bootstrap: AdaptiveBootstrap | None = None,
    ) -> None:
        """Consume the environment's first observation.

        Args:
            env: The environment.
            estimator: The estimator, on `device`.
            device: Device of the networks; the environment may live on another.
            with_phase: Whether `estimate` holds the phase.
            bootstrap: Tells which robots' `estimate` holds the true velocity; None for none.
        """
        self.env = env
        self.estimator = estimator
        self.device = torch.device(device)
        self.num_envs = env.num_envs
        self.num_actions = env.num_actions
        self.max_episode_length = env.max_episode_length
        self.with_phase = with_phase
        self.bootstrap = bootstrap
        self.state: State = estimator.initial_state(env.num_envs, self.device)
        """What the estimator remembers after the current observation."""
        self.state_before: State = self.state
        """What it remembered before it, nothing where an episode has just begun."""
        self._consume(env.get_observations(), self.state)

    @property
    def cfg(self) -> QuadrupedEnvCfg:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The environment's configuration."""
        return self.env.cfg

    @property
    def episode_length_buf(self) -> torch.Tensor:
        """Age of every episode in control steps. Shape: (num_envs,)."""
        return self.env.episode_length_buf

    @episode_length_buf.setter
    def episode_length_buf(  # pyright: ignore[reportIncompatibleVariableOverride]
        self, value: torch.Tensor
    ) -> None:
        self.env.episode_length_buf = value.to(self.env.device)

    @property
    def estimate(self) -> Estimate:
        """What is estimated from the current observation. Shapes: (num_envs, ...)."""
        return self._estimate

    def get_observations(self) -> TensorDict:
        """Return the current observations, without side effects."""
        return self._observations

    def step(
        self, actions: torch.Tensor
    ) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict[str, Any]]:
        """Advance by one control step, see the class."""
        if self.estimator.num_feet:
            self.env.set_estimated_phase(self._estimate.phase.to(self.env.device))
        use_collection_threads()
        observations, rewards, dones, extras = self.env.step(actions.to(self.env.device))
        use_learning_threads()
        if self.bootstrap is not None:
            self.bootstrap.record(rewards.to(self.device), dones.to(self.device))
        ended = dones.to(self.device, torch.bool)
        state = forgotten(self.state, ended) if bool(ended.any()) else self.state
        self._consume(observations, state)
        return self._observations, rewards, dones, extras

    @torch.inference_mode()
    def refresh(self) -> None:
        """Estimate the current observation anew, with the estimator as it now is.

        After the estimator has learnt, the observation that opens the next rollout must carry the
        new estimate, or the stored rollout could not be reproduced. The loop holds a reference to
        the group's tensor, so here alone it is overwritten.
        """
        use_learning_threads()  # products differ in the last bit with the number of threads
        observations = self._observations
        self._estimate, self.state = self.estimator.step(observations["policy"], self.state_before)
        group = estimate_group(self._estimate, self.estimator, self.with_phase)
        published = observations["estimate"]
        published.copy_(self._with_truth(group, observations))

    def restart(self, step_count: int) -> None:
        """Begin new episodes of all robots in the middle of a training.

        Args:
            step_count: Control steps trained so far, by which the curricula go.
        """
        self.env.step_count = step_count
        observations = self.env.reset()
        if self.bootstrap is not None:
            self.bootstrap.forget_running()
        use_learning_threads()
        self._consume(observations, self.estimator.initial_state(self.num_envs, self.device))

    def state_dict(self) -> dict[str, Any]:
        """Return all that is needed to continue bit for bit, the environment included."""
        state = {
            "env": self.env.state_dict(),
            "state_before": [part.clone() for part in self.state_before],
        }
        if self.bootstrap is not None:
            state["bootstrap"] = self.bootstrap.state_dict()
        return state

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from a `state_dict`; the estimator's weights must be loaded before.

        Raises:
            ValueError: If it belongs to another number of environments.
        """
        self.env.load_state_dict(state["env"])
        if self.bootstrap is not None:
            self.bootstrap.load_state_dict(state["bootstrap"])
        before = tuple(part.to(self.device) for part in state["state_before"])
        use_learning_threads()  # as in `refresh`, whose estimate this makes again
        self._consume(self.env.get_observations(), before)

    @torch.no_grad()
    def _consume(self, observations: TensorDict, state_before: State) -> None:
        observations = observations.to(self.device)
        self.state_before = state_before
        obs = policy_group(observations["policy"], self.estimator)
        self._estimate, self.state = self.estimator.step(obs, state_before)
        own = actor_groups(obs, self._estimate, self.estimator, self.cfg, self.with_phase)
        own["estimate"] = self._with_truth(own["estimate"], observations)
        groups = dict(observations.items()) | own
        self._observations = TensorDict(groups, batch_size=[self.num_envs], device=self.device)

    def _with_truth(self, group: torch.Tensor, observations: TensorDict) -> torch.Tensor:
        """Return the group `estimate` with the true velocity where the bootstrap says so."""
        if self.bootstrap is None:
            return group
        velocity = observations["privileged"][:, self.env.privileged_slices["base_lin_vel"]]
        estimated, rest = group.split((3, group.shape[1] - 3), dim=1)
        return torch.cat((torch.where(self.bootstrap.told, velocity, estimated), rest), dim=1)
