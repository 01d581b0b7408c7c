"""Every number of the environment has its range, which neither infinity nor NaN is in."""

from __future__ import annotations

import dataclasses
import math
import re
import typing

import pytest
from number_fields import number_fields

from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.reward_terms import REWARD_FUNCTIONS
from mute.envs.rewards import RewardsCfg, reward_term
from mute.envs.scene import FloorPatch, SceneCfg

CFG = QuadrupedEnvCfg(
    scene=SceneCfg(
        floor_patches=(FloorPatch((0.0, 0.0), (1.0, 1.0), 0.8, (0.02, 1.0)),),
        foot_forces=True,  # a term asks for it
    ),
    rewards=RewardsCfg(
        terms={name: reward_term(name, 1.0) for name in REWARD_FUNCTIONS}, guide_ramp=(0.0, 1.0)
    ),
)
NUMBERS = list(number_fields(CFG, "env"))


def _places(cls: type, place: str) -> set[str]:
    """Return the name of every field of a dataclass, and those within, that may hold numbers."""
    found = set()
    for name, hint in typing.get_type_hints(cls).items():
        if dataclasses.is_dataclass(hint):
            found |= _places(typing.cast(type, hint), f"{place}.{name}")
        elif re.search(r"\b(int|float)\b", str(hint)) or hint in (int, float):
            found.add(f"{place}.{name}")
    return found


def test_every_field_that_can_hold_numbers_is_walked():
    walked = {place for place, _ in NUMBERS}
    for place in _places(QuadrupedEnvCfg, "env"):
        assert any(each == place or each.startswith(f"{place}.") for each in walked), place
    assert {"env.scene.timestep", "env.scene.floor_patches.rgba", "env.commands.beta"} <= walked
    assert {"env.observations.noise.joint_vel", "env.rewards.guide_ramp"} <= walked
    for name, function in REWARD_FUNCTIONS.items():
        assert f"env.rewards.terms.{name}.weight" in walked
        assert {f"env.rewards.terms.{name}.params.{key}" for key in function.parameters} <= walked


@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan])
@pytest.mark.parametrize(
    ("place", "replace"), NUMBERS, ids=[f"{place}-{i}" for i, (place, _) in enumerate(NUMBERS)]
)
def test_infinity_and_nan_are_refused_in_one_line_with_the_fields_whole_name(place, replace, value):
    with pytest.raises(ValueError) as caught:
        replace(value)
    message = str(caught.value)
    assert re.match(rf"{re.escape(place)}(\[\d\])? must be ", message)
    assert str(value) in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("place", "replace"), NUMBERS, ids=[f"{place}-{i}" for i, (place, _) in enumerate(NUMBERS)]
)
def test_a_number_that_nothing_could_be_computed_with_is_refused(place, replace):
    for value in (10**40, -(10**40)):
        with pytest.raises(ValueError, match=re.escape(place)):
            replace(value)


@pytest.mark.parametrize(
    "name", ["num_envs", "seed", "num_threads", "decimation", "scene.iterations"]
)
def test_a_count_is_whole(name):
    (replace,) = (replace for place, replace in NUMBERS if place == f"env.{name}")
    with pytest.raises(ValueError, match=f"env.{name} must be an integer"):
        replace(2.5)
