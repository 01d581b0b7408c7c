"""Tests of footfalls against constructed sequences at the physics rate, 5 ms."""

from __future__ import annotations

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from mute.envs.footfall import FootfallCfg, Footfalls

DECIMATION = 4
AIR, GROUND = "....", "####"
"""One control step without and with contact, a character a physics step."""


def _make_footfalls(num_envs=2, **given):
    footfalls = Footfalls(FootfallCfg(**given), num_envs, timestep=0.005, decimation=DECIMATION)
    everywhere = torch.ones(num_envs, dtype=torch.bool)
    footfalls.reset(everywhere, torch.zeros(num_envs, 4))
    return footfalls


def _play(footfalls, found, vel_z=None, clearance=None, foot=(0, 0), ground=None):
    """Play physics steps to one foot; all others hang still. Return what each control step gave.

    Args:
        footfalls: Consumes the steps.
        found: `#` where there is contact, a character a physics step.
        vel_z: Vertical velocity at each physics step, m/s.
        clearance: Height of the foot at each control step, m.
        foot: Index of the foot.
        ground: Height of the ground near it at each control step, m; 0 unless given.
    """
    num_envs = footfalls.contact.shape[0]
    vel_z = vel_z or [0.0] * len(found)
    clearance = clearance or [0.0] * (len(found) // DECIMATION)
    assert len(found) == len(vel_z) == len(clearance) * DECIMATION
    results = []
    for i, height in enumerate(clearance):
        vel, contacts = torch.zeros(2, DECIMATION, num_envs, 4)
        for j in range(DECIMATION):
            row = i * DECIMATION + j
            vel[j][foot], contacts[j][foot] = vel_z[row], 2.0 * (found[row] == "#")
        footfalls.record(vel, contacts)
        heights = torch.zeros(num_envs, 4)
        heights[foot] = height
        near = torch.zeros(num_envs, 4)
        near[foot] = ground[i] if ground else 0.0
        footfalls.update(heights, near)
        names = ("touchdown", "landing_speed", "stride_time", "swing_apex")
        names += ("contact", "contact_share")
        results.append({name: getattr(footfalls, name)[foot].item() for name in names})
    return results


def _landing_speeds(results):
    return [step["landing_speed"] for step in results if step["touchdown"]]


_TOUCHDOWN = st.integers(0, DECIMATION - 1).map(lambda air: "." * air + "#" * (DECIMATION - air))
_STRIDE = st.tuples(st.sampled_from([AIR, AIR + AIR]), _TOUCHDOWN, st.sampled_from(["", GROUND]))
_BRIEF = st.sampled_from([AIR, "#...", ".#.#"])  # none, or one too short to be a landing


@given(
    st.lists(_STRIDE.map("".join), min_size=2, max_size=5),
    st.lists(_BRIEF, max_size=3).map("".join),
    st.randoms(use_true_random=False),
)
def test_a_landing_speed_is_the_fastest_drop_of_the_20_ms_that_end_with_contact(
    strides, opening, random
):
    # Two control steps of contact end each stride, so that it is a landing.
    found = opening + "".join(stride + GROUND + AIR for stride in strides)
    vel_z = [random.uniform(-2.0, 2.0) for _ in found]
    results = _play(_make_footfalls(), found, vel_z)
    landings = [i for i, step in enumerate(results) if step["touchdown"]]
    assert len(landings) >= len(strides) - 1
    for i, step in enumerate(results):
        expected = 0.0
        if step["touchdown"]:
            # Confirmed by the second control step of contact: the first opened with it.
            first = found.index("#", (i - 1) * DECIMATION)
            expected = max(0.0, *(-vel for vel in vel_z[max(0, first - 3) : first + 1]))
        assert step["landing_speed"] == pytest.approx(expected)


def test_a_peak_between_the_50_hz_samples_is_the_landing_speed():
    vel_z = [0.0] * 4 + [-0.1, -0.9, -0.2, -0.1] + [0.0] * 4
    results = _play(_make_footfalls(), AIR + "...#" + GROUND, vel_z)
    assert max(-vel for vel in vel_z[3::4]) == pytest.approx(0.1)
    assert _landing_speeds(results) == pytest.approx([0.9])


@pytest.mark.parametrize("first", range(8, 12))
def test_the_window_is_the_20_ms_that_end_with_the_first_contact(first):
    # Downward speeds that grow into the past: the largest in the window is its oldest.
    vel_z = [-(2.0 - 0.1 * j) for j in range(20)]
    found = "." * first + "#" * (20 - first)
    results = _play(_make_footfalls(), found, vel_z)
    assert _landing_speeds(results) == pytest.approx([2.0 - 0.1 * (first - 3)])


def test_what_is_fast_after_contact_is_no_landing_speed():
    vel_z = [-0.3] * 9 + [-5.0] * 7
    results = _play(_make_footfalls(), AIR + AIR + GROUND + GROUND, vel_z)
    assert _landing_speeds(results) == pytest.approx([0.3])


def test_a_longer_window_looks_further_back():
    vel_z = [0.0] * 4 + [-3.0] + [-0.5] * 11
    results = _play(_make_footfalls(landing_window=0.025), AIR + AIR + GROUND + GROUND, vel_z)
    assert _landing_speeds(results) == pytest.approx([3.0])


def test_a_foot_that_is_met_while_it_rises_lands_at_zero():
    results = _play(_make_footfalls(), AIR + GROUND + GROUND, [1.0] * 12)
    assert _landing_speeds(results) == [0.0]


def test_there_is_a_landing_speed_only_where_a_foot_lands():
    results = _play(_make_footfalls(), AIR + AIR + GROUND + GROUND + GROUND, [-1.0] * 20)
    assert [step["landing_speed"] for step in results] == [0.0, 0.0, 0.0, 1.0, 0.0]
    assert [step["touchdown"] for step in results] == [False, False, False, True, False]


def test_each_foot_of_each_robot_lands_for_itself():
    footfalls = _make_footfalls()
    _play(footfalls, AIR + GROUND + GROUND, [-1.0] * 12, foot=(1, 2))
    expected = torch.zeros(2, 4)
    expected[1, 2] = 1.0
    assert torch.equal(footfalls.landing_speed, expected)
    assert torch.equal(footfalls.touchdown, expected.bool())


def test_a_bounce_shorter_than_40_ms_is_no_second_landing():
    vel_z = [-1.0] * 8 + [0.0] * 8 + [-0.2] * 4 + [0.0] * 8
    results = _play(_make_footfalls(), AIR * 2 + GROUND * 2 + AIR + GROUND * 2, vel_z)
    assert _landing_speeds(results) == pytest.approx([1.0])
    assert all(step["contact"] for step in results[3:])


def test_a_bounce_of_40_ms_is_a_second_landing():
    vel_z = [-1.0] * 8 + [0.0] * 8 + [-0.2] * 8 + [0.0] * 8
    found = AIR * 2 + GROUND * 2 + AIR * 2 + GROUND * 2
    assert _landing_speeds(_play(_make_footfalls(), found, vel_z)) == pytest.approx([1.0, 0.2])


def test_chatter_within_a_control_step_is_contact():
    results = _play(_make_footfalls(), AIR + ".#.#" + "#.#." + "..#.", [-1.0] * 16)
    assert [step["touchdown"] for step in results] == [False, False, True, False]


def test_a_foot_that_begins_in_contact_has_not_landed():
    footfalls = _make_footfalls()
    footfalls.reset(torch.tensor([True, True]), torch.ones(2, 4))
    results = _play(footfalls, GROUND * 3, [-1.0] * 12)
    assert not any(step["touchdown"] for step in results)


def test_the_apex_is_the_highest_clearance_of_the_swing_and_stays_in_stance():
    footfalls = _make_footfalls()
    first = [0.0, 0.0, 0.01, 0.03, 0.05, 0.02, 0.0, 0.0, 0.0]
    results = _play(footfalls, GROUND * 2 + AIR * 4 + GROUND * 3, clearance=first)
    assert [step["touchdown"] for step in results].index(True, 2) == 7
    assert [step["swing_apex"] for step in results[6:]] == pytest.approx([0.05] * 3)


def test_a_stride_lasts_from_a_landing_to_the_next():
    found = GROUND * 2 + AIR * 3 + GROUND * 5 + AIR * 4 + GROUND * 3
    results = _play(_make_footfalls(), found)
    strides = [step["stride_time"] for step in results if step["touchdown"]]
    # Before the first landing, the stance is the one that the foot began in.
    assert strides[-1] == pytest.approx((5 + 4) * 0.02)
    assert all(step["stride_time"] == 0.0 for step in results if not step["touchdown"])


def test_every_swing_has_its_own_apex():
    footfalls = _make_footfalls()
    _play(footfalls, GROUND * 2 + AIR * 2 + GROUND * 2, clearance=[0, 0, 0.02, 0.09, 0, 0])
    results = _play(footfalls, AIR * 3 + GROUND * 2, clearance=[0.01, 0.02, 0.03, 0, 0])
    assert results[0]["swing_apex"] == pytest.approx(0.09)
    assert results[-1]["swing_apex"] == pytest.approx(0.03)


def test_the_duty_share_counts_physics_steps():
    results = _play(_make_footfalls(), "###.#...")
    assert [step["contact_share"] for step in results] == [0.75, 0.25]


def test_squared_speeds_are_means_over_the_physics_steps_by_direction():
    footfalls = _make_footfalls()
    _play(footfalls, AIR, [-1.0, 1.0, -2.0, 0.0], foot=(1, 3))
    assert footfalls.drop_sq[1, 3].item() == pytest.approx(1.25)
    assert footfalls.raise_sq[1, 3].item() == pytest.approx(0.25)
    assert footfalls.drop_sq.sum().item() == pytest.approx(1.25)


def test_a_reset_forgets_the_masked_robot_alone():
    footfalls = _make_footfalls()
    vel_z = [-1.0] * 12
    _play(footfalls, AIR + AIR + "...#", vel_z, foot=(0, 0))
    _play(footfalls, AIR + AIR + "...#", vel_z, foot=(1, 0))
    other = {name: value[1].clone() for name, value in footfalls.state_dict().items()
             if value.shape[:1] == (2,)}  # fmt: skip
    footfalls.reset(torch.tensor([True, False]), torch.zeros(2, 4))
    for name, value in other.items():
        assert torch.equal(footfalls.state_dict()[name][1], value), name
    assert (footfalls.drop_sq[0] == 0.0).all()
    assert footfalls.drop_sq[1, 0] > 0.0


def test_after_a_reset_no_speed_of_the_last_episode_is_a_landing_speed():
    footfalls = _make_footfalls()
    _play(footfalls, AIR + AIR, [-9.0] * 8)
    footfalls.reset(torch.tensor([True, False]), torch.zeros(2, 4))
    results = _play(footfalls, "#" * 8, [-0.1] * 8)
    assert _landing_speeds(results) == pytest.approx([0.1])


def test_a_loaded_state_continues_bit_for_bit():
    vel_z = [-0.01 * (j % 17) for j in range(32)]
    found = GROUND * 2 + AIR * 3 + "..##" + GROUND * 2
    clearance = [0.01 * (i % 4) for i in range(8)]
    footfalls = _make_footfalls()
    _play(footfalls, found[:24], vel_z[:24], clearance[:6])
    state = footfalls.state_dict()
    twin = _make_footfalls()
    twin.load_state_dict(state)
    results = _play(footfalls, found[24:], vel_z[24:], clearance[6:])
    # The original has gone on: a state that shared its memory would spoil the twin.
    assert _play(twin, found[24:], vel_z[24:], clearance[6:]) == results
    assert any(step["touchdown"] for step in results)
    assert torch.equal(twin.phase, footfalls.phase)


def test_a_saved_state_does_not_change_afterwards():
    footfalls = _make_footfalls()
    state = footfalls.state_dict()
    kept = {name: value.clone() for name, value in state.items()}
    _play(footfalls, AIR + GROUND * 2, [-1.0] * 12)
    assert all(torch.equal(state[name], value) for name, value in kept.items())


@pytest.mark.parametrize("field", ["min_segment", "max_segment", "landing_window"])
def test_a_time_that_is_not_positive_is_refused_by_name(field):
    with pytest.raises(ValueError, match=f"footfall.{field}"):
        FootfallCfg(**{field: 0.0})


def test_an_apex_is_above_the_highest_ground_that_the_swing_came_near():
    found = GROUND + AIR * 4 + GROUND * 2
    height = [0.0, 0.02, 0.12, 0.10, 0.09, 0.08, 0.08]
    ground = [0.0, 0.0, 0.0, 0.08, 0.08, 0.08, 0.08]
    results = _play(_make_footfalls(), found, clearance=height, ground=ground)
    assert results[-1]["swing_apex"] == pytest.approx(0.04)
    down = _play(_make_footfalls(), found, clearance=height[::-1], ground=ground[::-1])
    assert down[-1]["swing_apex"] == pytest.approx(0.04)


def test_a_swing_that_begins_with_an_episode_knows_of_none_before():
    footfalls = _make_footfalls()
    _play(footfalls, GROUND + AIR * 2, clearance=[0.0, 0.3, 0.3], ground=[0.2, 0.2, 0.2])
    footfalls.reset(torch.tensor([True, False]), torch.zeros(2, 4))
    results = _play(footfalls, AIR * 2, clearance=[0.05, 0.04])
    assert results[-1]["swing_apex"] == pytest.approx(0.05)


def test_an_earlier_versions_state_has_its_apex_above_level_ground():
    footfalls, twin = _make_footfalls(), _make_footfalls()
    _play(footfalls, GROUND + AIR * 2, clearance=[0.0, 0.03, 0.05])
    earlier = {k: v for k, v in footfalls.state_dict().items() if not k.startswith("_highest")}
    twin.load_state_dict(earlier)
    for each in (footfalls, twin):
        assert _play(each, AIR, clearance=[0.02])[0]["swing_apex"] == pytest.approx(0.05)
