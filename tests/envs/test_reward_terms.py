"""Tests of the reward functions against hand-computed cases, and of how more are registered."""

from __future__ import annotations

import math

import pytest
import torch
from motion_helpers import make_motion

from mute.envs import reward_terms
from mute.envs.motion import Motion
from mute.envs.reward_terms import REWARD_FUNCTIONS, Parameter, register_term
from mute.support.ranges import Range

# For each term: what two robots did, the rest being zero, and what the term makes of it.
CASES = {
    "lin_vel_tracking": (
        {"command": [[1.0], [0.0, 0.25]], "base_lin_vel": [[0.5, 0.0, 9.0], []]},
        [math.exp(-1.0), math.exp(-0.25)],
    ),
    "ang_vel_tracking": (
        {"command": [[0, 0, 0.5], [0, 0, -1.0]], "base_ang_vel": [[7.0], [0, 0, -1.0]]},
        [math.exp(-1.0), 1.0],
    ),
    # Nothing asked for and one width too fast; 0.6 and 0.8 m/s asked for, and standing.
    "lin_vel_following": (
        {"command": [[], [0.6, 0.8]], "velocity_error": [[-0.06, 0.0, 9.0], [0.6, 0.8]]},
        [math.exp(-1.0), math.exp(-1.0 / (0.06**2 + 0.35**2))],
    ),
    "ang_vel_following": (
        {"command": [[], [0, 0, -1.0]], "velocity_error": [[7.0, 7.0, 0.1], [0, 0, -0.5]]},
        [math.exp(-1.0), math.exp(-0.25 / (0.1**2 + 0.35**2))],
    ),
    "foot_drop_velocity": (
        {"phase": [[0.0, 1.0], [0, 0, 0, 0.5]], "foot_drop_sq": [[1.0, 2.0], [0, 0, 0, 3.0]]},
        [1.0 + 2.0 * math.e, 3.0 * math.exp(0.5)],
    ),
    "foot_raise_velocity": (
        {"phase": [[0.0, 1.0], [0, 0, 0, 0.5]], "foot_raise_sq": [[1.0, 2.0], [0, 0, 0, 3.0]]},
        [1.0 + 2.0 / math.e, 3.0 * math.exp(-0.5)],
    ),
    "near_ground_drop": (
        {"foot_height": [[0.0, 0.02], [-0.01]], "foot_drop_sq": [[1.0, 1.0], [2.0]]},
        [1.0 + math.exp(-1.0), 2.0],
    ),
    "landing_speed": ({"landing_speed": [[0.3, 0.4], [0, 0, 0, 2.0]]}, [0.25, 4.0]),
    # Changes of 0.1 and then -0.4, of which 0.3 counts; and of one foot 0.2 at once.
    "foot_speed_change": (
        {"foot_vel_z_substeps": [[[-0.2], []], [[-0.1], [0, 0, 0, 0.2]], [[-0.5], [0, 0, 0, 0.2]]]},
        [(0.1**2 + 0.3**2) / 2, 0.2**2 / 2],
    ),
    # In the air, found to have landed, standing, in the air; standing, but for one in the air.
    "landing_load": (
        {
            "foot_load": [[0.5, 1.2, 3.0, 0.0], [1.0, 1.0, 1.0, 0.4]],
            "contact": [[0, 1, 1, 0], [1, 1, 1, 0]],
            "touchdown": [[0, 1, 0, 0], []],
        },
        [0.5**2, 0.4**2],
    ),
    "progress": (
        {"command": [[0.3, 0.4], [0.5]], "velocity_error": [[0.3, 0.0], [1.2, 0.3]]},
        [1.0 - 0.09 / 0.25, -1.0],  # what is missing along it; backwards, but no more than once
    ),
    "yaw_drift": ({"yaw_drift": [-0.1, 0.5]}, [0.1, 0.3]),
    "lin_vel_z": ({"base_lin_vel": [[9.0, 9.0, -0.5], [0, 0, 2.0]]}, [0.25, 4.0]),
    "ang_vel_xy": ({"base_ang_vel": [[3.0, -4.0, 100.0], [0.0, 1.0]]}, [25.0, 1.0]),
    "joint_power": (
        {"torque": [[2.0, 1.0], [5.0]], "joint_vel": [[-3.0, 4.0], [0.0, 5.0]]},
        [10.0, 0.0],
    ),
    "joint_acc": ({"joint_acc": [[3.0, -4.0], [0.0, 2.0]]}, [25.0, 4.0]),
    "action_rate": (
        {"action": [[1.0, 0.0, 1.0], []], "last_action": [[-1.0, 0.0, 3.0], [0.5]]},
        [8.0, 0.25],
    ),
    "collision": ({"collisions": [0.0, 3.0]}, [0.0, 3.0]),
    "base_height": ({"base_height": [0.2, 0.35]}, [0.01, 0.0025]),
    "orientation": ({"projected_gravity": [[0.3, -0.4, -0.86], [0, 0, -1.0]]}, [0.25, 0.0]),
    "lean": (
        {
            "projected_gravity": [[0.3, -0.4, -0.86], [-0.6, 0.0, -0.8]],
            "ground_slope": [[0.0, 0.0], [0.75, 0.0]],
        },
        [0.25, 0.0],  # on the level as `orientation`; along a slope of 3 to 4
    ),
    "smoothness": (
        {
            "action": [[1.0], [2.0]],
            "last_action": [[0.0], [1.0]],
            "action_before_last": [[1.0], [0.0]],
        },
        [4.0, 0.0],  # there and back again; a steady ramp
    ),
    # Powers 12, 0, 0, ...: mean 1, mean square 12. Powers 6, -6, 0, ...: mean 0, mean square 6.
    "power_distribution": (
        {"torque": [[4.0], [2.0, -2.0]], "joint_vel": [[3.0], [3.0, 3.0]]},
        [11.0, 6.0],
    ),
    "foot_clearance": (
        {"foot_lift": [[0.04] * 4, [0.06] * 4], "foot_speed_xy": [[2.0], [2.0]]},
        [0.0008, 0.0],
    ),
    "touchdown_apex": (
        {
            "command": [[0.0, 0.0, 0.1], [0, 0, 0, 1.0]],
            "touchdown": [[1, 1, 1, 0], [1]],
            "swing_apex": [[0.02, 0.08, 0.01, 0.05], [0.01]],
        },
        # Half of the target, above it, a quarter of it, still in the air; a robot asked to stand.
        [0.5 + 0.0 + 0.75, 0.0],
    ),
    "foot_slip": (
        {"contact": [[1], [1, 1]], "foot_speed_xy": [[2.0, 5.0], [1.0, 3.0]]},
        [4.0, 10.0],
    ),
    "stand_still": (
        {"command": [[0, 0, 0, 0.7], [0, 0.1]], "joint_pos": [[0.1, -0.2], [0.1, -0.2]]},
        [0.3, 0.0],
    ),
    "diagonal_support": (
        # FR and RL alone; FR, RL and RR; FL alone; all; FL and RR, but asked to stand.
        {
            "command": [[0.5], [0, 0.5], [0, 0, 0.5], [0.5], [0, 0, 0, 1.0]],
            "contact": [[1, 0, 0, 1], [1, 0, 1, 1], [0, 1, 0, 0], [1, 1, 1, 1], [0, 1, 1, 0]],
        },
        [1.0, 0.5, 0.5, 0.0, 0.0],
    ),
    "feet_lifted": (
        # All feet in the air; two of them, and none; two of them, but asked to move; one, still
        # moving.
        {
            "command": [[], [0, 0, 0, 1.0], [], [0, 0, 0.1], []],
            "contact": [[], [1, 0, 0, 1], [1, 1, 1, 1], [1, 0, 0, 1], [1, 0, 1, 1]],
            "base_lin_vel": [[0, 0, 9.0], [], [], [], [0.0, 0.2]],
        },
        [4.0, 2.0, 0.0, 0.0, math.exp(-1.0)],
    ),
    "stepping": (
        # A whole period and high enough; half of one; too long to earn more, and half as high;
        # still in the air. Asked to stand.
        {
            "command": [[0.0, 0.0, 0.1], [0, 0, 0, 1.0]],
            "stride_time": [[0.8, 0.4, 2.0, 0.0], [0.8]],
            "swing_apex": [[0.04, 0.06, 0.02, 0.05], [0.04]],
        },
        [0.8 + 0.4 + 0.4, 0.0],
    ),
    "soft_steps": (
        # As softly as can be; at the speed that leaves 1/e, too long, and half as high; in the air.
        # Asked to stand.
        {
            "command": [[0.0, 0.0, 0.1], [0, 0, 0, 1.0]],
            "stride_time": [[0.4, 2.0, 0.0], [0.8]],
            "landing_speed": [[0.0, 0.4, 0.0], [0.1]],
            "swing_apex": [[0.04, 0.02, 0.05], [0.04]],
        },
        [0.4 + 0.4 * math.exp(-1.0), 0.0],
    ),
    "stamping": ({"landing_speed": [[0.7, 1.1, 0.5], [0.6]]}, [0.01 + 0.25, 0.0]),
    "fall": ({"fallen": [False, True]}, [0.0, 1.0]),
}


