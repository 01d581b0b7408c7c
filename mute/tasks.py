"""The registry: a task's name and its configuration."""

from __future__ import annotations

import copy
import dataclasses
import re
from collections.abc import Callable, Mapping
from typing import Any

from mute.config import AgentCfg, EstimationCfg, PPOCfg, TaskCfg
from mute.envs.commands import CommandsCfg
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.randomization import RandomizationCfg
from mute.envs.rewards import RewardsCfg, RewardTermCfg, paper_terms, reward_term
from mute.envs.scene import SceneCfg
from mute.envs.terrain import TerrainCfg
from mute.networks.estimator import EstimatorCfg
from mute.support.errors import MuteError

__all__ = [
    "DEFAULT_TASK",
    "DREAMWAQ_TASK",
    "FLAT_TASK",
    "PAPERS_PHASE_TERMS",
    "QUIET_TERM_TASKS",
    "make_task",
    "register_task",
    "task_names",
]

DEFAULT_TASK = "go1_mute"
"""The recipe over the floors and stairs of a house, of hours."""

FLAT_TASK = "go1_mute_flat"
"""The recipe on flat ground, of minutes: by it parts and quiet terms are compared, and its robots
are those of whatever drives without a task of its own."""

DREAMWAQ_TASK = "go1_dreamwaq"
"""The learned walk that the paper compares MUTE with."""

PAPERS_PHASE_TERMS = tuple(name for name, term in paper_terms().items() if term.group == "phase")
"""Names of what the paper is quiet by."""


def _go1_mute_paper() -> TaskCfg:
    """Return the paper's weights, sizes and inputs of the actor."""
    return TaskCfg(
        env=QuadrupedEnvCfg(num_envs=4096),
        agent=AgentCfg(
            iterations=6000,
            actor_hidden=(512, 256, 128),
            critic_hidden=(512, 256, 128),
            estimation=EstimationCfg(actor_uses_phase=False),
        ),
    )


def _go1_mute_flat() -> TaskCfg:
    """Return what works on a CPU: led to a trot that goes from a stand, then paid to be soft."""
    return _led_to_a_trot(_quiet())


def _go1_mute() -> TaskCfg:
    """Return the recipe of flat ground, over the floors and stairs of a house.

    Physics is MuJoCo's own on every device: Warp has flat ground alone.
    """
    task = _go1_mute_flat()
    terms = task.env.rewards.terms
    # On stairs a trunk is to lie along them, not level.
    terms["lean"] = reward_term("lean", terms.pop("tilt").weight, group="lift")
    # Sharp terms pay hardly more for 0.3 m/s than for 0.1 where 0.5 are asked for.
    terms["progress"] = reward_term("progress", 1.0)
    terms["yaw_drift"] = reward_term("yaw_drift", -4.0)
    # Most robots are on ground that leaves little of these: they make up for it on level ground.
    for term in terms.values():
        if term.group == "phase":
            term.weight = round(1.4 * term.weight, 6)
    env = dataclasses.replace(
        task.env,
        # Ground is learnt aloud: with the times of flat ground, robots climb no stairs.
        rewards=dataclasses.replace(task.env.rewards, quiet_ramp=(300.0, 800.0)),
        engine="mujoco",
        # Half as many steps of physics teach as well, in little more than half of the time; no
        # floor can be stiffer in them than the one of the scene.
        scene=dataclasses.replace(task.env.scene, timestep=0.01),
        decimation=2,
        # Robots that all differ in everything learn to walk late.
        randomization=dataclasses.replace(
            task.env.randomization, floor_stiffness=(0.5, 1.0), everything_share=0.5
        ),
        # Commands of two seconds cross nothing.
        terrain=TerrainCfg(
            kind="indoor",
            first_levels=(0, 0),
            crossed=3.0,
            passed_share=0.75,
            command_time=10.0,
            turning_share=0.2,
            ahead_share=0.5,
            quiet_share=0.2,
        ),
    )
    agent = dataclasses.replace(
        task.agent,
        iterations=2400,
        # Steps are found with much exploration; then, as levels keep robots at the end of what
        # they can, it would grow, and robots would follow commands ever worse.
        late_entropy_share=0.3,
        entropy_iterations=(200, 300),
        # A stair that a foot strikes turns a robot, which sees no heading.
        heading_gain=1.5,
        # The last learning rates fall over as many iterations as on flat ground.
        settling_share=0.094,
    )
    return TaskCfg(env=env, agent=agent)


