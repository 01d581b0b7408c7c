"""What an estimator remembers of the observations: an LSTM's state, or the last few as they were.

An encoder turns each observation and what it remembers into features. What it remembers is a tuple
of tensors, a row for each environment; rows of zeros remember nothing.
"""

from __future__ import annotations

from typing import Protocol

import torch
from torch import Tensor, nn

from mute.support.precision import hidden_layers

from .perceptron import Activation, perceptron
from .reflection import Reflection, tie_layer, tie_mlp, tie_vector

__all__ = ["Encoder", "HistoryEncoder", "LstmEncoder", "State", "forgotten"]

State = tuple[Tensor, ...]
"""What an encoder remembers, tensors of shape (N, .)."""


class Encoder(Protocol):
    """Observations one after the other to features."""

    features: int
    """Width of the features."""
    state_sizes: dict[str, int]
    """Parts of what it remembers by name, and their widths."""

    def step(self, obs: Tensor, state: State) -> tuple[Tensor, State]:
        """Return the features, shape (N, features), and the new state, both out of place.

        Args:
            obs: Observations. Shape: (N, obs_dim).
            state: What is remembered of those before.
        """
        ...

    def unroll(self, obs: Tensor, state: State, starts: Tensor) -> tuple[Tensor, State]:
        """Return the features, shape (T, N, features), and the state after a sequence.

        Args:
            obs: Observations. Shape: (T, N, obs_dim).
            state: What is remembered of those before the first.
            starts: True where an episode begins and nothing before counts. Shape: (T, N), bool.
        """
        ...

    def tie(self, obs: Reflection) -> Reflection:
        """Make it commute with a reflection of observations; return that of its features.

        Raises:
            ValueError: If the width of a layer is odd.
        """
        ...


def forgotten(state: State, ended: Tensor) -> State:
    """Return a state in which some environments remember nothing, whatever they did remember.

    Args:
        state: What is remembered.
        ended: Which environments forget. Shape: (N,), bool.
    """
    column = ended.unsqueeze(1)
    return tuple(part.masked_fill(column, 0.0) for part in state)


class LstmEncoder(nn.LSTMCell):
    """An LSTM, whose features are its hidden state; the paper's."""

    def __init__(self, obs_dim: int, hidden: int) -> None:
        """Build the cell: `obs_dim` wide observations, a hidden state of the width `hidden`."""
        super().__init__(obs_dim, hidden)
        self.features = hidden
        self.state_sizes = {"hidden": hidden, "cell": hidden}

    def step(self, obs: Tensor, state: State) -> tuple[Tensor, State]:
        """Consume one observation, float32 even where products are bfloat16; see `Encoder`."""
        hidden, cell = state
        with hidden_layers(obs.device):
            state = self(obs, (hidden, cell))
        return state[0], state

    def unroll(self, obs: Tensor, state: State, starts: Tensor) -> tuple[Tensor, State]:
        """Consume a sequence, see `Encoder`."""
        features = []
        some_start = starts.any(dim=1).tolist()
        for step_obs, start, some in zip(obs, starts, some_start, strict=True):
            if some:
                state = forgotten(state, start)
            feature, state = self.step(step_obs, state)
            features.append(feature)
        return torch.stack(features), state

    def tie(self, obs: Reflection) -> Reflection:
        """Make it commute with a reflection, see `Encoder`; its state swaps its halves."""
        hidden = Reflection.swapped(self.features)
        gates = Reflection.joined([hidden] * 4)
        tie_layer(self.weight_ih, obs, gates)
        tie_layer(self.weight_hh, hidden, gates)
        tie_vector(self.bias_ih, gates)
        tie_vector(self.bias_hh, gates)
        return hidden


class HistoryEncoder(nn.Module):
    """A perceptron over the last few observations, those before an episode's first as zeros.

    Source: Nahrendra et al., "DreamWaQ", 2023 (five observations, layers of 128 and 64).
    """

    def __init__(
        self, obs_dim: int, length: int, hidden: tuple[int, ...], activation: Activation
    ) -> None:
        """Build the layers.

        Args:
            obs_dim: Width of an observation.
            length: Number of observations, the present one among them.
            hidden: Widths of the layers; the last one is that of the features.
            activation: Follows every layer.
        """
        super().__init__()
        self.length = length
        self.features = hidden[-1]
        self.state_sizes = {"history": (length - 1) * obs_dim}
        self.layers = perceptron(length * obs_dim, hidden, None, activation)

    def step(self, obs: Tensor, state: State) -> tuple[Tensor, State]:
        """Look at one observation and those before, see `Encoder`; the newest one comes first."""
        (history,) = state
        window = torch.cat((obs, history), dim=1)
        return self._features(window), (window[:, : history.shape[1]],)

    def unroll(self, obs: Tensor, state: State, starts: Tensor) -> tuple[Tensor, State]:
        """Look at a sequence, all of it at once; see `Encoder`."""
        steps, num_envs, width = obs.shape
        (history,) = state
        before = history.view(num_envs, self.length - 1, width).transpose(0, 1).flip(0)
        known = torch.cat((before, obs))
        at = torch.arange(steps, device=obs.device).unsqueeze(1)
        begun = torch.where(starts, at, -self.length).cummax(dim=0).values
        # Row t of `known[length - 1 - lag :]` is the observation at t - lag.
        rows = [
            known[self.length - 1 - lag :][:steps].masked_fill((at - lag < begun).unsqueeze(2), 0.0)
            for lag in range(self.length)
        ]
        windows = torch.cat(rows, dim=2)
        return self._features(windows), (windows[-1, :, : history.shape[1]],)

    def tie(self, obs: Reflection) -> Reflection:
        """Make it commute with a reflection, see `Encoder`; its features swap their halves."""
        features = Reflection.swapped(self.features)
        tie_mlp(self.layers, Reflection.joined([obs] * self.length), features)
        return features

    def _features(self, windows: Tensor) -> Tensor:
        with hidden_layers(windows.device):
            return self.layers(windows).to(windows.dtype)
