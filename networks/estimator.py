"""The estimator: from the history of observations to what the robot cannot measure.

An LSTM turns the proprioceptive history into body velocity, terrain heights, a latent and the phase
of each foot. This module is the network alone; its labels, losses and optimiser are left to others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import torch
from torch import Tensor, nn

from mute.support.precision import hidden_layers
from mute.support.ranges import Range, check_ranges

from .reflection import Reflection, tie_layer, tie_mlp, tie_vector

__all__ = ["Estimate", "Estimator", "EstimatorCfg", "State"]

State = tuple[Tensor, Tensor]
"""Hidden and cell state of the LSTM, each of shape (N, lstm_hidden)."""

_ACTIVATIONS: dict[str, type[nn.Module]] = {"elu": nn.ELU, "relu": nn.ReLU, "tanh": nn.Tanh}
_LOG_VAR_RANGE = (-10.0, 5.0)


@dataclass
class EstimatorCfg:
    """Sizes of the estimator."""

    lstm_hidden: int = 128
    """Width of the LSTM's hidden state."""

    latent_dim: int = 16
    """Size of the latent z."""

    decoder_hidden: tuple[int, ...] = (64,)
    """Widths of the hidden layers of the decoder that predicts the next observation."""

    phase_hidden: tuple[int, ...] = (64,)
    """Widths of the hidden layers of the phase network."""

    activation: Literal["elu", "relu", "tanh"] = "elu"
    """Activation of the decoder and of the phase network."""

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            ValueError: If a size is not positive, or the activation is unknown.
        """
        width = Range(1, 16384, whole=True)
        names = ("lstm_hidden", "latent_dim", "decoder_hidden", "phase_hidden")
        check_ranges(self, "network", dict.fromkeys(names, width))
        if self.activation not in _ACTIVATIONS:
            raise ValueError(
                f"network.activation must be one of {list(_ACTIVATIONS)}, got {self.activation!r}"
            )


class Estimate(NamedTuple):
    """What the estimator says of one step, shapes (N, .), or of a sequence, shapes (T, N, .)."""

    base_lin_vel: Tensor
    """Linear velocity of the base, in the frame of its label, in m/s. Last dimension: 3."""

    heights: Tensor
    """Height of the trunk above each point of the grid, in m. Last dimension: num_heights."""

    latent_mean: Tensor
    """Mean of the latent. Last dimension: latent_dim."""

    latent_log_var: Tensor
    """Logarithm of the variance of the latent, within [-10, 5]. Last dimension: latent_dim."""

    latent: Tensor
    """The latent in use: its mean, or a sample in training. Last dimension: latent_dim."""

    phase: Tensor
    """Phase of each foot, within [0, 1]. Last dimension: num_feet."""


class Estimator(nn.Module):
    """LSTM encoder with heads for velocity, heights and a latent, a decoder and a phase network.

    The heads read the LSTM's hidden state. The decoder predicts the next observation from the
    latent alone; the phase network is fed by the estimated heights (normalised), velocity and
    latent, and its gradient flows through them into the encoder, so that all losses shape it.
    Acting uses the mean of the latent, never a sample: a stored rollout that is unrolled again
    gives the same estimates.

    Source: MUTE, section "Phase Estimation".
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
            num_heights: Number of points of the height map.
            cfg: Sizes; the defaults if left out.
            num_feet: Number of feet.
            height_offset: Height for which the height head gives 0, m; the environment's.
            height_scale: Difference in height for which it gives 1, m; the environment's.
        """
        super().__init__()
        self.height_offset, self.height_scale = height_offset, height_scale
        self.cfg = cfg = cfg if cfg is not None else EstimatorCfg()
        self.lstm = nn.LSTMCell(obs_dim, cfg.lstm_hidden)
        self.base_lin_vel_head = nn.Linear(cfg.lstm_hidden, 3)
        self.heights_head = nn.Linear(cfg.lstm_hidden, num_heights)
        self.latent_mean_head = nn.Linear(cfg.lstm_hidden, cfg.latent_dim)
        self.latent_log_var_head = nn.Linear(cfg.lstm_hidden, cfg.latent_dim)
        activation = _ACTIVATIONS[cfg.activation]
        self.decoder = _mlp(cfg.latent_dim, cfg.decoder_hidden, obs_dim, activation)
        phase_inputs = num_heights + 3 + cfg.latent_dim
        self.phase_network = _mlp(phase_inputs, cfg.phase_hidden, num_feet, activation)

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
        hidden = Reflection.swapped(self.cfg.lstm_hidden)
        latent = Reflection.swapped(self.cfg.latent_dim)
        gates = Reflection.joined([hidden] * 4)
        tie_layer(self.lstm.weight_ih, obs, gates)
        tie_layer(self.lstm.weight_hh, hidden, gates)
        tie_vector(self.lstm.bias_ih, gates)
        tie_vector(self.lstm.bias_hh, gates)
        tie_mlp(self.base_lin_vel_head, hidden, base_lin_vel)
        tie_mlp(self.heights_head, hidden, heights)
        tie_mlp(self.latent_mean_head, hidden, latent)
        tie_mlp(self.latent_log_var_head, hidden, latent)
        tie_mlp(self.decoder, latent, obs)
        tie_mlp(self.phase_network, Reflection.joined([heights, base_lin_vel, latent]), feet)

    def initial_state(self, num_envs: int, device: torch.device | str | None = None) -> State:
        """Return the zero state; it lies with the weights unless another device is given."""
        weight = self.lstm.weight_hh
        shape = (num_envs, self.cfg.lstm_hidden)
        device = weight.device if device is None else device
        return (
            torch.zeros(shape, dtype=weight.dtype, device=device),
            torch.zeros(shape, dtype=weight.dtype, device=device),
        )

    def step(self, obs: Tensor, state: State) -> tuple[Estimate, State]:
        """Consume one observation and return the estimate and the new state, both out of place.

        The latent is its mean. The caller zeroes the state of an environment before its first
        observation.

        Args:
            obs: Observations. Shape: (N, obs_dim).
            state: Hidden and cell state. Shapes: (N, lstm_hidden).
        """
        state = self._consume(obs, state)
        return self._heads(state[0]), state

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
            state: Hidden and cell state before the first observation. Shapes: (N, lstm_hidden).
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
        hiddens = []
        some_start = starts.any(dim=1).tolist()
        for step_obs, start, some in zip(obs, starts.unsqueeze(-1), some_start, strict=True):
            if some:
                state = (state[0].masked_fill(start, 0.0), state[1].masked_fill(start, 0.0))
            state = self._consume(step_obs, state)
            hiddens.append(state[0])
        return self._heads(torch.stack(hiddens), sample, generator), state

    def decode(self, latent: Tensor) -> Tensor:
        """Predict the next observation from the latent: (., latent_dim) to (., obs_dim)."""
        return self.decoder(latent)

    def metres(self, normalised: Tensor) -> Tensor:
        """Return what the height head gives in m."""
        return self.height_offset + self.height_scale * normalised

    def normalised(self, heights: Tensor) -> Tensor:
        """Return heights in m as the height head gives them."""
        return (heights - self.height_offset) / self.height_scale

    def _consume(self, obs: Tensor, state: State) -> State:
        """Return the state after an observation, float32 even where products are bfloat16."""
        with hidden_layers(obs.device):
            return self.lstm(obs, state)

    def _heads(
        self, hidden: Tensor, sample: bool = False, generator: torch.Generator | None = None
    ) -> Estimate:
        """Turn hidden states, shape (., lstm_hidden), into an estimate."""
        heights, base_lin_vel = self.heights_head(hidden), self.base_lin_vel_head(hidden)
        mean, log_var = self.latent_mean_head(hidden), self.latent_log_var_head(hidden)
        log_var = log_var.clamp(*_LOG_VAR_RANGE)
        latent = _sample(mean, log_var, generator) if sample else mean
        phase = torch.sigmoid(
            self.phase_network(torch.cat((heights, base_lin_vel, latent), dim=-1))
        )
        return Estimate(base_lin_vel, self.metres(heights), mean, log_var, latent, phase)


def _sample(mean: Tensor, log_var: Tensor, generator: torch.Generator | None) -> Tensor:
    """Draw a reparameterised sample of a diagonal Gaussian (Kingma and Welling, 2014)."""
    noise = torch.randn(mean.shape, generator=generator, dtype=mean.dtype, device=mean.device)
    return mean + torch.exp(0.5 * log_var) * noise


def _mlp(
    in_features: int, hidden: Sequence[int], out_features: int, activation: type[nn.Module]
) -> nn.Sequential:
    """Build a perceptron with the given hidden layers and a linear output."""
    layers: list[nn.Module] = []
    for width in hidden:
        layers += [nn.Linear(in_features, width), activation()]
        in_features = width
    return nn.Sequential(*layers, nn.Linear(in_features, out_features))
