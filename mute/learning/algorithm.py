"""rsl_rl's PPO with the estimator beside it: learnt, saved and moved together, never mixed."""

from __future__ import annotations

import math
from itertools import chain
from typing import Any

import torch
from rsl_rl.algorithms import PPO
from rsl_rl.env import VecEnv
from tensordict import TensorDict
from torch import Tensor

from mute.learning.distributed import Ranks
from mute.learning.divergence import DivergedError, first_not_finite, stopped_by
from mute.learning.estimated_env import EstimatedEnv
from mute.learning.estimator_trainer import EstimatorTrainer
from mute.learning.exploration import Exploration
from mute.learning.model import PreparedModel
from mute.learning.optimizer import FusedAdam
from mute.learning.settling import Settling
from mute.learning.storage import PreparedStorage
from mute.networks.encoders import State
from mute.support.threads import use_learning_threads

__all__ = ["EstimatorPPO"]


class EstimatorPPO(PPO):
    """PPO whose update first trains the estimator, on the rollout before the stored one.

    The actor and the critic read the estimates as they were stored, so the probability ratio is 1
    on the first mini-batch, and no gradient of theirs reaches the estimator. An update after which
    something is not finite ends with a `DivergedError`, on all ranks.
    """

    actor: PreparedModel  # pyright: ignore[reportIncompatibleVariableOverride]
    critic: PreparedModel  # pyright: ignore[reportIncompatibleVariableOverride]
    env: EstimatedEnv
    """Where the estimator runs."""
    trainer: EstimatorTrainer
    """What the estimator learns by."""
    ranks: Ranks
    """Processes that learn together."""
    optimizer: FusedAdam  # pyright: ignore[reportIncompatibleVariableOverride]
    """What actor and critic learn by."""
    settling: Settling
    """How learning rates fall at the end."""
    exploration: Exploration
    """How the entropy bonus falls."""
    updates: int = 0
    """Number of updates that went well, those before a resumption included."""
    _met: str | None = None
    """What the rollout brought that is not finite."""

    @staticmethod
    def construct_algorithm(obs: TensorDict, env: VecEnv, cfg: dict, device: str) -> EstimatorPPO:
        """Build everything, see `PPO.construct_algorithm`; the storage prepares its batches."""
        steps = cfg["num_steps_per_env"]
        algorithm = PPO.construct_algorithm(obs, env, cfg, device)
        assert isinstance(algorithm, EstimatorPPO)  # what the configuration names
        models = [algorithm.actor, algorithm.critic]
        parameters = chain(algorithm.actor.parameters(), algorithm.critic.parameters())
        algorithm.optimizer = FusedAdam(parameters, algorithm.learning_rate)
        storage = PreparedStorage("rl", env.num_envs, steps, obs, [env.num_actions], device)
        storage.models = [model for model in models if isinstance(model, PreparedModel)]
        algorithm.storage = storage
        return algorithm

    def attach(
        self,
        env: EstimatedEnv,
        trainer: EstimatorTrainer,
        ranks: Ranks,
        settling: Settling,
        exploration: Exploration,
    ) -> None:
        """Take on the estimator; to be called once, before anything else.

        A live module cannot come through rsl_rl's configuration, which is deep-copied.
        """
        self.env, self.trainer, self.ranks = env, trainer, ranks
        self.settling, self.exploration = settling, exploration
        # What rsl_rl's runner would say of ranks on GPUs; here they may learn on CPUs as well.
        self.is_multi_gpu = ranks.several
        self.gpu_world_size, self.gpu_global_rank = ranks.world_size, ranks.rank
        self._rollout_state: State = env.state_before

    def act(self, obs: TensorDict) -> torch.Tensor:
        """Sample actions, see `PPO.act`; remember the estimator's state before the rollout."""
        if self.storage.step == 0:
            self._rollout_state = self.env.state_before
            use_learning_threads()  # whatever ran between two rollouts; the environment keeps them
        return super().act(obs)

    def process_env_step(
        self, obs: TensorDict, rewards: Tensor, dones: Tensor, extras: dict[str, Any]
    ) -> None:
        """Record a step, see `PPO.process_env_step`; remember what of it is not finite.

        The runner's own check would end one rank alone, blame the environment, and pass infinity.
        """
        if self._met is None:
            groups = {f"the observations '{name}'": obs[name] for name in obs.keys()}  # noqa: SIM118
            self._met = first_not_finite(groups | {"the rewards": rewards})
            if self._met == "the rewards":
                self._met = first_not_finite(_reward_terms(extras)) or self._met
        super().process_env_step(obs, rewards, dones, extras)

    def compute_returns(self, obs: TensorDict) -> None:
        """Compute returns and advantages, see `PPO.compute_returns`.

        rsl_rl normalises the advantages of each rank by themselves; here it is those of all.
        """
        super().compute_returns(obs)
        if not self.ranks.several:
            return
        advantages = self.storage.returns - self.storage.values
        count = advantages.numel() * self.ranks.world_size
        centred = advantages - self.ranks.mean(advantages.mean())
        variance = self.ranks.mean(centred.square().mean()) * count / (count - 1)
        self.storage.advantages = centred / (variance.sqrt() + 1e-8)

    def update(self) -> dict[str, float]:
        """Train the estimator, then actor and critic; return the mean losses and errors.

        Raises:
            DivergedError: If a loss, a weight or an estimate is not finite, on whatever rank.
        """
        use_learning_threads()
        self._settle()
        self.entropy_coef = self.exploration.weight(self.updates)
        # Clones made outside inference mode are ordinary tensors, which autograd accepts.
        state = tuple(part.clone() for part in self._rollout_state)
        losses = self.trainer.update(self.storage, state, self.ranks)
        losses |= super().update()
        if self.env.bootstrap is not None:
            self.env.bootstrap.draw()
            losses["estimator_bootstrap"] = self.env.bootstrap.probability
        self.env.refresh()
        self._stop_where_not_finite(losses)
        self.updates += 1
        return losses

    def _settle(self) -> None:
        """Lower the learning rates where it is time to."""
        before, rate = (self.settling.rate(self.updates - past) for past in (1, 0))
        if rate == 1.0:
            return
        # The adaptive schedule would raise what is to fall: small steps bring a small divergence.
        self.schedule = "fixed"
        self.learn_at(self.learning_rate * rate / before)
        self.trainer.optimizer.set_learning_rate(self.trainer.cfg.learning_rate * rate)

    def learn_at(self, learning_rate: float) -> None:
        """Go on with another learning rate of PPO's."""
        self.learning_rate = learning_rate
        self.optimizer.set_learning_rate(learning_rate)

    def weights_not_finite(self) -> str | None:
        """Return the name of the first network that holds NaN or infinity; None if none does."""
        networks = {
            "actor": self.actor,
            "critic": self.critic,
            "estimator": self.trainer.estimator,
        }
        values = {
            f"the weights of the {name} ({key})": value
            for name, network in networks.items()
            for key, value in network.state_dict().items()
        }
        return first_not_finite(values)

    def _stop_where_not_finite(self, losses: dict[str, float]) -> None:
        broken = [name for name, value in losses.items() if not math.isfinite(value)]
        estimate = self.env.get_observations()["estimate"]
        found = (
            self._met
            or (f"the loss '{broken[0]}'" if broken else None)
            or self.weights_not_finite()
            or first_not_finite({"the estimates": estimate})
        )
        # The others would wait for one that stops alone.
        if not self.ranks.any(found is not None):
            return
        # What one rank met in its rollout spoils the losses of all.
        causes = [*self.ranks.gather(self._met), *self.ranks.gather(found)]
        first = next((cause for cause in causes if cause is not None), "")
        raise DivergedError(stopped_by(self.ranks.broadcast(first)))

    def train_mode(self) -> None:
        """Set train mode for all networks."""
        super().train_mode()
        self.trainer.estimator.train()

    def eval_mode(self) -> None:
        """Set evaluation mode for all networks."""
        super().eval_mode()
        self.trainer.estimator.eval()

    def save(self) -> dict[str, Any]:
        """Return the state of all networks and both optimisers."""
        return super().save() | {
            "estimator_state_dict": self.trainer.estimator.state_dict(),
            "estimator_trainer": self.trainer.state_dict(),
        }

    def load(self, loaded_dict: dict, load_cfg: dict | None, strict: bool) -> bool:
        """Load what `save` returned, see `PPO.load`."""
        self.trainer.estimator.load_state_dict(loaded_dict["estimator_state_dict"], strict=strict)
        if load_cfg is None or load_cfg.get("optimizer"):
            self.trainer.load_state_dict(loaded_dict["estimator_trainer"])
        return super().load(loaded_dict, load_cfg, strict)

    def broadcast_parameters(self) -> None:
        """Give every process the parameters of the first."""
        super().broadcast_parameters()
        for tensor in self.trainer.estimator.state_dict().values():
            torch.distributed.broadcast(tensor, src=0)


def _reward_terms(extras: dict[str, Any]) -> dict[str, Tensor]:
    """Return the mean of each reward term, which names the one that spoils their sum."""
    prefix = "Reward/"
    terms = {name: mean for name, mean in extras["log"].items() if name.startswith(prefix)}
    return {f"the reward term '{name.removeprefix(prefix)}'": mean for name, mean in terms.items()}
