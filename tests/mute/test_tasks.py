"""The tasks that ship: the paper's is the paper's."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import pytest

from mute import tasks
from mute.config import TaskCfg
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.support.errors import MuteError
from mute.tasks import DEFAULT_TASK, FLAT_TASK, make_task, register_task, task_names

TABLE_I = {
    "lin_vel_tracking": 1.0,
    "ang_vel_tracking": 0.5,
    "foot_drop_velocity": -0.05,
    "foot_raise_velocity": 0.01,
    "lin_vel_z": -2.0,
    "ang_vel_xy": -0.05,
    "joint_power": -2.0e-5,
    "joint_acc": -2.5e-7,
    "action_rate": -0.01,
    "collision": -0.1,
    "base_height": -1.0,
    "orientation": -0.2,
}


def test_the_papers_task_has_table_is_weights_and_no_other_term():
    rewards = make_task("go1_mute_paper").env.rewards
    assert {name: term.weight for name, term in rewards.terms.items()} == TABLE_I
    assert all(name == term.function for name, term in rewards.terms.items())


def test_the_papers_task_has_its_constants_and_sizes():
    cfg = make_task("go1_mute_paper")
    assert cfg.env.num_envs == 4096
    assert cfg.agent.iterations == 6000
    assert cfg.agent.ppo.learning_rate == 1.0e-3
    assert cfg.agent.estimation.learning_rate == 1.0e-3
    assert not cfg.agent.estimation.actor_uses_phase
    assert cfg.env.rewards.k == 0.2
    assert cfg.env.rewards.quiet_ramp == (0.0, 0.0)
    assert cfg.env.rewards.phase_source == "estimated"


def test_the_default_task_is_sized_for_a_cpu():
    assert DEFAULT_TASK in task_names()
    assert make_task(DEFAULT_TASK).env.num_envs == 1024


def test_the_default_task_asks_for_more_lift_than_the_papers():
    # With Table I alone the feet rise less than a centimetre.
    rewards = make_task(DEFAULT_TASK).env.rewards
    assert rewards.terms.keys() & {"touchdown_apex", "foot_clearance"}


def test_the_recipe_indoors_is_the_flat_one_over_ground():
    flat, indoor = make_task(FLAT_TASK), make_task(DEFAULT_TASK)
    assert (flat.env.terrain.kind, indoor.env.terrain.kind) == ("flat", "indoor")
    ours, theirs = indoor.env.rewards.terms, flat.env.rewards.terms
    assert theirs.keys() - ours.keys() == {"tilt"}
    assert ours.keys() - theirs.keys() == {"lean", "progress", "yaw_drift"}
    for name in ours.keys() & theirs.keys():
        share = 1.4 if theirs[name].group == "phase" else 1.0
        weight = pytest.approx(share * theirs[name].weight)
        assert ours[name] == dataclasses.replace(theirs[name], weight=weight)
    assert (ours["lean"].weight, ours["lean"].group) == (theirs["tilt"].weight, "lift")
    rewards = {"terms": theirs, "quiet_ramp": flat.env.rewards.quiet_ramp}
    assert dataclasses.replace(indoor.env.rewards, **rewards) == flat.env.rewards
    assert indoor.env.commands == flat.env.commands
    differs = ("floor_stiffness", "everything_share")
    robots = {name: getattr(flat.env.randomization, name) for name in differs}
    assert dataclasses.replace(indoor.env.randomization, **robots) == flat.env.randomization
    other = (
        "iterations",
        "settling_share",
        "late_entropy_share",
        "entropy_iterations",
        "heading_gain",
    )
    agent = {name: getattr(flat.agent, name) for name in other}
    assert dataclasses.replace(indoor.agent, **agent) == flat.agent


def test_the_recipe_indoors_has_the_figures_that_ground_takes():
    flat, indoor = make_task(FLAT_TASK), make_task(DEFAULT_TASK)
    env = indoor.env
    assert env.rewards.quiet_ramp == (300.0, 800.0)
    assert flat.env.rewards.quiet_ramp[1] < env.rewards.quiet_ramp[0]  # ground is learnt aloud
    assert (env.scene.timestep, env.decimation) == (0.01, 2)
    assert env.step_dt == flat.env.step_dt
    # In longer steps of physics no floor is stiffer than the scene's.
    assert env.randomization.floor_stiffness == (0.5, 1.0)
    assert env.scene.floor_solref[0] == 2.0 * env.scene.timestep
    assert env.engine == "mujoco"
    ground = env.terrain
    assert (ground.first_levels, ground.crossed, ground.curriculum) == ((0, 0), 3.0, True)
    assert (ground.command_time, ground.turning_share) == (10.0, 0.2)
    assert ground.passed_share < 0.8  # what `evaluate.py terrain` asks for
    first, last = indoor.agent.entropy_iterations  # when steps are found, before quiet grows in
    seconds = indoor.agent.num_steps_per_env * env.step_dt
    assert first < last and last * seconds < env.rewards.quiet_ramp[0]
    falling = [task.agent.settling_share * task.agent.iterations for task in (flat, indoor)]
    assert indoor.agent.iterations > flat.agent.iterations
    assert falling[1] == pytest.approx(falling[0], rel=0.01)


@pytest.mark.parametrize("task", task_names())
def test_each_call_makes_a_configuration_of_its_own(task):
    make_task(task).env.rewards.terms["lin_vel_tracking"].weight = 99.0
    make_task(task).agent.ppo.gamma = 0.5
    assert make_task(task).env.rewards.terms["lin_vel_tracking"].weight != 99.0
    assert make_task(task).agent.ppo.gamma != 0.5


def test_an_unknown_task_is_refused_with_the_names_there_are():
    with pytest.raises(MuteError) as caught:
        make_task("go2")
    assert all(name in str(caught.value) for name in [*task_names(), "'go2'"])


@pytest.fixture
def _registry(monkeypatch):
    """Let a test register what no other one sees."""
    monkeypatch.setattr(tasks, "_TASKS", dict(tasks._TASKS))


@pytest.mark.usefixtures("_registry")
def test_a_registered_task_is_made_by_its_factory_at_each_call():
    register_task("soft-walk.2", TaskCfg)
    assert task_names()[-1] == "soft-walk.2"
    one, other = make_task("soft-walk.2"), make_task("soft-walk.2")
    assert one == other == TaskCfg()
    assert one is not other


@pytest.mark.usefixtures("_registry")
def test_a_task_is_registered_but_once():
    with pytest.raises(MuteError, match="'go1_mute' is registered already"):
        register_task("go1_mute", TaskCfg)
    assert make_task("go1_mute") != TaskCfg()


@pytest.mark.usefixtures("_registry")
def test_a_task_that_no_function_makes_is_refused():
    with pytest.raises(MuteError, match="'walk' must be made by a function, got 3"):
        register_task("walk", 3)  # pyright: ignore[reportArgumentType]


def _changed(change: Callable[[TaskCfg], object]) -> Callable[[], TaskCfg]:
    def factory() -> TaskCfg:
        cfg = TaskCfg()
        change(cfg)
        return cfg

    return factory


@pytest.mark.parametrize(
    ("factory", "words"),
    [
        (lambda: None, ["TaskCfg", "None"]),
        (lambda: TaskCfg(env=QuadrupedEnvCfg(num_envs=0)), ["env.num_envs", ">= 1"]),
        (
            _changed(lambda cfg: setattr(cfg.env.commands, "lin_vel_x", (math.inf, 1.0))),
            ["env.commands.lin_vel_x", "inf"],
        ),
        (
            _changed(lambda cfg: setattr(cfg.env.rewards.terms["base_height"], "weight", math.nan)),
            ["env.rewards.terms.base_height.weight", "nan"],
        ),
        (_changed(lambda cfg: setattr(cfg.env, "num_env", 4)), ["env.num_env", "no such field"]),
    ],
)
@pytest.mark.usefixtures("_registry")
def test_what_a_function_makes_is_checked_and_refused_in_one_line(factory, words):
    register_task("walk", factory)
    with pytest.raises(MuteError) as caught:
        make_task("walk")
    message = str(caught.value)
    assert "\n" not in message
    assert all(word in message for word in ["'walk'", *words]), message


@pytest.mark.usefixtures("_registry")
def test_a_function_that_returns_one_configuration_again_and_again_does_not_share_it():
    shared = TaskCfg()
    register_task("walk", lambda: shared)
    make_task("walk").env.rewards.terms["base_height"].weight = 99.0
    assert make_task("walk") == TaskCfg()


@pytest.mark.parametrize("name", ["", "a:b", "../up", "a b", "2fast", "a/b", "--task", None])
@pytest.mark.usefixtures("_registry")
def test_a_name_that_could_be_no_directory_or_option_is_refused(name):
    with pytest.raises(MuteError, match="a task's name must be"):
        register_task(name, TaskCfg)
    assert name not in task_names()


QUIET = {
    "go1_quiet_phase": {"foot_drop_velocity", "foot_raise_velocity"},
    "go1_quiet_landing_speed": {"landing_speed"},
    "go1_quiet_landing_load": {"landing_load"},
    "go1_quiet_speed_change": {"foot_speed_change"},
}


@pytest.mark.parametrize("name", QUIET)
def test_a_quiet_term_of_the_literature_is_all_that_beta_scales(name):
    terms, recipe = (make_task(task).env.rewards.terms for task in (name, FLAT_TASK))
    scaled = {key for key, term in terms.items() if term.group == "phase" and term.weight != 0.0}
    assert scaled == QUIET[name]
    others = {key: term for key, term in terms.items() if term.group != "phase"}
    assert others == {key: term for key, term in recipe.items() if term.group != "phase"}


def test_a_reward_by_the_load_of_feet_needs_what_measures_it():
    env = make_task("go1_quiet_landing_load").env
    with pytest.raises(ValueError, match=r"foot_forces must be true for .*landing_load"):
        dataclasses.replace(env, scene=dataclasses.replace(env.scene, foot_forces=False))
