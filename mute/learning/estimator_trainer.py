"""How the estimator learns: its labels, the paper's losses and its own optimiser.

It learns from each rollout one iteration late. By then the contacts that follow the rollout are
known, so that nearly every sample of it has a phase: the label needs the foot's next event.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import torch
from rsl_rl.storage import RolloutStorage
from torch import Tensor, nn

from mute.config import EstimationCfg
from mute.envs.phase import hindsight_phase
from mute.learning.distributed import Ranks
from mute.learning.optimizer import FusedAdam
from mute.networks.encoders import State
from mute.networks.estimator import Estimate, Estimator

__all__ = ["EstimatorTrainer", "Labels", "Losses", "estimator_losses"]


@dataclass
class Labels:
    """Truth for a sequence of observations. T steps, N environments."""

    base_lin_vel: Tensor
    """Trunk velocity in the body frame, m/s. Shape: (T, N, 3)."""
    heights: Tensor
    """Trunk height above each grid point that is estimated, m. Shape: (T, N, num_heights)."""
    phase: Tensor
    """Phase of each foot whose phase is estimated. Shape: (T, N, num_feet)."""
    phase_closed: Tensor
    """Where the phase is known, bool. Shape: (T, N, num_feet)."""
    next_obs: Tensor
    """Observation one step later. Shape: (T, N, obs_dim)."""
    next_valid: Tensor
    """Where that belongs to the same episode, bool. Shape: (T, N)."""

    def select(self, env_ids: Tensor) -> Labels:
        """Return the labels of some environments."""
        return Labels(**{key: value.index_select(1, env_ids) for key, value in vars(self).items()})


@dataclass
class Losses:
    """The paper's losses (section II-B) and the errors behind them, all scalars."""

    total: Tensor
    """L = L_est + lambda_fwd L_fwd + lambda_phase L_phase."""
    estimation: Tensor
    """L_est: mean squared error of the velocity plus that of the heights, in height_scale."""
    forward: Tensor
    """L_fwd: mean squared error of o_{t+1} plus lambda KL, the KL summed over z; over steps with a
    next observation, with an LSTM the KL over all."""
    phase: Tensor
    """L_phase: mean squared error of the phase."""
    velocity_rmse: Tensor
    """Root of the mean squared error over axes, m/s."""
    height_rmse: Tensor
    """Root mean squared error, m."""
    phase_mae: Tensor
    """Mean absolute error."""


def estimator_losses(
    estimate: Estimate,
    next_obs_hat: Tensor,
    labels: Labels,
    cfg: EstimationCfg,
    height_scale: float,
    ranks: Ranks | None = None,
) -> Losses:
    """Return the losses of a batch of sequences.

    Args:
        estimate: Estimates. Shapes: (T, N, ...).
        next_obs_hat: The decoder's prediction of the next observation. Shape: (T, N, obs_dim).
        labels: Truth.
        cfg: Weights.
        height_scale: What counts as 1 in heights, m: counted in metres, their share of the loss
            would vanish.
        ranks: Processes whose mean loss is meant: a sample then weighs the same wherever it is.
    """
    ranks = ranks or Ranks()
    counts = torch.stack((labels.next_valid.sum(), labels.phase_closed.sum())).float()
    num_valid, num_closed = ranks.mean(counts).clamp(min=1.0 / ranks.world_size)
    velocity_error = (estimate.base_lin_vel - labels.base_lin_vel).square().mean()
    height_errors = (estimate.heights - labels.heights).square()
    height_error = height_errors.mean() if height_errors.numel() else height_errors.sum()
    estimation = velocity_error + height_error / height_scale**2
    reconstruction = _masked_mean(
        (next_obs_hat - labels.next_obs).square().mean(dim=-1), labels.next_valid, num_valid
    )
    mean, log_var = estimate.latent_mean, estimate.latent_log_var
    divergences = 0.5 * (mean.square() + log_var.exp() - 1.0 - log_var).sum(dim=-1)
    # Reconstruction and divergence are two sides of one bound: where nothing is decoded, as at
    # the end of an episode, DreamWaQ's latent is bound to nothing. MUTE's paper names no mask, and
    # its LSTM hands each step's latent to the phase network: that divergence is over all steps,
    # and trainings of the recipe stay what they were.
    divergence = (
        divergences.mean()
        if cfg.network.encoder == "lstm"
        else _masked_mean(divergences, labels.next_valid, num_valid)
    )
    forward = reconstruction + cfg.lambda_kl * divergence
    difference = estimate.phase - labels.phase
    phase = _masked_mean(difference.square(), labels.phase_closed, num_closed)
    return Losses(
        total=estimation + cfg.lambda_fwd * forward + cfg.lambda_phase * phase,
        estimation=estimation,
        forward=forward,
        phase=phase,
        velocity_rmse=velocity_error.detach().sqrt(),
        height_rmse=height_error.detach().sqrt(),
        phase_mae=_masked_mean(difference.detach().abs(), labels.phase_closed, num_closed),
    )


def _masked_mean(value: Tensor, mask: Tensor, count: Tensor) -> Tensor:
    return (value * mask).sum() / count


