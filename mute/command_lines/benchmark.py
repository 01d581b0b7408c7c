"""Measure the speed of training, part by part: python -m mute.benchmark.

Every part is timed in one process and in turns with the bare engine, and compared with its rollout
of the same turn, so that a machine whose speed drifts does not favour one of them: a share is the
median over turns, not the quotient of two rates. A training begins, with less noise than usual.
Engine and environment then do each of its rollouts again, alone, with the same robots from the same
states with the same actions: what kneels, carries more or rubs takes longer to simulate, whatever
steps it. How fast the engine is with nominal robots that stand is told beside. Each size runs in a
process of its own, for its memory.
`--peers` times other ways to step a Go1 after that, see `mute.command_lines.benchmark_peers`.
"""

from __future__ import annotations

import dataclasses
import json
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from mujoco.batch import Batch
from rich.progress import track
from rsl_rl.algorithms import PPO
from rsl_rl.utils import check_nan

from mute.command_lines.arguments import (
    Words,
    check_distinct,
    check_option,
    command_line,
    parse,
    task_name,
)
from mute.command_lines.benchmark_peers import PEER_COLUMNS, peer_names, peer_pythons, time_peers
from mute.envs.quadruped_env import NUM_ACTIONS, QuadrupedEnv
from mute.evaluation.tables import print_table, write_json
from mute.learning.runner import MuteRunner
from mute.support.errors import MuteError
from mute.support.memory import keep_freed_memory
from mute.support.plugins import load_plugins
from mute.support.processes import call_apart, peak_memory_mb
from mute.support.provenance import machine_kind
from mute.support.ranges import Range
from mute.support.threads import use_collection_threads, use_learning_threads
from mute.tasks import DEFAULT_TASK, make_task

__all__ = ["BenchmarkArgs", "Rates", "measure"]

_ACTION_STD = 0.4
"""Standard deviation of the actions that the training begins with."""


@dataclass
class BenchmarkArgs:
    """Arguments of the benchmark."""

    task: str = DEFAULT_TASK
    """Task to measure; `module:task` imports a module of yours first, which registers it."""
    num_envs: tuple[int, ...] = (256, 1024, 4096, 8192, 16384)
    """Numbers of environments."""
    rollouts: int = 5
    """Turns, each a rollout of every part; the medians count."""
    peers: Words = ()
    """Other simulations to time on the CPU as well, in turns with this one: all, or some of
    gymnasium, mjlab, mujoco_playground and unilab; none if not given. All but gymnasium step as
    many robots as the smallest of --num-envs, after minutes of compiling, and are trained by their
    own loops. One that is not installed is told as such."""
    peers_from: Path | None = None
    """Folder with their virtual environments, which `python -m benchmarks.make_peers` makes."""
    mjlab_python: Path | None = None
    """Python interpreter that has mjlab, if that is elsewhere; this one if neither is given."""
    playground_python: Path | None = None
    """Python interpreter that has MuJoCo Playground (package playground), likewise."""
    unilab_python: Path | None = None
    """Python interpreter that has UniLab, likewise."""
    json: bool = False
    """Print JSON and nothing else."""
    out: Path | None = None
    """File to write the JSON to as well."""


@dataclass
class Rates:
    """Control steps a second, environments times steps, of each part of training."""

    num_envs: int
    """Number of environments."""
    rollouts: int
    """Turns that were timed."""
    engine: float
    """MuJoCo alone: the physics steps of a control step in one call, of the training's robots."""
    nominal_engine: float
    """The same of robots without randomisation that stand, shaken by noise."""
    environment: float
    """The environment alone, with the training's robots and actions."""
    collection: float
    """The environment with estimator and actor-critic in its loop."""
    learning: float
    """The update: estimator and PPO."""
    loop: float
    """Collection and learning together."""
    environment_over_engine: float
    """The environment as a share of the engine alone."""
    collection_over_engine: float
    """Collection as a share of the engine alone."""
    learning_over_engine: float
    """Learning as a share of the engine alone."""
    loop_over_engine: float
    """The whole loop as a share of the engine alone."""
    peak_memory_mb: float
    """Largest memory of the process, MB."""


