"""The estimator: from the history of observations to what the robot cannot measure.

An encoder turns the proprioceptive history into body velocity, terrain heights, a latent and the
phase of each foot. This module is the network alone; its labels, losses and optimiser are left to
others.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import torch
from torch import Tensor, nn

from mute.support.ranges import Range, check_ranges

from .encoders import Encoder, HistoryEncoder, LstmEncoder, State
from .perceptron import ACTIVATIONS, Activation, perceptron
from .reflection import Reflection, tie_mlp

__all__ = ["Estimate", "Estimator", "EstimatorCfg"]

_LOG_VAR_RANGE = (-10.0, 5.0)


@dataclass
class EstimatorCfg:
    """What is estimated, from what, and by networks of which sizes."""

    encoder: Literal["lstm", "history"] = "lstm"
    """What turns observations into what the heads read: an LSTM (the paper's), or a perceptron over
    the last few (DreamWaQ's)."""

    lstm_hidden: int = 128
    """Width of the LSTM's hidden state."""

    history_length: int = 5
    """Number of observations that the other encoder sees."""

    history_hidden: tuple[int, ...] = (128, 64)
    """Widths of its layers."""

    heights: bool = True
    """Whether the terrain heights are estimated."""

    phase: bool = True
    """Whether the phase of the feet is estimated."""

    latent_dim: int = 16
    """Size of the latent z."""

    decoder_hidden: tuple[int, ...] = (64,)
    """Widths of the hidden layers of the decoder that predicts the next observation."""

    decodes_velocity: bool = False
    """Whether the decoder sees the estimated velocity beside the latent, as DreamWaQ's does."""

    phase_hidden: tuple[int, ...] = (64,)
    """Widths of the hidden layers of the phase network."""

    activation: Activation = "elu"
    """Activation of the perceptrons."""

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            ValueError: If a size is not positive, or a name unknown.
        """
        width = Range(1, 16384, whole=True)
        names = ("lstm_hidden", "history_hidden", "latent_dim", "decoder_hidden", "phase_hidden")
        lengths = {"history_length": Range(1, 1000, whole=True)}
        check_ranges(self, "network", dict.fromkeys(names, width) | lengths)
        if not self.history_hidden:
            raise ValueError("network.history_hidden must be one width at least, got ()")
        known = {"encoder": ["lstm", "history"], "activation": list(ACTIVATIONS)}
        for name, values in known.items():
            value = getattr(self, name)
            if value not in values:
                raise ValueError(f"network.{name} must be one of {values}, got {value!r}")


class Estimate(NamedTuple):
    """What the estimator says of one step, shapes (N, .), or of a sequence, shapes (T, N, .)."""

    base_lin_vel: Tensor
    """Linear velocity of the base, in the frame of its label, in m/s. Last dimension: 3."""

    heights: Tensor
    """Height of the trunk above each point of the grid, in m. Last dimension: num_heights, 0 where
    none are estimated."""

    latent_mean: Tensor
    """Mean of the latent. Last dimension: latent_dim."""

    latent_log_var: Tensor
    """Logarithm of the variance of the latent, within [-10, 5]. Last dimension: latent_dim."""

    latent: Tensor
    """The latent in use: its mean, or a sample in training. Last dimension: latent_dim."""

    phase: Tensor
    """Phase of each foot, within [0, 1]. Last dimension: num_feet, 0 where none is estimated."""


class Estimator(nn.Module):
    """Encoder with heads for velocity, heights and a latent, a decoder and a phase network.

    The heads read the encoder's features. The decoder predicts the next observation from the
    latent, in the paper alone; the phase network is fed by the estimated heights (normalised),
    velocity and latent, and its gradient flows through them into the encoder, so that all losses
    shape it. Acting uses the mean of the latent, never a sample: a stored rollout that is unrolled
    again gives the same estimates.

    Source: MUTE, section "Phase Estimation"; with a history, without heights and phase, and with
    the velocity decoded, the context-aided estimator of DreamWaQ (Nahrendra et al., 2023).
    """

    def __init__(
        self,
        obs_dim: int,
        num_heights: int,
        cfg: EstimatorCfg | None = None,
        num_feet: int = 4,
        height_offset: float = 0.0,
        height_scale: float = 1.0,
    ) -> None:
        """Build the networks.

        Args:
            obs_dim: Size of an observation.
            num_heights: Number of points of the height map, if heights are estimated.
            cfg: Sizes; the defaults if left out.
            num_feet: Number of feet, if their phase is estimated.
            height_offset: Height for which the height head gives 0, m; the environment's.
            height_scale: Difference in height for which it gives 1, m; the environment's.
        """
        super().__init__()
        self.height_offset, self.height_scale = height_offset, height_scale
        self.cfg = cfg = cfg if cfg is not None else EstimatorCfg()
        self.obs_dim = obs_dim
        self.num_heights = num_heights if cfg.heights else 0
        self.num_feet = num_feet if cfg.phase else 0
        # Weights are saved under the encoder's name.
        if cfg.encoder == "lstm":
            self.lstm = LstmEncoder(obs_dim, cfg.lstm_hidden)
        else:
            self.history = HistoryEncoder(
                obs_dim, cfg.history_length, cfg.history_hidden, cfg.activation
            )
        features = self.encoder.features
        self.base_lin_vel_head = nn.Linear(features, 3)
        self.heights_head = nn.Linear(features, num_heights) if cfg.heights else None
        self.latent_mean_head = nn.Linear(features, cfg.latent_dim)
        self.latent_log_var_head = nn.Linear(features, cfg.latent_dim)
        decoded = cfg.latent_dim + (3 if cfg.decodes_velocity else 0)
        self.decoder = perceptron(decoded, cfg.decoder_hidden, obs_dim, cfg.activation)
        phase_inputs = self.num_heights + 3 + cfg.latent_dim
        self.phase_network = (
            perceptron(phase_inputs, cfg.phase_hidden, num_feet, cfg.activation)
            if cfg.phase
            else None
        )

    @property
    def encoder(self) -> Encoder:
        """What turns observations into features."""
        return self.lstm if self.cfg.encoder == "lstm" else self.history

    def tie(
        self,
        obs: Reflection,
        base_lin_vel: Reflection,
        heights: Reflection,
        feet: Reflection,
    ) -> None:
        """Make it commute with a reflection, now and as it learns; the latent swaps its halves.

        Args:
            obs: Reflection of an observation.
            base_lin_vel: Reflection of the velocity.
            heights: Reflection of the height map.
            feet: Reflection of the phases.

        Raises:
            ValueError: If the width of a layer is odd.
        """
        features = self.encoder.tie(obs)
        latent = Reflection.swapped(self.cfg.latent_dim)
        tie_mlp(self.base_lin_vel_head, features, base_lin_vel)
        tie_mlp(self.latent_mean_head, features, latent)
        tie_mlp(self.latent_log_var_head, features, latent)
        velocity = [base_lin_vel] if self.cfg.decodes_velocity else []
        tie_mlp(self.decoder, Reflection.joined([*velocity, latent]), obs)
        if self.heights_head is not None:
            tie_mlp(self.heights_head, features, heights)
        if self.phase_network is not None:
            seen = [heights] if self.cfg.heights else []
            tie_mlp(self.phase_network, Reflection.joined([*seen, base_lin_vel, latent]), feet)

    def initial_state(self, num_envs: int, device: torch.device | str | None = None) -> State:
        """Return the zero state; it lies with the weights unless another device is given."""
        weight = self.base_lin_vel_head.weight
        device = weight.device if device is None else device
        return tuple(
            torch.zeros(num_envs, size, dtype=weight.dtype, device=device)
            for size in self.encoder.state_sizes.values()
        )

    def step(self, obs: Tensor, state: State) -> tuple[Estimate, State]:
        """Consume one observation and return the estimate and the new state, both out of place.

        The latent is its mean. The caller zeroes the state of an environment before its first
        observation.

        Args:
            obs: Observations. Shape: (N, obs_dim).
            state: What the encoder remembers. Shapes: (N, .).
        """
        features, state = self.encoder.step(obs, state)
        return self._heads(features), state

    def unroll(
        self,
        obs: Tensor,
        state: State,
        starts: Tensor,
        sample: bool = False,
        generator: torch.Generator | None = None,
    ) -> tuple[Estimate, State]:
        """Consume a sequence of observations, as `step` would one after the other.

        Args:
            obs: Observations. Shape: (T, N, obs_dim).
            state: What the encoder remembers before the first observation. Shapes: (N, .).
            starts: True where an episode begins: the state is zeroed before that observation is
                consumed.
                Shape: (T, N), bool.
            sample: Whether the latent is sampled (reparameterised, for training) or its mean.
            generator: Source of the samples.

        Returns:
            The estimates, shapes (T, N, .), and the state after the last observation.

        Raises:
            ValueError: If `starts` does not match the observations or is not boolean.
        """
        if starts.shape != obs.shape[:2] or starts.dtype != torch.bool:
            raise ValueError(
                f"starts must be a bool tensor of shape {tuple(obs.shape[:2])}, "
                f"got {starts.dtype} of shape {tuple(starts.shape)}"
            )
        features, state = self.encoder.unroll(obs, state, starts)
        return self._heads(features, sample, generator), state

    def decode(self, estimate: Estimate) -> Tensor:
        """Predict the next observation. Shape: (., obs_dim)."""
        if self.cfg.decodes_velocity:
            return self.decoder(torch.cat((estimate.base_lin_vel, estimate.latent), dim=-1))
        return self.decoder(estimate.latent)

    def metres(self, normalised: Tensor) -> Tensor:
        """Return what the height head gives in m."""
        return self.height_offset + self.height_scale * normalised

    def normalised(self, heights: Tensor) -> Tensor:
        """Return heights in m as the height head gives them."""
        return (heights - self.height_offset) / self.height_scale

    def _heads(
        self, features: Tensor, sample: bool = False, generator: torch.Generator | None = None
    ) -> Estimate:
        """Turn features, shape (., features), into an estimate."""
        none = features[..., :0]
        heights = none if self.heights_head is None else self.heights_head(features)
        base_lin_vel = self.base_lin_vel_head(features)
        mean, log_var = self.latent_mean_head(features), self.latent_log_var_head(features)
        log_var = log_var.clamp(*_LOG_VAR_RANGE)
        latent = _sample(mean, log_var, generator) if sample else mean
        phase = none
        if self.phase_network is not None:
            seen = torch.cat((heights, base_lin_vel, latent), dim=-1)
            phase = torch.sigmoid(self.phase_network(seen))
        return Estimate(base_lin_vel, self.metres(heights), mean, log_var, latent, phase)


def _sample(mean: Tensor, log_var: Tensor, generator: torch.Generator | None) -> Tensor:
    """Draw a reparameterised sample of a diagonal Gaussian (Kingma and Welling, 2014)."""
    noise = torch.randn(mean.shape, generator=generator, dtype=mean.dtype, device=mean.device)
    return mean + torch.exp(0.5 * log_var) * noise
