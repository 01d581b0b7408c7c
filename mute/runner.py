"""rsl_rl's on-policy runner, with the estimator in its loop and checkpoints that lose nothing."""

from __future__ import annotations

import contextlib
import io
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import Any

import torch
from rsl_rl.runners import OnPolicyRunner

from envs.observations import OBS_DIM
from envs.quadruped_env import QuadrupedEnv
from mute.algorithm import EstimatorPPO
from mute.checkpoint import CheckpointError, first_line, load_checkpoint, save_checkpoint
from mute.config import TaskCfg, to_plain
from mute.controllers.learned import make_policy
from mute.estimated_env import EstimatedEnv
from mute.estimation import EstimatorTrainer
from mute.evaluation.noise_probe import NoiseProbe
from mute.logger import TrainingLogger
from mute.threads import use_collection_threads
from networks.estimator import Estimator

__all__ = ["MuteRunner", "policy_part"]

Progress = Callable[[int, int, dict[str, float]], None]

_POLICY_KEYS = ("task", "config", "iter", "actor_state_dict", "estimator_state_dict")


def policy_part(checkpoint: dict[str, Any]) -> dict[str, Any]:
    """Return the small part of a checkpoint that is needed to run its policy."""
    return {key: checkpoint[key] for key in _POLICY_KEYS}


