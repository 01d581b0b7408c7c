"""The page of the method tells the weights and the times that the task has."""

from __future__ import annotations

import re

import pytest
from places import REPOSITORY

from mute.envs.rewards import paper_terms
from mute.tasks import make_task

_PAGE = " ".join((REPOSITORY / "docs" / "method.md").read_text().split())
_CFG = make_task("go1_mute")


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
    quiet = [name for name, term in _CFG.env.rewards.terms.items() if term.group == "phase"]
    assert sorted(quiet) == sorted(list(_weights_told())[:4])
    assert "The first four are phase terms" in _PAGE


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