def measure(task: str, num_envs: int, rollouts: int) -> Rates:
    """Return the rates for one number of environments.

    Args:
        task: Name of the task.
        num_envs: Number of environments.
        rollouts: Turns to time.
    """
    cfg = make_task(task)
    env = dataclasses.replace(cfg.env, num_envs=num_envs)
    agent = dataclasses.replace(cfg.agent, init_std=_ACTION_STD)
    cfg = dataclasses.replace(cfg, env=env, agent=agent)
    torch.set_float32_matmul_precision(cfg.agent.matmul_precision)
    runner = MuteRunner(task, cfg, None)
    steps = cfg.agent.num_steps_per_env
    collect, replay = _collection(runner, steps), _Replay(runner.env.env)
    parts = {
        "collection": collect,
        "engine": replay.engine,
        "environment": replay.environment,
        "nominal_engine": _nominal_engine(runner.env.env, steps),
        "learning": runner.alg.update,
    }
    runner.alg.train_mode()
    times: dict[str, list[float]] = {name: [] for name in parts}
    for rollout in range(rollouts + 1):
        before = runner.env.env.state_dict()
        for name, part in parts.items():
            if name == "engine":
                replay.load(before, runner.alg.storage.actions)
            (use_learning_threads if name == "learning" else use_collection_threads)()
            start = time.perf_counter()
            part()
            if rollout > 0:  # the first one warms up, and the estimator only waits in it
                times[name].append(time.perf_counter() - start)
    pairs = zip(times["collection"], times["learning"], strict=True)
    times["loop"] = [collection + learning for collection, learning in pairs]
    rates = {name: num_envs * steps / statistics.median(each) for name, each in times.items()}
    over_engine = {
        f"{name}_over_engine": _median_ratio(times["engine"], each)
        for name, each in times.items()
        if not name.endswith("engine")
    }
    measured = rates | over_engine | {"peak_memory_mb": peak_memory_mb()}
    return Rates(num_envs=num_envs, rollouts=rollouts, **measured)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Raises:
        MuteError: If an argument is bad.
    """
    argv = command_line() if argv is None else list(argv)
    args = parse(BenchmarkArgs, argv, "Measure the speed of training, part by part.")
    task = task_name(args.task)
    make_task(task)
    peers = peer_names(args.peers)
    check_distinct("num-envs", args.num_envs)
    for num_envs in args.num_envs:
        check_option("num-envs", num_envs, Range(1, 2**20, whole=True))
    check_option("rollouts", args.rollouts, Range(1, 10**6, whole=True))
    sizes = args.num_envs if args.json else track(args.num_envs, "environments")
    rows = [_rates_apart(args.task, num_envs, args.rollouts) for num_envs in sizes]
    peer_rows = _peer_rows(args, peers)
    content = {"task": task, "machine": machine_kind(), "rates": rows, "peers": peer_rows}
    if args.out is not None:
        write_json(args.out, content)
    if args.json:
        print(json.dumps(content))
    else:
        print_table(f"control steps/s, {content['machine']}", rows, list(rows[0]))
        if peer_rows:
            shown = [{k: "-" if v is None else v for k, v in row.items()} for row in peer_rows]
            print_table("peers, control steps/s", shown, list(PEER_COLUMNS))
    return 0


def _peer_rows(args: BenchmarkArgs, peers: Sequence[str]) -> list[dict[str, Any]]:
    if not peers:
        return []
    given = {
        "mjlab": args.mjlab_python,
        "mujoco_playground": args.playground_python,
        "unilab": args.unilab_python,
    }
    pythons = peer_pythons(peers, args.peers_from, given)
    rounds, robots = args.rollouts, min(args.num_envs)
    return [
        dataclasses.asdict(rate) for rate in time_peers(peers, pythons, robots, rounds, args.task)
    ]


def _rates_apart(task: str, num_envs: int, rollouts: int) -> dict[str, float]:
    try:
        return dataclasses.asdict(call_apart(_measure_as_trained, task, num_envs, rollouts))
    except MuteError as error:
        raise MuteError(f"--num-envs {num_envs}: {error}") from error


def _measure_as_trained(task: str, num_envs: int, rollouts: int) -> Rates:
    """Return the rates in a process whose memory is kept as in that of a training."""
    keep_freed_memory()
    load_plugins()
    return measure(task_name(task), num_envs, rollouts)


def _median_ratio(engine: Sequence[float], part: Sequence[float]) -> float:
    """Return how fast a part is as a share of the engine, by turns."""
    return statistics.median(one / other for one, other in zip(engine, part, strict=True))


class _Physics:
    """MuJoCo alone: control steps of robots whose set points are given."""

    def __init__(self, env: QuadrupedEnv) -> None:
        """Make nominal robots of the model of an environment."""
        self._env = env
        self.batch = Batch(env.model, env.num_envs)
        self._ctrl = self.batch.bind("ctrl")

    def follow(self, actions: torch.Tensor) -> None:
        """Take actions' set points, as the environment does. Shape: (num_steps, num_envs, 12)."""
        cfg = self._env.cfg
        clipped = torch.nan_to_num(actions).clamp(-cfg.action_clip, cfg.action_clip)
        self._targets = (self._env.stand + cfg.action_scale * clipped).double().numpy()

    def run(self) -> None:
        """Step the physics."""
        for target in self._targets:
            self._ctrl[:] = target
            self.batch.step(nstep=self._env.cfg.decimation)


