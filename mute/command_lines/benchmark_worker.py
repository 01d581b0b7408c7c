"""A training that is timed part by part, on demand; `benchmark_turns` starts it by its path.

    python -P benchmark_worker.py TASK NUM_ENVS SEED

It imports MUTE from wherever `PYTHONPATH` or its interpreter has it, which may be another version:
it uses nothing but what older ones have as well. The engine may be `mjbatch` or MuJoCo's own batch.

A line of JSON is answered by a line of JSON. The first answer, without a question, is
{"ready": {...}}: versions, and how much memory training takes. {"part": NAME} is answered by
{"seconds": {NAME: s, ...}}, and what a user can put right by {"error": REASON}. It ends with its
input.
"""

from __future__ import annotations

import dataclasses
import importlib
import json
import os
import signal
import sys
import time
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any

ACTION_STD = 0.4
"""Standard deviation of the actions that the training begins with, less than usual."""

_FIRST_ITERATIONS = 3
"""Iterations before anything is timed: memory has reached its peak, and the estimator learns."""

_READ = ("sensordata", "actuator_force")
"""Arrays that an environment reads after each call of the engine, beside the state."""

Seconds = dict[str, float]
"""How long parts took, s."""


def main() -> None:
    """Answer the lines of the input."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # whatever a library prints is no answer
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends it by way of who asks

    def answer(content: dict[str, Any]) -> None:
        print(json.dumps(content), file=answers, flush=True)

    errors: Any = importlib.import_module("mute.support.errors")
    _check_tree()
    try:
        parts, ready = _prepare(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
        _check_tree()
        answer({"ready": ready})
        for line in sys.stdin:
            answer({"seconds": parts[json.loads(line)["part"]]()})
    except (errors.MuteError, MemoryError) as error:
        answer({"error": " ".join(str(error).split()) or type(error).__name__})


def _prepare(
    task: str, num_envs: int, seed: int
) -> tuple[dict[str, Callable[[], Seconds]], dict[str, Any]]:
    """Set up this process as `train.py` does; return its parts and what is to be known of it."""
    from mute.support.memory import keep_freed_memory
    from mute.support.threads import configure_threads

    keep_freed_memory()
    configure_threads()  # before torch is imported
    from mute.support.plugins import load_plugins
    from mute.support.processes import peak_memory_mb

    load_plugins()
    training = _Training(task, num_envs, seed)
    memory = peak_memory_mb()
    replay = _Replay(training)
    parts = {
        "loop": training.iterate,
        "engine": replay.engine,
        "nominal_engine": replay.nominal_engine,
        "environment": replay.environment,
    }
    about = _about() | {"engine": replay.engine_name}
    return parts, about | {"control_steps": training.control_steps, "peak_memory_mb": memory}


def _check_tree() -> None:
    """End with a line if not all that is imported of MUTE is of one tree.

    An environment with an editable install fills in what the named tree lacks from its own.
    """
    own = {name: module for name, module in sys.modules.items() if name.split(".")[0] == "mute"}
    files = {name: getattr(module, "__file__", None) for name, module in own.items()}
    top = Path(files["mute"] or "").resolve().parents[1]
    for name, file in files.items():
        if file is not None and not Path(file).resolve().is_relative_to(top):
            raise SystemExit(f"{name} is none of {top}: it comes from {file}")


def _about() -> dict[str, str]:
    """Return the versions of what is timed."""
    from mute.support.provenance import current_commit

    packages = {name: metadata.version(name) for name in ("mujoco", "torch")}
    return packages | {"python": sys.version.split()[0], "commit": current_commit()}


class _Training:
    """A training without a log, an iteration at a time, in rsl_rl's own loop."""

    def __init__(self, task: str, num_envs: int, seed: int = 0) -> None:
        """Begin one and do its first iterations."""
        import torch

        from mute.command_lines.arguments import task_name
        from mute.learning.runner import MuteRunner
        from mute.support.errors import MuteError
        from mute.tasks import make_task

        name = task_name(task)
        cfg = make_task(name)
        try:
            env = dataclasses.replace(cfg.env, num_envs=num_envs, seed=seed)
            agent = dataclasses.replace(cfg.agent, init_std=ACTION_STD)
            cfg = dataclasses.replace(cfg, env=env, agent=agent)
        except ValueError as error:  # too few robots, say
            raise MuteError(str(error)) from error
        torch.set_float32_matmul_precision(agent.matmul_precision)
        self.runner = MuteRunner(name, cfg, None)
        self.control_steps = num_envs * agent.num_steps_per_env
        """Control steps of a rollout: environments times steps."""
        self._clock: dict[str, float] = {}
        self._log = self.runner.logger.log
        self.runner.logger.log = self._note
        for iteration in range(_FIRST_ITERATIONS):
            self.iterate(init_at_random_ep_len=iteration == 0)

    def iterate(self, init_at_random_ep_len: bool = False) -> Seconds:
        """Do one iteration, and return what its own clock says."""
        self.before: dict[str, Any] = self.runner.env.env.state_dict()
        """Where its rollout began: the environment's state."""
        self.runner.learn(1, init_at_random_ep_len=init_at_random_ep_len)
        collection, learning = self._clock["collect_time"], self._clock["learn_time"]
        return {"collection": collection, "learning": learning, "loop": collection + learning}

    def _note(self, **of_iteration: Any) -> None:  # noqa: ANN401
        self._clock = of_iteration
        self._log(**of_iteration)