POSITIVE = Range(0.0, above=True)


def _value(name, motion, **params):
    function = REWARD_FUNCTIONS[name]
    defaults = {key: parameter.default for key, parameter in function.parameters.items()}
    return function.with_parameters(defaults | params)(motion)


@pytest.mark.parametrize("name", REWARD_FUNCTIONS)
def test_a_function_gives_what_was_computed_by_hand(name):
    given, expected = CASES[name]
    torch.testing.assert_close(_value(name, make_motion(**given)), torch.tensor(expected))


@pytest.mark.parametrize(
    ("name", "params", "expected"),
    [
        ("lin_vel_tracking", {"sharpness": 2.0}, math.exp(-2.0)),
        ("ang_vel_tracking", {"sharpness": 8.0}, math.exp(-2.0)),
        ("lin_vel_following", {"width": 0.5, "share": 1.0}, math.exp(-1.0 / 1.25)),
        ("ang_vel_following", {"width": 1.0, "share": 2.0}, math.exp(-0.25 / 2.0)),
        ("near_ground_drop", {"depth": 0.05}, 3.0 * math.exp(-2.0)),
        ("base_height", {"desired": 0.5}, 0.25),
        ("foot_clearance", {"target": 0.2}, 0.01 + 3 * 0.04 * 0.0),
        ("touchdown_apex", {"target": 0.1}, 0.4),
        ("stamping", {"above": 0.1}, 0.01),
        ("yaw_drift", {"most": 0.2}, 0.2),
        ("stepping", {"period": 0.3}, 0.3),
        ("stepping", {"target": 0.12}, 0.25),
        ("soft_steps", {"speed": 0.2}, 0.5 * math.exp(-1.0)),
        ("soft_steps", {"period": 0.3}, 0.3 * math.exp(-0.25)),
        ("soft_steps", {"target": 0.12}, 0.25 * math.exp(-0.25)),
    ],
)
def test_a_parameter_changes_its_function(name, params, expected):
    motion = make_motion(
        command=[[1.0, 0.0, 0.5], []],
        velocity_error=[[1.0, 0.0, 0.5], []],
        yaw_drift=[0.25, 0.0],
        touchdown=[[1], []],
        swing_apex=[[0.06], []],
        stride_time=[[0.5], []],
        landing_speed=[[0.2], []],
        foot_height=[[0.1], []],
        foot_lift=[[0.1], []],
        foot_drop_sq=[[3.0], []],
        foot_speed_xy=[[1.0], []],
    )
    assert _value(name, motion, **params)[0].item() == pytest.approx(expected)