class MuteRunner(OnPolicyRunner):
    """Learns a task: environment, estimator and PPO in rsl_rl's loop; saves and resumes."""

    alg: EstimatorPPO  # pyright: ignore[reportIncompatibleVariableOverride]
    env: EstimatedEnv  # pyright: ignore[reportIncompatibleVariableOverride]

    def __init__(
        self,
        task: str,
        cfg: TaskCfg,
        log_dir: Path | None,
        device: str = "cpu",
        on_iteration: Progress | None = None,
    ) -> None:
        """Build everything.

        Args:
            task: Name of the task, for the checkpoint.
            cfg: Its configuration.
            log_dir: Directory of the run; None keeps nothing.
            device: Device of the networks and, unless `env.engine` forbids it, of the physics.
            on_iteration: Called with (iteration, total, scalars) after each iteration.
        """
        torch.manual_seed(cfg.env.seed)
        self.task, self.task_cfg = task, cfg
        env = QuadrupedEnv(cfg.env, device)
        estimation = cfg.agent.estimation
        estimator = Estimator(OBS_DIM, env.grid.shape[0], estimation.network).to(device)
        estimated = EstimatedEnv(env, estimator, device, estimation.actor_uses_phase)
        with contextlib.redirect_stdout(io.StringIO()):  # rsl_rl prints its networks
            super().__init__(
                estimated, cfg.agent.rsl_rl(), str(log_dir) if log_dir else None, device
            )
        feet = env.footfalls
        trainer = EstimatorTrainer(
            estimator, estimation, env.privileged_slices, feet.min_steps, feet.max_steps
        )
        self.alg.attach(estimated, trainer)
        self.logger = TrainingLogger(
            log_dir=str(log_dir) if log_dir else None,
            cfg=self.cfg,
            env_cfg=cfg.env,
            num_envs=estimated.num_envs,
            is_distributed=self.is_distributed,
            gpu_world_size=self.gpu_world_size,
            gpu_global_rank=self.gpu_global_rank,
            device=device,
            measure=self._measure_noise,
            on_iteration=self._end_iteration,
        )
        self._noise_probe = NoiseProbe()
        self._levels: dict[str, float] = {}
        self._on_iteration = on_iteration
        self._stop_requested = False

    def train(self) -> bool:
        """Learn until the configured number of iterations; return False if interrupted.

        Ctrl-C ends the current iteration, saves and returns; a second one ends at once.
        """
        done = self.current_learning_iteration
        with self._catch_interrupt():
            try:
                self.learn(self.task_cfg.agent.iterations - done, init_at_random_ep_len=done == 0)
            except _StopTraining:
                if self.logger.log_dir is not None:
                    self.save(str(self.checkpoint_path()))
                self.logger.stop_logging_writer()  # writes out the last curves
                return False
        return True

    def checkpoint_path(self) -> Path:
        """Return the path of the checkpoint of the last finished iteration.

        Raises:
            ValueError: If the run keeps nothing.
        """
        if self.logger.log_dir is None:
            raise ValueError("this run has no log directory")
        return Path(self.logger.log_dir) / f"model_{self.current_learning_iteration}.pt"

    def save(self, path: str, infos: dict | None = None) -> None:
        """Save all that is needed to continue bit for bit, atomically."""
        about = self._about(self.current_learning_iteration)
        payload = (
            self.alg.save()
            | about
            | {
                "env": self.env.state_dict(),
                "logger": self.logger.state_dict(),
                "torch_random_state": torch.get_rng_state(),
                "cuda_random_state": torch.cuda.get_rng_state(self.device)
                if self._on_cuda
                else None,
                "infos": infos,
            }
        )
        save_checkpoint(Path(path), payload)
        self.logger.save_model(path, self.current_learning_iteration)

    def load(
        self,
        path: str,
        load_cfg: dict | None = None,
        strict: bool = True,
        map_location: str | None = None,
    ) -> dict:
        """Continue from a checkpoint.

        Raises:
            CheckpointError: If it is damaged, foreign, or of another configuration.
        """
        # On the CPU whatever the device: environment, networks and optimisers move what they load
        # to where they are, and the random states stay where they belong.
        checkpoint = load_checkpoint(Path(path), map_location or "cpu")
        try:
            self.alg.load(checkpoint, load_cfg, strict)
            self.env.load_state_dict(checkpoint["env"])
            self.logger.load_state_dict(checkpoint["logger"])
            torch.set_rng_state(checkpoint["torch_random_state"])
            # A run that moves to a GPU has no state to go on from there.
            if self._on_cuda and checkpoint["cuda_random_state"] is not None:
                torch.cuda.set_rng_state(checkpoint["cuda_random_state"], self.device)
        except (AttributeError, KeyError, TypeError, ValueError, RuntimeError) as error:
            reason = first_line(error)
            raise CheckpointError(f"{path} does not fit this configuration: {reason}") from error
        # The saved iteration is finished.
        self.current_learning_iteration = checkpoint["iter"] + 1
        # What was logged after the checkpoint is learnt, and logged, again.
        self.cfg["logger"]["first_iteration"] = self.current_learning_iteration
        return checkpoint["infos"] or {}

    @property
    def _on_cuda(self) -> bool:
        return torch.device(self.device).type == "cuda"

    def _measure_noise(self, iteration: int) -> dict[str, float]:
        """Return the modelled noise levels where the iteration is one that measures them, dBA."""
        interval = self.task_cfg.agent.noise_interval
        if not interval or (iteration + 1) % interval:
            return {}
        with torch.random.fork_rng(devices=[]):  # networks are born with random weights
            policy = make_policy(policy_part(self.alg.save() | self._about(iteration)))
        use_collection_threads()
        self._levels = self._noise_probe.measure(policy)
        return self._levels

    def _about(self, iteration: int) -> dict[str, Any]:
        """Return what a checkpoint says of its policy."""
        return {"task": self.task, "config": to_plain(self.task_cfg), "iter": iteration}

    def _end_iteration(self, iteration: int, total: int, scalars: dict[str, float]) -> None:
        if self._on_iteration is not None:
            # Between two trials the display goes on showing the last one's levels.
            self._on_iteration(iteration, total, self._levels | scalars)
        if self._stop_requested and iteration + 1 < total:
            raise _StopTraining

    @contextlib.contextmanager
    def _catch_interrupt(self) -> Iterator[None]:
        """Turn the first SIGINT or SIGTERM into a request heeded at the end of the iteration."""

        def request(signum: int, frame: FrameType | None) -> None:
            if self._stop_requested:
                raise KeyboardInterrupt
            self._stop_requested = True

        signals = (signal.SIGINT, signal.SIGTERM)
        previous = {number: signal.signal(number, request) for number in signals}
        try:
            yield
        finally:
            for number, handler in previous.items():
                signal.signal(number, handler)


class _StopTraining(Exception):  # noqa: N818
    """Leaves rsl_rl's loop between two iterations."""
