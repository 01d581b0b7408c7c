"""The page of the method tells the weights and the times that the task has."""

from __future__ import annotations

import re

import pytest
import torch
from places import REPOSITORY

from mute.envs.commands import CommandSampler
from mute.envs.rewards import paper_terms
from mute.evaluation.trials import evaluation_cfg
from mute.tasks import DEFAULT_TASK, FLAT_TASK, make_task

_PAGE = " ".join((REPOSITORY / "docs" / "method.md").read_text().split())
_CFG = make_task(FLAT_TASK)


def _weights_told() -> dict[str, float]:
    """Return the weights in the table of what the task adds, by term."""
    page = (REPOSITORY / "docs" / "method.md").read_text()
    table = page[page.index("| term | weight | why |") :].split("\n\n")[0]
    told: dict[str, float] = {}
    for row in table.splitlines()[2:]:
        terms, weights = row.split("|")[1:3]
        names = re.findall("`([a-z_]+)`", terms)
        told |= dict(zip(names, map(float, weights.split(",")), strict=True))
    return told


def test_the_table_has_every_weight_in_which_the_task_differs_from_the_paper():
    terms, paper = _CFG.env.rewards.terms, paper_terms()
    differing = {
        name: term.weight
        for name, term in terms.items()
        if name not in paper or term.weight != paper[name].weight
    }
    assert _weights_told() == differing


def test_a_term_that_the_page_scales_by_beta_is_in_the_phase_group():
    quiet = {name for name, term in _CFG.env.rewards.terms.items() if term.group == "phase"}
    sentence = _PAGE[: _PAGE.index(" are phase terms, scaled by beta")].split(" | ")[-1]
    assert set(re.findall("`([a-z_]+)`", sentence)) == quiet


def test_the_page_tells_the_parameters_of_the_terms_that_follow():
    terms = _CFG.env.rewards.terms
    forward, turn = terms["lin_vel_following"].params, terms["ang_vel_following"].params
    assert f"{forward['width']:g} m/s and {turn['width']:g} rad/s wide" in _PAGE
    assert f"shares of {forward['share']:g} and {turn['share']:g}" in _PAGE
    acceleration = f"{_CFG.env.rewards.following_acceleration:g}"
    assert f"with {acceleration} m/s² and {acceleration} rad/s²" in _PAGE
    assert f"a time constant of {_CFG.env.rewards.following_time:g} s" in _PAGE


def test_the_page_tells_the_parameters_of_the_terms_that_step():
    terms = _CFG.env.rewards.terms
    lifted = 100.0 * terms["stepping"].params["target"]
    assert terms["soft_steps"].params["target"] == terms["stepping"].params["target"]
    assert f"by how much of {lifted:g} cm it was lifted" in _PAGE
    assert f"exp(-(landing speed / {terms['soft_steps'].params['speed']:g} m/s)²)" in _PAGE
    assert f"faster than {terms['stamping'].params['above']:g} m/s" in _PAGE
    clearance = 100.0 * terms["foot_clearance"].params["target"]
    apex = 100.0 * terms["touchdown_apex"].params["target"]
    assert f"`foot_clearance` ({clearance:g} cm), `touchdown_apex` ({apex:g} cm)" in _PAGE


def test_the_page_tells_how_commands_are_drawn_and_robots_pushed():
    commands, robots = _CFG.env.commands, _CFG.env.randomization
    assert f"{100 * commands.slow_fraction:g} % of them are slow" in _PAGE
    assert f"{100 * commands.single_axis_fraction:g} % go along one axis" in _PAGE
    assert f"a new one comes every {commands.resampling_time:g} s" in _PAGE
    assert f"less than {commands.deadband:g} m/s is none" in _PAGE
    assert f"{100 * commands.standing_fraction:g} % are to stand" in _PAGE
    assert commands.beta_end_fraction == 0.4 and "Two fifths of the betas are 0 or 1" in _PAGE
    pushed = f"Every {robots.push_interval:g} s, with a new command, robots are pushed by up to "
    assert f"{pushed}{robots.push_velocity:g} m/s" in _PAGE
    assert robots.push_interval % commands.resampling_time == 0.0


@pytest.mark.parametrize(
    ("progress", "words", "share"), [(1.0, "a fifth", 0.2), (0.0, "three tenths", 0.3)]
)
def test_as_many_commands_are_to_stand_as_the_page_tells(progress, words, share):
    sampler = CommandSampler(
        _CFG.env.commands, 100_000, torch.Generator().manual_seed(0), torch.device("cpu")
    )
    sampler.resample(torch.ones(100_000, dtype=torch.bool), True, progress)
    assert words in _PAGE
    assert float(sampler.standing.float().mean()) == pytest.approx(share, abs=0.03)