def test_the_speed_up_to_which_lifted_feet_count_is_a_parameter():
    motion = make_motion(base_lin_vel=[[0.3, -0.4], []])
    values = _value("feet_lifted", motion, speed=0.5).tolist()
    assert values == pytest.approx([4.0 * math.exp(-1.0), 4.0])


def test_every_parameter_of_every_function_was_tried():
    tried = {("lin_vel_tracking", "sharpness"), ("ang_vel_tracking", "sharpness")}
    following = ("lin_vel_following", "ang_vel_following")
    tried |= {(name, key) for name in following for key in ("width", "share")}
    tried |= {("near_ground_drop", "depth"), ("base_height", "desired")}
    tried |= {("foot_clearance", "target"), ("touchdown_apex", "target")}
    tried |= {("stepping", "period"), ("stepping", "target"), ("feet_lifted", "speed")}
    tried |= {("yaw_drift", "most"), ("stamping", "above"), ("foot_speed_change", "most")}
    tried |= {("soft_steps", key) for key in ("speed", "period", "target")}
    assert tried == {
        (name, key) for name, function in REWARD_FUNCTIONS.items() for key in function.parameters
    }


@pytest.fixture
def _registry(monkeypatch):
    """Let a test register what no other one sees."""
    monkeypatch.setattr(reward_terms, "_functions", dict(reward_terms._functions))


