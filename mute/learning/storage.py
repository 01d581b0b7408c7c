"""rsl_rl's rollout storage, with the mini-batches of an update made once.

rsl_rl draws one permutation for an update, so that all its epochs see the same mini-batches. Here
each is gathered once and kept for the epochs, with the networks' inputs, normalised and joined:
the normalisers learn only after the update. The batches are bit for bit those of rsl_rl, but for
the networks' inputs where these are in bfloat16 (`mute.support.precision`).
"""

from __future__ import annotations

from collections.abc import Generator, Sequence

import torch
from rsl_rl.storage import RolloutStorage
from tensordict import TensorDict
from torch import Tensor

from mute.learning.model import PreparedModel

__all__ = ["PreparedStorage"]


class PreparedStorage(RolloutStorage):
    """A rollout whose mini-batches are gathered and prepared once an update."""

    models: Sequence[PreparedModel] = ()
    """Networks whose inputs are prepared."""

    def mini_batch_generator(
        self, num_mini_batches: int, num_epochs: int = 8
    ) -> Generator[RolloutStorage.Batch, None, None]:
        """Yield the mini-batches, see `RolloutStorage.mini_batch_generator`."""
        size = self.num_envs * self.num_transitions_per_env // num_mini_batches
        order = torch.randperm(num_mini_batches * size, device=self.device)
        # One after the other: its own observations are gone before the next are gathered.
        batches = [self._batch(rows) for rows in order.split(size)]
        for _ in range(num_epochs):
            yield from batches

    def _batch(self, rows: Tensor) -> RolloutStorage.Batch:
        """Return the mini-batch of some samples, numbered step by step. Shape: (num_samples,)."""

        # Whole rows at once: an index in brackets takes them number by number, ten times as long.
        def chosen(value: Tensor) -> Tensor:
            return value.flatten(0, 1).index_select(0, rows)

        groups = self.observations
        observations = {name: chosen(groups[name]) for name in groups.keys()}  # noqa: SIM118
        assert self.distribution_params is not None  # there is a rollout
        return RolloutStorage.Batch(
            observations=self._prepared(TensorDict(observations, batch_size=rows.shape)),
            actions=chosen(self.actions),
            values=chosen(self.values),
            advantages=chosen(self.advantages),
            returns=chosen(self.returns),
            old_actions_log_prob=chosen(self.actions_log_prob),
            old_distribution_params=tuple(chosen(value) for value in self.distribution_params),
        )

    @torch.no_grad()
    def _prepared(self, observations: TensorDict) -> TensorDict:
        inputs = {model.prepared_group: model.prepared(observations) for model in self.models}
        return TensorDict(inputs, batch_size=observations.batch_size)
