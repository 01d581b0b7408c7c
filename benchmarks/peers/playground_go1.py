"""MuJoCo Playground's own Go1 task on flat ground, and its own training by Brax.

Run with playground 0.2.0, mujoco-mjx 3.17.0 and brax 0.14.2. The package clones a repository for
the robot's meshes, which are only for show, when its first environment is made and they are not
there; `make_peers` puts them there.
"""

from __future__ import annotations

import functools
import importlib
import itertools
import os
import queue
import threading
from collections.abc import Callable
from importlib import metadata
from typing import Any

import numpy as np

from peers.parts import ACTION_SETS, TARGET_NOISE, Facts, Loop, Parts
from peers.walking import WalkMeter

__all__ = ["make"]

_TASK = "Go1JoystickFlatTerrain"
_MOST_ITERATIONS = 10_000
"""Iterations that the training is asked for; it is left when no more are wanted."""

_NEVER = 10**6
"""Control steps until a command changes."""


def make(num_envs: int, _task: str) -> Parts:
    """Return the task as its PPO steps it, and its training."""
    os.environ["JAX_PLATFORMS"] = "cpu"  # before jax is imported
    jax: Any = importlib.import_module("jax")
    playground: Any = importlib.import_module("mujoco_playground")
    # The default implementation is Warp's, which needs a GPU here.
    overrides: dict[str, Any] = {"impl": "jax"}
    bare = playground.registry.load(_TASK, config_overrides=overrides)
    env = playground.wrapper.wrap_for_brax_training(bare)
    advance = jax.jit(env.step)
    # Its wrappers take keys as arrays of numbers only.
    key, actions_key = jax.random.split(jax.random.PRNGKey(0))
    state = jax.jit(env.reset)(jax.random.split(key, num_envs))
    scale = playground.registry.get_default_config(_TASK).action_scale
    noise = jax.random.normal(actions_key, (ACTION_SETS, num_envs, env.action_size))
    actions = itertools.cycle(TARGET_NOISE / scale * noise)

    def step() -> None:
        nonlocal state
        state = jax.block_until_ready(advance(state, next(actions)))

    # As in MUTE's trials what robots see has no noise; without a randomizer they are nominal.
    overrides["noise_config.level"] = 0.0
    trial = playground.registry.load(_TASK, config_overrides=overrides)
    training = _Training(playground, bare, trial, num_envs)
    facts = Facts(
        engine=f"mujoco-mjx {metadata.version('mujoco-mjx')} (jax on the CPU)",
        robot="Unitree Go1",
        task=_TASK,
        num_envs=num_envs,
        physics_step=bare.sim_dt,
        decimation=bare.n_substeps,
        note=f"PPO of brax {metadata.version('brax')}, no estimator",
    )
    return Parts(facts, step, training.loop, training.walk)


class _Training:
    """Brax's training, which is one call: it runs in a thread and waits after each iteration."""

    def __init__(self, playground: Any, env: Any, trial: Any, num_envs: int) -> None:  # noqa: ANN401
        self._playground, self._env, self._trial = playground, env, trial
        self._num_envs = num_envs
        self._asked: queue.Queue[None] = queue.Queue()
        self._done: queue.Queue[tuple[int, float] | Exception] = queue.Queue()
        self._thread: threading.Thread | None = None
        self._policy: Callable[..., Any] | None = None
        self.loop: Loop = self._iteration

    def _iteration(self) -> tuple[int, float]:
        """Train for one iteration; Brax times it, without what it compiles between two."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._train, daemon=True)
            self._thread.start()
        self._asked.put(None)
        result = self._done.get()
        if isinstance(result, Exception):
            raise result
        return result

    def _train(self) -> None:
        try:
            self._call()
        except Exception as error:
            self._done.put(error)

    def _call(self) -> None:
        train: Any = importlib.import_module("brax.training.agents.ppo.train")
        networks: Any = importlib.import_module("brax.training.agents.ppo.networks")
        params: Any = importlib.import_module("mujoco_playground.config.locomotion_params")
        settings = dict(params.brax_ppo_config(_TASK))
        factory = settings.pop("network_factory")
        steps = settings["batch_size"] * settings["num_minibatches"] * settings["unroll_length"]
        # An "evaluation" after each iteration is where Brax calls back; none is made.
        settings |= {
            "num_envs": self._num_envs,
            "num_timesteps": _MOST_ITERATIONS * steps,
            "num_evals": _MOST_ITERATIONS + 1,
            "num_resets_per_eval": 0,
        }

        def report(_step: int, metrics: dict[str, float]) -> None:
            self._done.put((steps, steps / float(metrics["training/sps"])))
            self._asked.get()

        def keep(_step: int, make_policy: Callable[..., Any], weights: Any) -> None:  # noqa: ANN401
            self._policy = make_policy(weights, deterministic=True)

        self._asked.get()
        train.train(
            environment=self._env,
            wrap_env_fn=self._playground.wrapper.wrap_for_brax_training,
            randomization_fn=self._playground.registry.get_domain_randomizer(_TASK),
            network_factory=functools.partial(networks.make_ppo_networks, **factory),
            progress_fn=report,
            policy_params_fn=keep,
            run_evals=False,
            seed=0,
            **settings,
        )

    def walk(self, trials: int, seconds: float) -> tuple[float, float]:
        """Let the policy walk without noise on its actions."""
        if self._policy is None:
            raise RuntimeError("nothing has been learnt yet")
        jax: Any = importlib.import_module("jax")
        env = self._playground.wrapper.wrap_for_brax_training(self._trial)
        key = jax.random.PRNGKey(1)
        state = jax.jit(env.reset)(jax.random.split(key, trials))
        state.info["steps_until_next_cmd"] = jax.numpy.full(trials, _NEVER)
        policy, velocity_of = self._policy, jax.vmap(self._trial.get_local_linvel)

        @jax.jit
        def advance(state: Any) -> tuple[Any, Any]:  # noqa: ANN401
            state = env.step(state, policy(state.obs, key)[0])
            return state, velocity_of(state.data)

        meter = WalkMeter(trials, self._trial.dt)
        for _ in range(round(seconds / self._trial.dt)):
            command = np.asarray(state.info["command"])
            state, velocity = advance(state)
            # Trials are shorter than episodes, so what ends one is a fall.
            meter.update(command, np.asarray(velocity), np.asarray(state.done) > 0.5)
        return meter.figures()