class _Replay:
    """A rollout that a training's robots have done, done again by engine or environment alone.

    For the engine what falls stays down, and pushes are left out: in the first rollouts of a
    training, which are timed, hardly a robot falls or is pushed.
    """

    def __init__(self, env: QuadrupedEnv) -> None:
        """Make the same robots twice; `env` is the training's."""
        self._env = QuadrupedEnv(env.cfg)
        self._physics = _Physics(env)
        self.engine = self._physics.run
        batch = self._physics.batch
        self._state = batch.state
        for key, value in env.simulation.state_dict().items():
            if key.startswith("field/"):
                batch.expand(key.removeprefix("field/"))[:] = value.numpy()
        batch.set_const()

    def load(self, before: dict[str, Any], actions: torch.Tensor) -> None:
        """Go to where a rollout began.

        Args:
            before: The environment's state there.
            actions: Actions of the rollout. Shape: (num_steps, num_envs, 12).
        """
        self._env.load_state_dict(before)
        self._state[:] = before["simulation"]["integration"].numpy()
        self._actions = actions.clone()
        self._physics.follow(actions)

    @torch.inference_mode()
    def environment(self) -> None:
        """Step the environment."""
        for action in self._actions:
            self._env.step(action)


def _nominal_engine(env: QuadrupedEnv, steps: int) -> Callable[[], None]:
    physics = _Physics(env)
    physics.batch.reset(keyframe=env.model.key("stand").id)
    physics.follow(_ACTION_STD * torch.randn(steps, env.num_envs, NUM_ACTIONS))
    return physics.run


def _collection(runner: MuteRunner, steps: int) -> Callable[[], None]:
    algorithm: PPO = runner.alg
    env = runner.env

    @torch.inference_mode()
    def run() -> None:
        observations = env.get_observations()
        for _ in range(steps):
            actions = algorithm.act(observations)
            observations, rewards, dones, extras = env.step(actions)
            check_nan(observations, rewards, dones)
            algorithm.process_env_step(observations, rewards, dones, extras)
            runner.logger.process_env_step(rewards, dones, extras)
        algorithm.compute_returns(observations)

    return run