def _led_to_a_trot(quiet: Mapping[str, RewardTermCfg], foot_forces: bool = False) -> TaskCfg:
    """Return the recipe of `go1_mute_flat` with some terms to be quiet by.

    Args:
        quiet: The terms by name; they take the places of the paper's.
        foot_forces: Whether the forces on the feet are measured.
    """
    rewards = RewardsCfg(
        terms=paper_terms() | _following() | _stepping() | dict(quiet) | _upright(),
        following_time=0.2,
        following_acceleration=2.0,
        guide_ramp=(40.0, 60.0),
        lift_ramp=(48.0, 100.0),
        quiet_ramp=(80.0, 180.0),
    )
    # Slow commands, a single axis and stops are what people ask for indoors. Many follow each
    # other, as to turn back from full speed is what a robot falls by.
    commands = CommandsCfg(
        standing_fraction=0.15,
        slow_fraction=0.45,
        slow_share=0.25,
        single_axis_fraction=0.4,
        deadband=0.06,
        beta_end_fraction=0.4,
        resampling_time=2.0,
        initial_share=0.5,
        ramp=(8.0, 44.0),
    )
    randomization = RandomizationCfg(push_interval=4.0, push_velocity=0.5)
    agent = AgentCfg(
        iterations=750,
        # Without, the last iteration is one at random: each walks up to 0.15 m/s faster or slower.
        settling_share=0.3,
        actor_hidden=(128, 128, 64),
        critic_hidden=(128, 128, 64),
        symmetric=True,
        leading_side=True,
        go_signal=True,
        # With 1.0 the robot got about on the shaking of its legs, and the policy, which is the mean
        # action, did not walk; with 0.5 it did not leave the stance (seed 1, without the guide).
        init_std=0.8,
        ppo=PPOCfg(num_learning_epochs=4, desired_kl=0.016),
        estimation=EstimationCfg(robots_share=0.5, num_mini_batches=2),
    )
    env = QuadrupedEnvCfg(
        rewards=rewards,
        randomization=randomization,
        commands=commands,
        scene=SceneCfg(foot_forces=foot_forces),
    )
    return TaskCfg(env=env, agent=agent)


def _go1_dreamwaq() -> TaskCfg:
    """Return DreamWaQ on the same robot: its networks, rewards and ranges, and no quiet factor.

    Physics is MuJoCo's own on every device: Warp has no motor delays.

    Source: Nahrendra et al., ICRA 2023 (arXiv 2301.10602). Its gains, 28 and 0.7, are
    `env.scene.stiffness` and `damping`; its ground is `env.terrain.kind` rough.
    """
    # At first, changes of the action cost more than the robot earns. And a thousand robots that no
    # one guides stand: DreamWaQ's paper has four times as many.
    rewards = RewardsCfg(
        terms=_dreamwaq_terms() | {"diagonal_support": reward_term("diagonal_support", 0.7)},
        phase_source="true",
        never_negative=True,
        guide_ramp=(40.0, 60.0),
    )
    commands = CommandsCfg(
        lin_vel_y=(-1.0, 1.0), beta=(0.0, 0.0), initial_share=0.5, ramp=(8.0, 44.0)
    )
    randomization = RandomizationCfg(
        friction_factor=(0.25, 1.5625),  # 0.2 to 1.25 on a floor of 0.8
        added_mass=(-1.0, 2.0),
        com_offset=(-0.05, 0.05),
        gain_scale=(0.9, 1.1),
        motor_strength=(0.9, 1.1),
        action_delay=(0.0, 0.015),
    )
    network = EstimatorCfg(
        encoder="history",
        heights=False,
        phase=False,
        decodes_velocity=True,
        decoder_hidden=(64, 128),
    )
    agent = AgentCfg(
        iterations=750,
        actor_hidden=(512, 256, 128),
        critic_hidden=(512, 256, 128),
        quiet_factor=False,
        # With 1.0 it stays upright by the shaking of its legs, and learns nothing.
        init_std=0.6,
        estimation=EstimationCfg(network=network, adaptive_bootstrap=True),
    )
    return TaskCfg(
        env=QuadrupedEnvCfg(
            rewards=rewards, randomization=randomization, commands=commands, engine="mujoco"
        ),
        agent=agent,
    )