class EstimatorTrainer:
    """Trains the estimator on rollouts, by back-propagation truncated at each rollout's start."""

    def __init__(
        self,
        estimator: Estimator,
        cfg: EstimationCfg,
        privileged: dict[str, slice],
        min_steps: int,
        max_steps: int,
    ) -> None:
        """Make the optimiser.

        Args:
            estimator: The network.
            cfg: Learning rate and weights.
            privileged: Columns of the group `privileged`.
            min_steps: Shortest contact segment, in control steps.
            max_steps: Longest segment with a phase, in control steps.
        """
        self.estimator = estimator
        self.cfg = cfg
        self.optimizer = FusedAdam(estimator.parameters(), cfg.learning_rate)
        self._privileged = privileged
        self._min_steps, self._max_steps = min_steps, max_steps
        self._past: dict[str, Tensor] = {}

    def update(
        self, storage: RolloutStorage, initial_state: State, ranks: Ranks | None = None
    ) -> dict[str, float]:
        """Learn from the rollout before the one in the storage, and remember the latter.

        Args:
            storage: The rollout just collected.
            initial_state: What the estimator remembered before its first observation.
            ranks: Processes that learn together.

        Returns:
            Losses and errors by name; empty after the first rollout, which only waits.
        """
        current = self._record(storage, initial_state)
        past, self._past = self._past, current
        opening = past["dones"][-1:] if past else torch.ones_like(current["dones"][:1])
        current["starts"] = torch.cat((opening, current["dones"][:-1]))
        if not past:
            return {}
        # Contacts before the window tell when its first segments began.
        current["contact_before"], current["starts_before"] = past["contact"], past["starts"]
        return self._learn(past, self._labels(past, current), ranks or Ranks())

    def state_dict(self) -> dict[str, Any]:
        """Return the optimiser and the rollout that waits for its labels."""
        return {"optimizer": self.optimizer.state_dict(), "past": dict(self._past)}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from a `state_dict`."""
        self.optimizer.load_state_dict(state["optimizer"])
        device = next(self.estimator.parameters()).device
        self._past = {name: value.to(device) for name, value in state["past"].items()}

    def _record(self, storage: RolloutStorage, initial_state: State) -> dict[str, Tensor]:
        privileged = storage.observations["privileged"]
        heights = privileged[..., self._privileged["heights"]][..., : self.estimator.num_heights]
        remembered = zip(self.estimator.encoder.state_sizes, initial_state, strict=True)
        return {
            "obs": storage.observations["policy"].clone(),
            "base_lin_vel": privileged[..., self._privileged["base_lin_vel"]].clone(),
            "heights": self.estimator.metres(heights),
            "contact": privileged[..., self._privileged["contact"]] > 0.5,
            "dones": storage.dones[..., 0].bool(),
        } | {name: part.clone() for name, part in remembered}

    def _labels(self, past: dict[str, Tensor], current: dict[str, Tensor]) -> Labels:
        """Return the labels of the past rollout, with the contacts before and after it."""
        contacts, starts = (
            [past["contact"], current["contact"]],
            [past["starts"], current["starts"]],
        )
        if "contact_before" in past:
            contacts.insert(0, past["contact_before"])
            starts.insert(0, past["starts_before"])
        phase, closed = hindsight_phase(
            torch.cat(contacts), torch.cat(starts), self._min_steps, self._max_steps
        )
        end = phase.shape[0] - current["obs"].shape[0]
        window = slice(end - past["obs"].shape[0], end), slice(None), slice(self.estimator.num_feet)
        return Labels(
            base_lin_vel=past["base_lin_vel"],
            heights=past["heights"],
            phase=phase[window],
            phase_closed=closed[window],
            next_obs=torch.cat((past["obs"][1:], current["obs"][:1])),
            next_valid=~past["dones"],
        )

    def _learn(self, past: dict[str, Tensor], labels: Labels, ranks: Ranks) -> dict[str, float]:
        starts = past["starts"]
        num_envs = starts.shape[1]
        sums: dict[str, float] = {}
        drawn = torch.randperm(num_envs, device=starts.device)
        learnt_from = drawn[: self.cfg.robots_learnt_from(num_envs)]
        # `chunk` would make fewer where they do not divide evenly: 3 of 5 robots in 4.
        batches = learnt_from.tensor_split(self.cfg.num_mini_batches)
        for env_ids in batches:
            state = tuple(past[name][env_ids] for name in self.estimator.encoder.state_sizes)
            estimate, _ = self.estimator.unroll(
                past["obs"].index_select(1, env_ids),
                state,
                starts.index_select(1, env_ids),
                sample=True,
            )
            decoded = self.estimator.decode(estimate)
            chosen = labels.select(env_ids)
            losses = estimator_losses(
                estimate, decoded, chosen, self.cfg, self.estimator.height_scale, ranks
            )
            self.optimizer.zero_grad()
            losses.total.backward()
            ranks.average_gradients(self.estimator.parameters())
            nn.utils.clip_grad_norm_(self.estimator.parameters(), self.cfg.max_grad_norm)
            self.optimizer.step()
            for name, value in vars(losses).items():
                sums[name] = sums.get(name, 0.0) + float(value.detach()) / len(batches)
        if self.estimator.num_feet:
            sums["phase_closed"] = float(labels.phase_closed.float().mean())
        return {f"estimator_{name}": value for name, value in sums.items() if self._tells(name)}

    def _tells(self, name: str) -> bool:
        """Return whether a loss or an error is of something that is estimated."""
        estimator = self.estimator
        if name in ("phase", "phase_mae"):
            return estimator.num_feet > 0
        return name != "height_rmse" or estimator.num_heights > 0
