"""Measure what parts of the physics cost, and what they are worth: python -m benchmarks.physics.

The policy of flat ground walks with the exploration of a training, robots differing as in a
training. Their actions of a rollout are then done again, from the same state, by the bare engine
with one thing changed at a time. All variants take turns in one process, in an order drawn anew for
each turn, and are compared with the scene as it is within the turn.

A second part has the policy walk without noise in each variant, and compares landing speeds,
contact forces and work with physics steps of 0.5 ms. A third counts which shapes touch the ground,
under that policy and under random actions, as at a training's beginning.
"""

from __future__ import annotations

from mute.support.threads import configure_threads

configure_threads()  # before torch is imported

import dataclasses
import json
import random
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import torch
from rich.progress import track

from mute.command_lines.arguments import check_option, command_line, make_directory, parse, spelled
from mute.controllers import LearnedController, load_policy
from mute.controllers.learned import Policy
from mute.envs.batch_simulation import BatchSimulation
from mute.envs.quadruped_env import NUM_ACTIONS, QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.randomization import randomize_physics
from mute.envs.scene import LEGS, add_contact_sensor, make_spec
from mute.envs.sensors import sensor_slice
from mute.envs.simulation import Simulation
from mute.evaluation.intervals import median_interval
from mute.evaluation.physics_fidelity import REFERENCE, as_modelled, walk_figures
from mute.evaluation.tables import print_table, write_json
from mute.evaluation.trials import evaluation_cfg
from mute.support.errors import run_cli
from mute.support.provenance import machine_kind
from mute.support.ranges import Range
from mute.support.resources import shipped_file
from mute.support.threads import core_share, use_collection_threads
from mute.tasks import FLAT_TASK

__all__ = ["VARIANTS", "PhysicsBenchmarkArgs", "Variant"]

_SEED = 1
_WARM_UP = 50
"""Control steps after which the robots walk as in a training."""
_STEPS = 24
"""Control steps of a rollout, as in a training."""
_ACTION_STD = 0.3
"""Standard deviation of exploration, as in the middle of a training."""
_FIRST_ACTION_STD = 1.0
"""Standard deviation of the actions at the beginning of a training."""
_FIDELITY_ROBOTS, _FIDELITY_SECONDS = 8, 4.0
_UNFINISHED = "not finished"
"""What a file says while more is being measured, and for ever if the machine is switched off."""
_SHAPES = ("foot", "trunk", "thigh", "shank")

SpecEdit = Callable[[mujoco.MjSpec], None]
CfgEdit = Callable[[QuadrupedEnvCfg], QuadrupedEnvCfg]


@dataclass(frozen=True)
class Variant:
    """One thing about the physics, changed."""

    name: str
    """What is changed, in words."""
    cfg: CfgEdit = lambda cfg: cfg
    """Changes the configuration."""
    spec: SpecEdit | None = None
    """Changes what no configuration can; not walked in the second part."""
    pictured: bool = False
    """Whether shapes that are only to be seen are there."""
    trees: bool = False
    """Whether bodies have trees of boxes around their shapes, see `as_stepped`."""


def _scene(**changes: Any) -> CfgEdit:  # noqa: ANN401
    return lambda cfg: dataclasses.replace(cfg, scene=dataclasses.replace(cfg.scene, **changes))


def _without_dry_friction(cfg: QuadrupedEnvCfg) -> QuadrupedEnvCfg:
    own = cfg.randomization if cfg.randomization.enabled else as_modelled()
    return dataclasses.replace(
        cfg, randomization=dataclasses.replace(own, friction_loss=(0.0, 0.0))
    )


def _two_longer_steps(cfg: QuadrupedEnvCfg) -> QuadrupedEnvCfg:
    scene = dataclasses.replace(cfg.scene, timestep=0.01)
    return dataclasses.replace(cfg, scene=scene, decimation=2)


def _with(disabled: mujoco.mjtDisableBit) -> SpecEdit:
    """Return an edit that enables what the scene leaves out."""

    def edit(spec: mujoco.MjSpec) -> None:
        spec.option.disableflags &= ~int(disabled)

    return edit


def _only_feet_collide(spec: mujoco.MjSpec) -> None:
    for geom in spec.geoms:
        if geom.name.split("_")[-1] in ("thigh", "shank"):
            geom.contype = geom.conaffinity = 0


def _hips_collide(spec: mujoco.MjSpec) -> None:
    """Give each hip the capsule that published models have, and its contact sensor."""
    for leg in LEGS:
        sideways = 0.02 if leg.endswith("L") else -0.02
        name = f"{leg}_hip_motor"
        spec.body(f"{leg}_hip").add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            size=(0.05, 0.0, 0.0),
            fromto=(0.0, sideways, 0.0, 0.0, 2.0 * sideways, 0.0),
            contype=0,
            conaffinity=1,
        )
        add_contact_sensor(spec, name)