def _dreamwaq_terms() -> dict[str, RewardTermCfg]:
    """Return DreamWaQ's Table I: the paper's without phase and collision, and three of its own."""
    without = (*PAPERS_PHASE_TERMS, "collision")
    terms = {name: term for name, term in paper_terms().items() if name not in without}
    return terms | {
        "foot_clearance": reward_term("foot_clearance", -0.01, group="other"),
        "smoothness": reward_term("smoothness", -0.01),
        "power_distribution": reward_term("power_distribution", -1.0e-5),
    }


def _following() -> dict[str, RewardTermCfg]:
    """Return what a command earns beside the paper's terms: as much at 0.1 m/s as at 1."""
    return {
        "lin_vel_following": reward_term("lin_vel_following", 1.7, width=0.05, share=0.22),
        "ang_vel_following": reward_term("ang_vel_following", 0.8, width=0.15, share=0.25),
    }


def _stepping() -> dict[str, RewardTermCfg]:
    """Return what leads to steps that lift the feet, and holds them down in a stand."""
    return {
        # Robots that shuffle take long to find out that they could step.
        "diagonal_support": reward_term("diagonal_support", 0.7),
        # Walking costs more than following a slow command earns; steps must not be what it costs.
        "stepping": reward_term("stepping", 8.75, target=0.045),
        "foot_clearance": reward_term("foot_clearance", -20.0),
        "touchdown_apex": reward_term("touchdown_apex", -4.0, target=0.045),
        "foot_slip": reward_term("foot_slip", -0.3),
        "stand_still": reward_term("stand_still", -0.15),
        "feet_lifted": reward_term("feet_lifted", -0.5),
    }


def _quiet() -> dict[str, RewardTermCfg]:
    """Return what beta scales, the paper's terms and soft steps, and what it need not wait for."""
    return {
        "foot_drop_velocity": reward_term("foot_drop_velocity", -0.057),
        "foot_raise_velocity": reward_term("foot_raise_velocity", 0.0114),
        "near_ground_drop": reward_term("near_ground_drop", -1.71),
        "landing_speed": reward_term("landing_speed", -4.3),
        # Penalties alone are cut by landing seldom: strides get longer, not softer.
        "soft_steps": reward_term("soft_steps", 27.0, speed=0.6, target=0.045),
        # Robots that have not heard of beta yet land at more than 2 m/s, and take most of a
        # training to leave that off.
        "stamping": reward_term("stamping", -1.0, above=0.6),
    }


def _quiet_by(*terms: RewardTermCfg, foot_forces: bool = False) -> Callable[[], TaskCfg]:
    """Return the recipe of `go1_mute_flat`, quiet by what others have used, not its own terms.

    What beta and its ramp scale is that alone, beside the term against stamping, without which few
    trainings walk; the paper's phase terms are left out.

    Args:
        terms: What beta scales.
        foot_forces: Whether the forces on the feet are measured.
    """

    def make() -> TaskCfg:
        own = {term.function: copy.deepcopy(term) for term in terms}
        papers = {name: reward_term(name, 0.0) for name in PAPERS_PHASE_TERMS}
        stamping = {"stamping": _quiet()["stamping"]}
        return _led_to_a_trot(papers | stamping | own, foot_forces)

    return make


