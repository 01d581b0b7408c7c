"""rsl_rl's rollout storage, with the mini-batches of an update made once.

rsl_rl draws one permutation for an update, so that all its epochs see the same mini-batches. Here
each is gathered once and kept for the epochs, with the networks' inputs, normalised and joined:
the normalisers learn only after the update. The batches are bit for bit those of rsl_rl.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from typing import Any

import torch
from rsl_rl.models import MLPModel
from rsl_rl.modules import HiddenState
from rsl_rl.storage import RolloutStorage
from tensordict import TensorDict
from torch import nn

from mute.learning.normalization import RunningNormalization
from mute.networks.elu import ELU
from mute.networks.perceptron import perceptron
from mute.networks.reflection import Reflection, tie_mlp, tie_vector

__all__ = ["PreparedModel", "PreparedStorage"]


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

        Activations work in place, since nothing else reads what they are given, or as fast as they
        can on a CPU, see `mute.networks.elu`.
        """
        super().__init__(obs, obs_groups, obs_set, *args, **kwargs)
        self.prepared_group = f"prepared for {obs_set}"
        """Name of the observation group that holds the input ready made."""
        if self.obs_normalization:
            self.obs_normalizer = RunningNormalization(self.obs_dim)
        for place, layer in enumerate(self.mlp):
            if isinstance(layer, nn.ELU):  # rsl_rl's has the default alpha
                self.mlp[place] = ELU()
            elif isinstance(layer, nn.ReLU | nn.SELU):
                layer.inplace = True

    def tie(self, source: Reflection, target: Reflection) -> None:
        """Make it commute with the reflections of its input and output, now and as it learns.

        Raises:
            ValueError: If the width of a hidden layer is odd.
        """
        self.reflection = source
        tie_mlp(self.mlp, source, target)
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
        if ready is None:
            return super().forward(obs, masks, hidden_state, stochastic_output)
        output = perceptron(self.mlp, ready)
        if self.distribution is None:
            return output
        self.distribution.update(output)
        return self.output_mean

    def update_normalization(self, obs: TensorDict) -> None:
        """Learn the input's mean and variance, those of its mirror image included if tied."""
        normalizer = self.obs_normalizer
        if isinstance(normalizer, RunningNormalization):
            normalizer.update(*(obs[group] for group in self.obs_groups))
        if self.reflection is None:
            return
        mean, variance = normalizer.get_buffer("_mean"), normalizer.get_buffer("_var")
        image = self.reflection(mean)
        # The variance of two halves of the data is the mean of theirs and that of their means.
        normalizer._var = (
            0.5 * (variance + self.reflection.unsigned(variance)) + (0.5 * (mean - image)).square()
        )
        normalizer._mean = 0.5 * (mean + image)
        normalizer._std = normalizer._var.sqrt()


class PreparedStorage(RolloutStorage):
    """A rollout whose mini-batches are gathered and prepared once an update."""

    models: Sequence[PreparedModel] = ()
    """Networks whose inputs are prepared."""

    def mini_batch_generator(
        self, num_mini_batches: int, num_epochs: int = 8
    ) -> Generator[RolloutStorage.Batch, None, None]:
        """Yield the mini-batches, see `RolloutStorage.mini_batch_generator`."""
        batches = list(super().mini_batch_generator(num_mini_batches, num_epochs=1))
        for batch in batches:
            batch.observations = self._prepared(batch.observations)
        for _ in range(num_epochs):
            yield from batches

    @torch.no_grad()
    def _prepared(self, observations: TensorDict) -> TensorDict:
        inputs = {model.prepared_group: model.get_latent(observations) for model in self.models}
        return TensorDict(inputs, batch_size=observations.batch_size)
