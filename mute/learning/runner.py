"""rsl_rl's on-policy runner, with the estimator in its loop and checkpoints that lose nothing."""

from __future__ import annotations

import contextlib
import dataclasses
import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch
from rsl_rl.runners import OnPolicyRunner

from mute.checkpoint import CheckpointError, first_line, load_checkpoint, save_checkpoint
from mute.config import AgentCfg, TaskCfg, from_plain, to_plain
from mute.config_versions import check_resumable
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.learning.algorithm import EstimatorPPO
from mute.learning.bootstrapping import AdaptiveBootstrap
from mute.learning.distributed import Ranks, unnoticed_ranks
from mute.learning.divergence import DivergedError
from mute.learning.estimated_env import EstimatedEnv, make_estimator
from mute.learning.estimator_trainer import EstimatorTrainer
from mute.learning.exploration import Exploration
from mute.learning.logger import TrainingLogger, quiet_writer_thread
from mute.learning.resumption import check_resumption
from mute.learning.saved_state import (
    check_known_physics,
    check_learner,
    check_own_state,
    check_totals,
    entry,
)
from mute.learning.settling import Settling
from mute.learning.symmetry import groups, tie_actor_critic, tie_estimator
from mute.support.signals import StopRequest
from mute.support.threads import use_collection_threads

__all__ = ["MuteRunner", "NoiseProbe", "OnIteration", "policy_part"]

OnIteration = Callable[[int, int, dict[str, float]], None]

NoiseProbe = Callable[[dict[str, Any]], dict[str, float]]
"""Takes a `policy_part` and returns the modelled noise levels of its policy by curve, dBA. It uses
no random numbers of torch's common generator but such as it puts back."""

_DOES_NOT_FIT = (
    AttributeError,
    IndexError,
    KeyError,
    OverflowError,
    RuntimeError,
    TypeError,
    ValueError,
)
"""What a state of another form than its own can make torch and the loaders raise."""

_POLICY_KEYS = ("task", "config", "iter", "actor_state_dict", "estimator_state_dict")


def policy_part(checkpoint: dict[str, Any]) -> dict[str, Any]:
    """Return the small part of a checkpoint that is needed to run its policy."""
    return {key: checkpoint[key] for key in _POLICY_KEYS}