def _upright() -> dict[str, RewardTermCfg]:
    """Return what a robot keeps its feet under itself for."""
    return {
        # A high beta that turns on the spot would rather pivot on its feet than lift them, and
        # lean until it topples; but a first step is not taken level.
        "tilt": reward_term("orientation", -6.0, group="lift"),
        "fall": reward_term("fall", -800.0),
    }


# Weights are ours: each makes a landing at 0.5 m/s cost 5 for each unit of beta on a walk of the
# policy of `go1_mute_flat`, by `benchmarks.quiet_terms`.
_QUIET_TERM_TASKS: dict[str, Callable[[], TaskCfg]] = {
    "go1_quiet_phase": _quiet_by(
        reward_term("foot_drop_velocity", -4.8), reward_term("foot_raise_velocity", 0.96)
    ),
    "go1_quiet_landing_speed": _quiet_by(reward_term("landing_speed", -20.0)),
    "go1_quiet_landing_load": _quiet_by(reward_term("landing_load", -57.0), foot_forces=True),
    "go1_quiet_speed_change": _quiet_by(reward_term("foot_speed_change", -30.0)),
}

QUIET_TERM_TASKS = tuple(_QUIET_TERM_TASKS)
"""Names of the tasks of `go1_mute_flat`'s recipe with quiet terms of the literature."""

_TASKS: dict[str, Callable[[], TaskCfg]] = {
    DEFAULT_TASK: _go1_mute,
    FLAT_TASK: _go1_mute_flat,
    "go1_mute_paper": _go1_mute_paper,
    DREAMWAQ_TASK: _go1_dreamwaq,
    **_QUIET_TERM_TASKS,
}


def task_names() -> list[str]:
    """Return the names of all tasks."""
    return list(_TASKS)


def register_task(name: str, factory: Callable[[], TaskCfg]) -> None:
    """Make a task known by its name, under which it is learnt and its runs are kept.

    Args:
        name: Letters, digits, `_`, `-` and `.`, a letter first.
        factory: Returns a new configuration at each call.

    Raises:
        MuteError: If there is such a task already, the name is another, or the factory no function.
    """
    if not callable(factory):
        raise MuteError(f"the task {name!r} must be made by a function, got {factory!r}")
    if name in _TASKS:
        raise MuteError(f"the task {name!r} is registered already; give it another name")
    if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z][A-Za-z0-9_.-]*", name):
        raise MuteError(
            f"a task's name must be letters, digits, '_', '-' and '.', a letter first, got {name!r}"
        )
    _TASKS[name] = factory


def make_task(name: str) -> TaskCfg:
    """Return a new configuration of a task.

    What a factory has set since the configuration was made is checked, too.

    Raises:
        MuteError: If there is no such task, or its factory makes no configuration that can be.
    """
    if name not in _TASKS:
        raise MuteError(f"--task must be one of {', '.join(_TASKS)}, got {name!r}")
    try:
        cfg = _TASKS[name]()
        if not isinstance(cfg, TaskCfg):
            raise ValueError(f"its function must return a TaskCfg, got {cfg!r}")
        return _remade(cfg, "")
    except ValueError as error:
        raise MuteError(f"the task {name!r} cannot be made: {error}") from error


def _remade(cfg: Any, place: str) -> Any:  # noqa: ANN401
    """Return a copy of a dataclass, and of those within, that has gone through every check.

    Raises:
        ValueError: If a field is out of its range, or what was set is none.
    """
    names = [field.name for field in dataclasses.fields(cfg)]
    for name in vars(cfg):
        if name not in names:
            raise ValueError(f"{place}{name} was set, but there is no such field")
    values = {name: getattr(cfg, name) for name in names}
    parts = {
        name: _remade(value, f"{place}{name}.")
        if dataclasses.is_dataclass(value)
        else copy.deepcopy(value)
        for name, value in values.items()
    }
    return dataclasses.replace(cfg, **parts)