def test_the_page_tells_when_learning_comes_to_rest():
    share = 100.0 * _CFG.agent.settling_share
    assert f"Over the last {share:g} % of the iterations the learning rates" in _PAGE


@pytest.mark.parametrize(
    "ramp", [_CFG.env.rewards.guide_ramp, _CFG.env.rewards.lift_ramp, _CFG.env.rewards.quiet_ramp]
)
def test_the_page_tells_when_terms_come_and_go(ramp):
    start, end = ramp
    assert f"from {start:g} s to {end:g} s" in _PAGE


def test_the_page_tells_when_commands_grow():
    start, end = _CFG.env.commands.ramp
    share = _CFG.env.commands.initial_share
    assert f"{share:.0%}".replace("%", " %") + f" of their ranges at {start:g} s" in _PAGE
    assert f"all of them at {end:g} s" in _PAGE


def test_the_page_tells_the_sizes_and_the_passes():
    hidden = "-".join(map(str, _CFG.agent.actor_hidden))
    ppo = _CFG.agent.ppo
    assert f"Networks are {hidden}; PPO makes {ppo.num_learning_epochs} passes" in _PAGE
    assert f"a KL divergence of {ppo.desired_kl:g} " in _PAGE
    assert f"starts with a deviation of {_CFG.agent.init_std:g}" in _PAGE


def _told_of(task: str) -> str:
    """Return the section of a task, in one line."""
    page = (REPOSITORY / "docs" / "method.md").read_text()
    start = page.index(f"\n## `{task}`\n")
    return " ".join(page[start : page.index("\n## ", start + 1)].split())


def test_the_page_tells_the_figures_of_the_recipe_indoors():
    cfg, told = make_task(DEFAULT_TASK), _told_of(DEFAULT_TASK)
    env, ground = cfg.env, cfg.env.terrain
    lowest, highest = ground.first_levels
    assert lowest == highest
    made = f"makes {ground.passed_share:.0%}".replace("%", " %")
    assert f"Levels begin at {lowest}; who gets {ground.crossed:g} m away, and {made} of" in told
    assert f"{ground.ahead_share:.0%} of the commands lead".replace("%", " %") in told
    differs = env.randomization.everything_share
    assert f"- {differs:.0%} of the robots differ in everything".replace("%", " %") in told
    assert f"Of what beta scales, {ground.quiet_share:.0%} is left".replace("%", " %") in told
    share = {5.0: "a fifth"}[1.0 / ground.turning_share]
    assert f"a velocity command lasts {ground.command_time:g} s and turns {share} as fast" in told
    assert f"as commands of {_CFG.env.commands.resampling_time:g} s cross nothing" in told
    ours, flat = env.rewards.terms.keys(), _CFG.env.rewards.terms.keys()
    assert flat - ours == {"tilt"} and "`lean` in place of `tilt`" in told
    assert ours - flat == {"lean", "progress", "yaw_drift"}
    for name in ("progress", "yaw_drift"):
        assert f"`{name}`, of weight {env.rewards.terms[name].weight:g}, " in told
    assert f"Physics steps are {1000.0 * env.scene.timestep:g} ms" in told
    softest, stiffest = env.randomization.floor_stiffness
    assert f"their stiffness is {softest:g} to {stiffest:g} of it" in told
    start, end = env.rewards.quiet_ramp
    assert f"What beta scales grows in from {start:g} s to {end:g} s" in told
    assert env.engine == "mujoco" and "MuJoCo's own physics on every device" in told
    bonus = cfg.agent.ppo.entropy_coef
    falls = f"falls from {bonus:g} to {bonus * cfg.agent.late_entropy_share:g}"
    first, last = cfg.agent.entropy_iterations
    assert f"The entropy bonus {falls} from iteration {first} to {last}." in told
    settling = f"{100.0 * cfg.agent.settling_share:g} % of {cfg.agent.iterations} iterations"
    assert f"fall over the last {settling}, which are as many as on flat ground" in told
    many = cfg.agent.settling_share * cfg.agent.iterations
    assert many == pytest.approx(_CFG.agent.settling_share * _CFG.agent.iterations, rel=0.01)


def test_whatever_measures_the_recipe_indoors_has_the_physics_steps_that_the_page_tells():
    measured = evaluation_cfg(make_task(DEFAULT_TASK).env, num_envs=1, seconds=1.0, seed=0)
    steps = f"{1000.0 * measured.scene.timestep:g} ms"
    assert f"Whatever measures the policy has steps of {steps}." in _told_of(DEFAULT_TASK)