class MuteRunner(OnPolicyRunner):
    """Learns a task: environment, estimator and PPO in rsl_rl's loop; saves and resumes.

    With several ranks, each has the configured number of robots. `train` and `save` are then to be
    called on all of them; nothing else waits for the others.
    """

    alg: EstimatorPPO  # pyright: ignore[reportIncompatibleVariableOverride]
    env: EstimatedEnv  # pyright: ignore[reportIncompatibleVariableOverride]

    def __init__(
        self,
        task: str,
        cfg: TaskCfg,
        log_dir: Path | None,
        device: str = "cpu",
        on_iteration: OnIteration | None = None,
        ranks: Ranks | None = None,
        noise_probe: NoiseProbe | None = None,
    ) -> None:
        """Build everything.

        Args:
            task: Name of the task, for the checkpoint.
            cfg: Its configuration.
            log_dir: Directory of the run; None keeps nothing.
            device: Device of the networks and, unless `env.engine` forbids it, of the physics.
            on_iteration: Called with (iteration, total, scalars) after each iteration.
            ranks: Processes that learn together, which all are given the same configuration.
            noise_probe: Measures how loud the policy walks, every `agent.noise_interval`; None
                leaves that out.
        """
        self.ranks = ranks or Ranks()
        torch.manual_seed(self.ranks.seed(cfg.env.seed))
        self.task, self.task_cfg = task, cfg
        env = QuadrupedEnv(_own_draws(cfg.env, self.ranks), device)
        estimation = cfg.agent.estimation
        estimator = make_estimator(cfg).to(device)
        if cfg.agent.symmetric:
            tie_estimator(env, estimator)
        estimated = EstimatedEnv(
            env,
            estimator,
            device,
            estimation.actor_uses_phase,
            AdaptiveBootstrap(env.num_envs, torch.device(device), self.ranks)
            if estimation.adaptive_bootstrap
            else None,
        )
        # rsl_rl prints its networks.
        with contextlib.redirect_stdout(io.StringIO()), unnoticed_ranks():
            super().__init__(
                estimated, cfg.agent.rsl_rl(), str(log_dir) if log_dir else None, device
            )
        feet = env.footfalls
        trainer = EstimatorTrainer(
            estimator, estimation, env.privileged_slices, feet.min_steps, feet.max_steps
        )
        self.alg.attach(
            estimated, trainer, self.ranks, Settling.of(cfg.agent), Exploration.of(cfg.agent)
        )
        if cfg.agent.symmetric:
            by_group = groups(env, estimator, estimation.actor_uses_phase)
            tie_actor_critic(self.alg.actor, self.alg.critic, by_group, cfg.agent.leading_side)
        self.logger = TrainingLogger(
            log_dir=str(log_dir) if log_dir else None,
            cfg=self.cfg,
            env_cfg=cfg.env,
            num_envs=estimated.num_envs,
            device=device,
            measure=self._measure_noise,
            on_begin=self._begin,
            on_iteration=self._end_iteration,
            ranks=self.ranks,
        )
        self._noise_probe = noise_probe
        self._levels: dict[str, float] = {}
        self.robots_anew = True
        """Whether robots begin their first episodes, as they do unless `load` finds them saved."""
        self.on_begin: Callable[[], None] | None = None
        """Called when all is ready and the first iteration is about to begin."""
        self._on_iteration = on_iteration
        # With several ranks a second Ctrl-C says no more: torchrun passes on what a rank may have
        # had already, and ends by force what does not end by itself. It also signals the ranks
        # that are left when one is gone, which shall not keep them from saying so: there, requests
        # are taken to the end of the process.
        self.stop = StopRequest(lasting=self.ranks.several)
        """The signal that interrupts `train`."""

    def train(self) -> bool:
        """Learn until the configured number of iterations; return False if interrupted.

        Ctrl-C, or another signal that asks to end, ends the current iteration, saves and returns; a
        second Ctrl-C ends at once, unless a checkpoint is being saved.

        Raises:
            CheckpointError: If a checkpoint cannot be written.
            DiskError: If curves cannot be written; what is learnt is saved if there is room for it.
            DivergedError: If something is no longer finite; nothing of that iteration is kept.
        """
        left = self.task_cfg.agent.iterations - self.current_learning_iteration
        with self.stop, quiet_writer_thread():
            try:
                self._agree()
                self.learn(left, init_at_random_ep_len=self.robots_anew)
                finished = True
            except _StopTraining:
                finished = False
                if self.logger.log_dir is not None:
                    self.save(str(self.checkpoint_path()))
                self.logger.stop_logging_writer()  # writes out the last curves
            except DivergedError as error:
                self.logger.stop_logging_writer()
                raise DivergedError(f"iteration {self.alg.updates}: {error}") from error
            if self.logger.disk_error is not None:
                raise self.logger.disk_error
        return finished

    def checkpoint_path(self) -> Path:
        """Return the path of the checkpoint of the last finished iteration.

        Raises:
            ValueError: If the run keeps nothing.
        """
        if self.logger.log_dir is None:
            raise ValueError("this run has no log directory")
        return Path(self.logger.log_dir) / f"model_{self.current_learning_iteration}.pt"

    def save(self, path: str, infos: dict | None = None) -> None:
        """Save all that is needed to continue bit for bit, atomically; the first rank writes.

        Raises:
            CheckpointError: If it cannot be written.
            DivergedError: If a weight is not finite; nothing is written then.
        """
        broken = self.alg.weights_not_finite()
        if broken is not None:
            raise DivergedError(f"{path} is not written: NaN or infinity in {broken}")
        with self.stop.finishing():
            self._save(Path(path), infos)

    def _save(self, path: Path, infos: dict | None) -> None:
        own = self._own_state()
        payload = self.alg.save() | own
        if self.ranks.several:
            own["estimator_past"] = payload["estimator_trainer"]["past"]
            gathered = self.ranks.gather_states({} if self.ranks.first else own)
            payload["other_ranks"] = gathered[1:]
        if not self.ranks.first:
            return
        payload |= self._about(self.current_learning_iteration) | {"infos": infos}
        save_checkpoint(path, payload)
        self.logger.save_model(str(path), self.current_learning_iteration)

    def keep_in(self, directory: Path) -> None:
        """Keep what is learnt in another directory than the one named first; before `train`."""
        self.logger.log_dir = str(directory)

    def load(
        self,
        path: str,
        load_cfg: dict | None = None,
        strict: bool = True,
        map_location: str | None = None,
    ) -> dict:
        """Continue from a checkpoint.

        One of another number of ranks has no state for each of these: what is learnt, the
        iterations and the curricula then go on, and the robots begin anew.

        Raises:
            CheckpointError: If it is damaged, foreign, or of another configuration.
        """
        # On the CPU whatever the device: environment, networks and optimisers move what they load
        # to where they are, and the random states stay where they belong.
        checkpoint = load_checkpoint(Path(path), map_location or "cpu")
        try:
            check_resumable(entry(checkpoint, "config"))
            saved_cfg = from_plain(checkpoint["config"])
            own = _part_of_rank(checkpoint, self.ranks)
            check_resumption(saved_cfg, self.task_cfg, robots_anew=own is None)
            check_known_physics(checkpoint)
            check_learner(checkpoint, self.alg)
            if own is None:
                check_totals(checkpoint)
            else:
                check_own_state(own, self._own_state(), self.alg)
            checkpoint["estimator_trainer"]["past"] = {} if own is None else own["estimator_past"]
            self.alg.load(checkpoint, load_cfg, strict)
            self.alg.updates = checkpoint["iter"] + 1
            self._set_learning_rates(saved_cfg.agent)
            if own is None:
                self.env.restart(checkpoint["env"]["env"]["step_count"])
                self.logger.load_totals(checkpoint["logger"])
            else:
                self._load_own_state(own)
        except _DOES_NOT_FIT as error:
            missing = " is missing" if isinstance(error, KeyError) else ""
            reason = f"{first_line(error)}{missing}"
            raise CheckpointError(f"{path} does not fit this configuration: {reason}") from error
        self.robots_anew = own is None
        # The saved iteration is finished.
        self.current_learning_iteration = self.alg.updates
        # What was logged after the checkpoint is learnt, and logged, again.
        self.cfg["logger"]["first_iteration"] = self.current_learning_iteration
        return checkpoint["infos"] or {}

    def _set_learning_rates(self, saved: AgentCfg) -> None:
        """Go on with the configured learning rates, but where the schedule has led PPO's on.

        Where the training now ends later, what had begun to settle is awake again.
        """
        agent = self.task_cfg.agent
        asked, last = agent.ppo, self.alg.updates - 1
        fell, falls = (Settling.of(each).rate(last) for each in (saved, agent))
        newly_fixed = (asked.schedule, saved.ppo.schedule) == ("fixed", "adaptive")
        if newly_fixed or asked.learning_rate != saved.ppo.learning_rate:
            self.learn_at(asked.learning_rate)
        elif falls != fell:
            self.alg.learn_at(self.alg.learning_rate / fell * falls)
        self.alg.trainer.optimizer.set_learning_rate(agent.estimation.learning_rate)

    def learn_at(self, learning_rate: float) -> None:
        """Go on with another learning rate of PPO's, as far as it has fallen by now."""
        self.alg.learn_at(learning_rate * self.alg.settling.rate(self.alg.updates - 1))

    @property
    def _on_cuda(self) -> bool:
        return torch.device(self.device).type == "cuda"

    def _measure_noise(self, iteration: int) -> dict[str, float]:
        """Return the modelled noise levels where the iteration is one that measures them, dBA.

        They are the same for all ranks, so the first one measures and the others wait.
        """
        interval = self.task_cfg.agent.noise_interval
        due = interval and (iteration + 1) % interval == 0
        if self._noise_probe is None or not self.ranks.first or not due:
            return {}
        use_collection_threads()
        self._levels = self._noise_probe(policy_part(self.alg.save() | self._about(iteration)))
        return self._levels

    def _about(self, iteration: int) -> dict[str, Any]:
        """Return what a checkpoint says of its policy."""
        return {"task": self.task, "config": to_plain(self.task_cfg), "iter": iteration}

    def _begin(self) -> None:
        if self.on_begin is not None:
            self.on_begin()

    def _end_iteration(self, iteration: int, total: int, scalars: dict[str, float]) -> None:
        if self._on_iteration is not None:
            # Between two trials the display goes on showing the last one's levels.
            self._on_iteration(iteration, total, self._levels | scalars)
        # A signal may reach one rank alone, or another one an iteration later; one writes curves.
        asked = self.stop.number is not None or self.logger.disk_error is not None
        if self.ranks.any(asked) and iteration + 1 < total:
            raise _StopTraining

    def _agree(self) -> None:
        """Give all ranks the first one's networks, and estimate anew with them."""
        if self.ranks.several:
            self.alg.broadcast_parameters()
            self.env.refresh()

    def _own_state(self) -> dict[str, Any]:
        """Return what differs between ranks."""
        return {
            "env": self.env.state_dict(),
            "logger": self.logger.state_dict(),
            "torch_random_state": torch.get_rng_state(),
            "cuda_random_state": torch.cuda.get_rng_state(self.device) if self._on_cuda else None,
        }

    def _load_own_state(self, state: dict[str, Any]) -> None:
        self.env.load_state_dict(state["env"])
        self.logger.load_state_dict(state["logger"])
        torch.set_rng_state(state["torch_random_state"])
        # A run that moves to a GPU has no state to go on from there.
        if self._on_cuda and state["cuda_random_state"] is not None:
            torch.cuda.set_rng_state(state["cuda_random_state"], self.device)


def _own_draws(cfg: QuadrupedEnvCfg, ranks: Ranks) -> QuadrupedEnvCfg:
    """Return a rank's world: its own draws."""
    return dataclasses.replace(cfg, seed=ranks.seed(cfg.seed)) if ranks.several else cfg


def _part_of_rank(checkpoint: dict[str, Any], ranks: Ranks) -> dict[str, Any] | None:
    """Return what a rank saved of its own; None if those who saved were more or fewer."""
    trainer = entry(checkpoint, "estimator_trainer")
    first = checkpoint | {"estimator_past": entry(trainer, "past", "estimator_trainer")}
    others = checkpoint.get("other_ranks", [])
    if not isinstance(others, list):
        raise ValueError("other_ranks must be a list")
    parts = [first, *others]
    return parts[ranks.rank] if len(parts) == ranks.world_size else None


class _StopTraining(Exception):  # noqa: N818
    """Leaves rsl_rl's loop between two iterations."""
