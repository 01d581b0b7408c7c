"""The terms of a reward as options: its weight and parameters each, with what the function says.

Every function that is registered is on offer, with weight 0 where the task does not use it.
"""

from __future__ import annotations

import dataclasses

import tyro

from mute.config_versions import earlier_terms
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.reward_terms import REWARD_FUNCTIONS
from mute.envs.rewards import RewardTermCfg, reward_term

__all__ = ["TERM_OPTIONS", "with_terms_offered", "without_unused_terms"]

TERM_OPTIONS = tyro.constructors.ConstructorRegistry()
"""How tyro is to take a term; to be entered while it parses."""


@TERM_OPTIONS.struct_rule
def _options_of_a_term(
    info: tyro.constructors.StructTypeInfo,
) -> tyro.constructors.StructConstructorSpec | None:
    term = info.default
    if not isinstance(term, RewardTermCfg):
        return None

    def changed(weight: float, **params: float) -> RewardTermCfg:
        given = {name.removeprefix("params."): value for name, value in params.items()}
        return dataclasses.replace(term, weight=weight, params=given)

    function = REWARD_FUNCTIONS[term.function]
    field = tyro.constructors.StructFieldSpec
    weight = field("weight", float, term.weight, f"{function.text} Group: {term.group}.")
    params = [
        field(f"params.{name}", float, term.params[name], f"The {parameter.text}.")
        for name, parameter in function.parameters.items()
    ]
    return tyro.constructors.StructConstructorSpec(changed, (weight, *params))


def with_terms_offered(cfg: QuadrupedEnvCfg) -> QuadrupedEnvCfg:
    """Return an environment whose reward lists, with weight 0, all terms that it could have."""
    terms = dict(cfg.rewards.terms)
    for name in (*earlier_terms(), *REWARD_FUNCTIONS):
        if name not in terms:
            term = earlier_terms().get(name) or reward_term(name, 0.0)
            terms[name] = dataclasses.replace(term, weight=0.0)
    return _with_terms(cfg, terms)


def without_unused_terms(cfg: QuadrupedEnvCfg, listed: QuadrupedEnvCfg) -> QuadrupedEnvCfg:
    """Return the environment without the terms of weight 0 that another one does not list."""
    known = listed.rewards.terms
    terms = cfg.rewards.terms.items()
    return _with_terms(cfg, {name: t for name, t in terms if t.weight != 0.0 or name in known})


def _with_terms(cfg: QuadrupedEnvCfg, terms: dict[str, RewardTermCfg]) -> QuadrupedEnvCfg:
    return dataclasses.replace(cfg, rewards=dataclasses.replace(cfg.rewards, terms=terms))
