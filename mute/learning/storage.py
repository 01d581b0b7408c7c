"""rsl_rl's rollout storage, with the mini-batches of an update made once.

rsl_rl draws one permutation for an update, so that all its epochs see the same mini-batches. Here
each is gathered once and kept for the epochs, with the networks' inputs, normalised and joined:
the normalisers learn only after the update. The batches are bit for bit those of rsl_rl.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence

import torch
from rsl_rl.storage import RolloutStorage
from tensordict import TensorDict

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
        batches = list(super().mini_batch_generator(num_mini_batches, num_epochs=1))
        for batch in batches:
            batch.observations = self._prepared(batch.observations)
        for _ in range(num_epochs):
            yield from batches

    @torch.no_grad()
    def _prepared(self, observations: TensorDict) -> TensorDict:
        inputs = {model.prepared_group: model.get_latent(observations) for model in self.models}
        return TensorDict(inputs, batch_size=observations.batch_size)
