"""The networks that PPO learns: rsl_rl's, with an input that may come ready made."""

from __future__ import annotations

from typing import Any

import torch
from rsl_rl.models import MLPModel
from rsl_rl.modules import HiddenState
from tensordict import TensorDict
from torch import nn

from mute.learning.normalization import RunningNormalization
from mute.networks.reflection import Reflection, tie_mlp, tie_vector
from mute.support.precision import hidden_dtype, hidden_layers

__all__ = ["PreparedModel"]


class PreparedModel(MLPModel):
    """rsl_rl's model, which takes its input ready made where the observations hold it.

    It can be made to treat left and right alike, see `tie`.
    """

    reflection: Reflection | None = None
    """How its input is mirrored, if it is tied."""

    def __init__(
        self,
        obs: TensorDict,
        obs_groups: dict[str, list[str]],
        obs_set: str,
        *args: Any,  # noqa: ANN401
        **kwargs: Any,  # noqa: ANN401
    ) -> None:
        """Build the networks, see `MLPModel`.

        Activations work in place, since nothing else reads what they are given.
        """
        super().__init__(obs, obs_groups, obs_set, *args, **kwargs)
        self.prepared_group = f"prepared for {obs_set}"
        """Name of the observation group that holds the input ready made."""
        if self.obs_normalization:
            self.obs_normalizer = RunningNormalization(self.obs_dim)
        for layer in self.mlp:
            if isinstance(layer, nn.ELU | nn.ReLU | nn.SELU):
                layer.inplace = True

    def tie(self, source: Reflection, target: Reflection, leading_side: bool = False) -> None:
        """Make it commute with the reflections of its input and output, now and as it learns.

        Args:
            source: Reflection of the input.
            target: Reflection of the output.
            leading_side: Whether it may lead with one side, see `tie_mlp`.

        Raises:
            ValueError: If the width of a hidden layer is odd.
        """
        self.reflection = source
        tie_mlp(self.mlp, source, target, leading_side)
        if self.distribution is not None:
            for deviation in self.distribution.parameters():
                tie_vector(deviation, target.unsigned)

    def forward(
        self,
        obs: TensorDict,
        masks: torch.Tensor | None = None,
        hidden_state: HiddenState = None,
        stochastic_output: bool = False,
    ) -> torch.Tensor:
        """Return the output, see `MLPModel.forward`.

        Where the input is ready made nothing is drawn, and the mean returned: PPO's update reads
        the distribution, and leaves the sample unused.
        """
        ready = obs.get(self.prepared_group, None)
        output = self._output(self.get_latent(obs, masks, hidden_state) if ready is None else ready)
        if self.distribution is None:
            return output
        if ready is None and not stochastic_output:
            return self.distribution.deterministic_output(output)
        self.distribution.update(output)
        return self.distribution.sample() if ready is None else self.output_mean

    def prepared(self, obs: TensorDict) -> torch.Tensor:
        """Return the input ready made, as `prepared_group` holds it.

        Shape: (num_samples, obs_dim).
        """
        latent = self.get_latent(obs)
        return latent.to(hidden_dtype(latent.device))

    def _output(self, latent: torch.Tensor) -> torch.Tensor:
        """Return the perceptron's output; its hidden layers may compute in bfloat16."""
        *hidden, last = self.mlp
        with hidden_layers(latent.device):
            for layer in hidden:
                latent = layer(latent)
        return last(latent.to(next(last.parameters()).dtype))

    def update_normalization(self, obs: TensorDict) -> None:
        """Learn the input's mean and variance, those of its mirror image included if tied."""
        if not isinstance(self.obs_normalizer, RunningNormalization):
            return
        self.obs_normalizer.update(*(obs[group] for group in self.obs_groups))
        if self.reflection is not None:
            self.obs_normalizer.include_mirror_image(self.reflection)