class _Replay:
    """The last rollout of a training, done again by engine or environment alone.

    The environment does exactly the same again. The engine starts from the same states, and follows
    the same set points with the same robots; where an episode ended, it goes on with a robot that
    stands, as the environment does, and not with one that lies there. Pushes are left out.
    """

    def __init__(self, training: _Training) -> None:
        """Make the same robots once more for each of them, and nominal ones."""
        import torch

        from mute.envs.quadruped_env import QuadrupedEnv

        self._training = training
        env = training.runner.env.env
        self._env = QuadrupedEnv(env.cfg)
        self._batch, self._nominal = _Batch(env), _Batch(env)
        self.engine_name = self._batch.name
        """Package of the engine, and its version."""
        self._batch.take_fields(env.simulation.state_dict())
        shape = training.runner.alg.storage.actions.shape
        noise = torch.Generator().manual_seed(0)
        self._shaking = ACTION_STD * torch.randn(shape, generator=noise)

    def engine(self) -> Seconds:
        """Step the training's robots."""
        storage = self._training.runner.alg.storage
        self._batch.state[:] = self._training.before["simulation"]["integration"].numpy()
        ended = storage.dones[..., 0].bool().numpy()
        return {"engine": self._batch.time(self._env, storage.actions, ended)}

    def nominal_engine(self) -> Seconds:
        """Step nominal robots, which begin standing each time."""
        self._nominal.state[:] = self._nominal.standing
        return {"nominal_engine": self._nominal.time(self._env, self._shaking, None)}

    def environment(self) -> Seconds:
        """Step the environment."""
        import torch

        from mute.support.threads import use_collection_threads

        self._env.load_state_dict(self._training.before)
        actions = self._training.runner.alg.storage.actions
        use_collection_threads()
        with torch.inference_mode():
            start = time.perf_counter()
            for action in actions:
                self._env.step(action)
            return {"environment": time.perf_counter() - start}


class _Batch:
    """The engine alone: a batch of simulations of an environment's model, called as that does.

    It fills the arrays that the environment reads, and records those that the environment records:
    `mjbatch`, which records nothing, has the sensors' past in the model.
    """

    def __init__(self, env: Any) -> None:  # noqa: ANN401
        """Make nominal robots that stand, as many as the environment has, on as many threads."""
        import numpy as np

        from mute.support.threads import core_share

        module, self.name = _engine_module()
        threads = env.cfg.num_threads or core_share()
        self._batch = module.Batch(env.simulation.model, env.num_envs, threads)
        self._ctrl = self._batch.bind("ctrl")
        own = module.__name__ == "mujoco.batch"
        self.state = self._batch.state if own else self._batch.bind("state")
        """Live rows, all that a simulation continues from. Shape: (num_envs, num_state)."""
        past = ("history",) if not own and env.simulation.model.nhistory else ()
        of_kind = () if own else (np.float32,)
        self._read = [self._batch.bind(name, *of_kind) for name in (*_READ, *past)]
        recorded = getattr(env.simulation, "substeps", {})
        self._records = {name: np.zeros_like(rows.numpy()) for name, rows in recorded.items()}
        self._batch.reset(keyframe=env.simulation.model.key("stand").id)
        self.standing = self.state[0].copy()
        """The row of a robot that stands."""

    def take_fields(self, simulation: dict[str, Any]) -> None:
        """Take over the randomised physics of a simulation's `state_dict`."""
        for key, value in simulation.items():
            if key.startswith("field/"):
                self._batch.expand(key.removeprefix("field/"))[:] = value.numpy()
        self._batch.set_const()

    def time(self, env: Any, actions: Any, ended: Any) -> float:  # noqa: ANN401
        """Step from where the robots are, and return how long it took, s.

        Args:
            env: The environment whose set points the actions stand for.
            actions: Shape: (num_steps, num_envs, 12).
            ended: Whose episode a step ended, or None for nobody's. Shape: (num_steps, num_envs).
        """
        import torch

        clip = env.cfg.action_clip
        clipped = torch.nan_to_num(actions).clamp(-clip, clip)
        targets = (env.stand + env.cfg.action_scale * clipped).double().numpy()
        decimation = env.cfg.decimation
        start = time.perf_counter()
        for step, target in enumerate(targets):
            self._ctrl[:] = target
            self._step(decimation)
            if ended is not None and ended[step].any():
                self.state[ended[step]] = self.standing
        return time.perf_counter() - start

    def _step(self, decimation: int) -> None:
        if self._records:
            self._batch.rollout(decimation, record=tuple(self._records), out=self._records)
        else:
            self._batch.step(nstep=decimation)


def _engine_module() -> tuple[Any, str]:
    """Return the module with the engine's `Batch`, and the engine's name and version."""
    for name, package in (("mujoco.batch", "mujoco"), ("mjbatch", "mjbatch")):
        try:
            return importlib.import_module(name), f"{name} {metadata.version(package)}"
        except ModuleNotFoundError:
            continue
    raise SystemExit("neither mujoco.batch nor mjbatch is installed")


if __name__ == "__main__":
    main()