AS_IT_IS = Variant("as it is")
VARIANTS = (
    AS_IT_IS,
    Variant("with the shapes that are only to be seen", pictured=True),
    Variant("with trees of boxes around the shapes of a body", trees=True),
    Variant("with a search for islands", spec=_with(mujoco.mjtDisableBit.mjDSBL_ISLAND)),
    Variant("hips touch the ground as well", spec=_hips_collide),
    Variant("thighs and shanks touch nothing", spec=_only_feet_collide),
    Variant("without dry friction in the joints", cfg=_without_dry_friction),
    Variant("at most 5 solver iterations", cfg=_scene(iterations=5)),
    Variant("at most 3 solver iterations", cfg=_scene(iterations=3)),
    Variant("at most 2 solver iterations", cfg=_scene(iterations=2)),
    Variant("at most 10 line-search iterations", cfg=_scene(ls_iterations=10)),
    Variant("at most 5 line-search iterations", cfg=_scene(ls_iterations=5)),
    Variant("elliptic friction cones", cfg=_scene(cone="elliptic")),
    Variant("2 steps of 10 ms, not 4 of 5 ms", cfg=_two_longer_steps),
)


@dataclass
class PhysicsBenchmarkArgs:
    """Arguments of the benchmark."""

    policy: Path = shipped_file(FLAT_TASK)
    """The policy that walks."""
    num_envs: int = 1024
    """Robots that are stepped."""
    turns: int = 15
    """Rollouts of each variant; the medians count."""
    json: bool = False
    """Print JSON and nothing else."""
    out: Path | None = None
    """File to write the JSON to as well."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Raises:
        MuteError: If an argument is bad, or the policy cannot be used.
        KeyboardInterrupt: If interrupted; what was measured before that has then been written and
            printed.
    """
    argv = command_line() if argv is None else list(argv)
    args = parse(PhysicsBenchmarkArgs, argv, "Measure what parts of the physics cost.")
    check_option("num-envs", args.num_envs, Range(1, 2**20, whole=True))
    check_option("turns", args.turns, Range(1, 10**6, whole=True))
    policy = load_policy(args.policy)
    if args.out is not None:
        make_directory(args.out.parent)
    content: dict[str, Any] = {"task": policy.task, "machine": machine_kind()}
    content["options"] = spelled(args, ("policy", "num_envs", "turns"))
    content |= {"mujoco": mujoco.__version__, "num_envs": args.num_envs, "stopped": _UNFINISHED}
    content |= {"turns": 0, "rates": [], "fidelity": [], "touching": []}
    try:
        for _ in _measure(policy, args, content):
            if args.out is not None:
                write_json(args.out, content)
    except KeyboardInterrupt:
        content["stopped"] = "interrupted"
        if content["touching"]:
            _tell(args, content)
        raise
    content["stopped"] = None
    _tell(args, content)
    return 0


def _tell(args: PhysicsBenchmarkArgs, content: Mapping[str, Any]) -> None:
    """Write and print what was measured."""
    if args.out is not None:
        write_json(args.out, content)
    if args.json:
        print(json.dumps(content))
        return
    titles = {"rates": f"engine alone, {content['machine']}"}
    for part in ("rates", "fidelity", "touching"):
        if content[part]:
            print_table(titles.get(part, part), content[part], list(content[part][0]))


def _measure(policy: Policy, args: PhysicsBenchmarkArgs, content: dict[str, Any]) -> Iterator[None]:
    """Fill in what is measured, and yield whenever there is more of it."""
    use_collection_threads()
    cfg = evaluation_cfg(policy.cfg.env, args.num_envs, 60.0, _SEED, randomized=True)
    rollout = _record(policy, cfg, _ACTION_STD)
    first = _record(None, cfg, _FIRST_ACTION_STD)
    content["touching"] = [
        {"shape": name, "policy": rollout.touching[name], "beginning": first.touching[name]}
        for name in _SHAPES
    ]
    yield
    for content["turns"], content["rates"] in _rates(cfg, rollout, args.turns, args.json):
        yield
    for row in _fidelity(policy, args.json):
        content["fidelity"].append(row)
        yield


@dataclass
class _Rollout:
    """What robots did in a rollout."""

    qpos: torch.Tensor
    """Where they began. Shape: (num_envs, nq)."""
    qvel: torch.Tensor
    """How they moved then. Shape: (num_envs, nv)."""
    set_points: list[torch.Tensor]
    """Set points of each control step, rad. Shape of each: (num_envs, 12)."""
    touching: dict[str, float]
    """By kind of shape, the share of robots and control steps in which one touches the ground."""