@pytest.mark.usefixtures("_registry")
def test_a_registered_function_is_known_with_its_group_and_its_parameters():
    @register_term("lift", scale=Parameter(2.0, "scale, m", POSITIVE))
    def spread(motion: Motion, scale: float) -> torch.Tensor:
        """Penalise feet
        that spread.
        """
        return motion.joint_pos[:, 0] / scale

    known = reward_terms._functions["spread"]
    assert (known.group, dict(known.parameters)) == (
        "lift",
        {"scale": Parameter(2.0, "scale, m", POSITIVE)},
    )
    assert known.text == "Penalise feet that spread."
    motion = make_motion(joint_pos=[[3.0], [4.0]])
    assert known.with_parameters({"scale": 2.0})(motion).tolist() == [1.5, 2.0]


def _stranger(motion: Motion, scale: float) -> torch.Tensor:
    return motion.base_height * scale


def _lonely() -> float:
    return 1.0


def _collecting(motion: Motion, *scale: float) -> torch.Tensor:
    return motion.base_height * scale[0]


def _heavy(motion: Motion, weight: float) -> torch.Tensor:
    return motion.base_height * weight


def _fall() -> object:
    def fall(motion: Motion) -> torch.Tensor:
        return motion.base_height

    return fall


@pytest.mark.parametrize(
    ("function", "group", "parameters", "words"),
    [
        (_fall(), "other", {}, ["'fall'", "already"]),
        (lambda motion: motion.base_height, "other", {}, ["<lambda>", "name"]),
        (_stranger, "loud", {"scale": Parameter(1.0, "")}, ["group", "'loud'", "guide"]),
        (3, "other", {}, ["'int'", "no function"]),
        (lambda: 1.0, "other", {}, ["<lambda>"]),
        (_lonely, "other", {}, ["_lonely", "the motion"]),
        (_collecting, "other", {"scale": Parameter(1.0, "")}, ["_collecting", "by name"]),
        (_stranger, "other", {"scale": 1.0}, ["_stranger.scale", "Parameter", "1.0"]),
        (_stranger, "other", {"scale": Parameter(math.nan, "")}, ["_stranger.scale", "nan"]),
        (_heavy, "other", {"weight": Parameter(1.0, "")}, ["_heavy.weight", "another name"]),
        (_stranger, "other", {}, ["_stranger", "scale", "[]"]),
        (
            _stranger,
            "other",
            {"scale": Parameter(0.0, "", POSITIVE)},
            ["_stranger.scale", "> 0"],
        ),
    ],
    ids=[
        *("taken", "nameless", "group", "number", "lambda", "without motion", "collecting"),
        *("no parameter", "nan", "reserved", "signature", "default"),
    ],
)
@pytest.mark.usefixtures("_registry")
def test_what_cannot_be_registered_is_refused_in_one_line(function, group, parameters, words):
    before = dict(reward_terms._functions)
    with pytest.raises(ValueError) as caught:
        register_term(group, **parameters)(function)
    message = str(caught.value)
    assert "\n" not in message
    assert all(word in message for word in words), message
    assert reward_terms._functions == before


def test_a_parameter_may_be_any_finite_number_unless_it_has_a_range():
    parameter = Parameter(1.0, "weight")
    assert all(map(parameter.allowed.holds, (-1.0e9, 0.0, 1.0e9)))
    assert not any(map(parameter.allowed.holds, (math.nan, math.inf, -math.inf)))