def _record(policy: Policy | None, cfg: QuadrupedEnvCfg, action_std: float) -> _Rollout:
    """Return a rollout of a policy, None for one that does nothing, with exploration."""
    env = QuadrupedEnv(cfg)
    controller = LearnedController(policy, cfg.num_envs) if policy is not None else None
    generator = torch.Generator().manual_seed(_SEED)
    touching: dict[str, float] = dict.fromkeys(_SHAPES, 0.0)

    def step() -> None:
        action = action_std * torch.randn(cfg.num_envs, NUM_ACTIONS, generator=generator)
        if controller is not None:
            action += controller.act(env.get_observations())
        _, _, dones, _ = env.step(action)
        if controller is not None:
            controller.reset(dones)

    for _ in range(_WARM_UP):
        step()
    begin = env.simulation.qpos.clone(), env.simulation.qvel.clone()
    set_points = []
    for _ in range(_STEPS):
        step()
        set_points.append(env.simulation.ctrl.clone())
        for name in _SHAPES:
            touching[name] += float(_touches(env, name).any(dim=1).float().mean()) / _STEPS
    return _Rollout(*begin, set_points, touching)


def _touches(env: QuadrupedEnv, shape: str) -> torch.Tensor:
    """Return which shapes of a kind touched the ground in the last control step.

    At any of its physics steps, before a robot that fell was put on its feet again.

    Shape: (num_envs, shapes).
    """
    names = [shape] if shape == "trunk" else [f"{leg}_{shape}" for leg in LEGS]
    columns = [sensor_slice(env.model, f"{name}_contact", 1).start for name in names]
    return (env.simulation.substeps["sensordata"][:, :, columns] > 0.0).any(dim=1)


def _rates(
    cfg: QuadrupedEnvCfg, rollout: _Rollout, turns: int, quiet: bool
) -> Iterator[tuple[int, list[dict[str, Any]]]]:
    """Yield after each turn the number of turns so far, and a row for each variant."""
    steps = cfg.num_envs * len(rollout.set_points)
    simulations = {variant: _simulation(variant, cfg) for variant in VARIANTS}
    times: dict[Variant, list[float]] = {variant: [] for variant in VARIANTS}
    order, shuffle = list(VARIANTS), random.Random(_SEED).shuffle
    for turn in range(turns + 1) if quiet else track(range(turns + 1), "turns"):
        shuffle(order)
        for variant in order:
            seconds = _seconds(simulations[variant], variant.cfg(cfg).decimation, rollout)
            if turn > 0:  # the first one warms up
                times[variant].append(seconds)
        if turn > 0:
            reference = times[AS_IT_IS]
            rows = [_rate(each.name, steps, times[each], reference) for each in VARIANTS]
            yield turn, rows


def _rate(
    name: str, steps: int, times: Sequence[float], reference: Sequence[float]
) -> dict[str, Any]:
    rate = median_interval([steps / seconds for seconds in times])
    faster = median_interval([own / each for own, each in zip(reference, times, strict=True)])
    return {
        "variant": name,
        "steps_per_second": rate.median,
        "speed": faster.median,
        "speed_low": faster.low,
        "speed_high": faster.high,
    }


def _simulation(variant: Variant, cfg: QuadrupedEnvCfg) -> Simulation:
    """Return robots that differ as those of the rollout do, with one thing changed."""
    cfg = variant.cfg(cfg)
    spec = make_spec(cfg.scene, pictured=variant.pictured)
    if variant.spec is not None:
        variant.spec(spec)
    threads = min(core_share(), cfg.num_envs)
    simulation = BatchSimulation(spec.compile(), cfg.num_envs, threads, variant.trees)
    simulation.record("sensordata")
    randomize_physics(simulation, cfg.randomization, torch.Generator().manual_seed(cfg.seed))
    return simulation


def _seconds(simulation: Simulation, decimation: int, rollout: _Rollout) -> float:
    """Return what a rollout takes."""
    simulation.reset(torch.ones(simulation.num_envs, dtype=torch.bool))
    simulation.qpos[:], simulation.qvel[:] = rollout.qpos, rollout.qvel
    simulation.forward()
    start = time.perf_counter()
    for set_points in rollout.set_points:
        simulation.ctrl[:] = set_points
        simulation.step(decimation)
    return time.perf_counter() - start


def _fidelity(policy: Policy, quiet: bool) -> Iterator[dict[str, Any]]:
    """Yield how far walks in each variant are from one in physics steps of 0.5 ms."""
    cfg = evaluation_cfg(policy.cfg.env, _FIDELITY_ROBOTS, _FIDELITY_SECONDS, _SEED)
    steps = round(cfg.step_dt / REFERENCE)
    finest = dataclasses.replace(
        cfg, scene=dataclasses.replace(cfg.scene, timestep=REFERENCE), decimation=steps
    )
    walked = [
        variant for variant in VARIANTS if not (variant.spec or variant.pictured or variant.trees)
    ]
    for beta in (0.0, 1.0):
        reference = walk_figures(policy, finest, beta)
        for variant in walked if quiet else track(walked, f"walks at beta {beta:g}"):
            figures = walk_figures(policy, variant.cfg(cfg), beta)
            off = {name: value / reference[name] - 1.0 for name, value in figures.items()}
            yield {"variant": variant.name, "beta": beta, **off}


if __name__ == "__main__":
    run_cli(main)
