"""What a floor is."""

import math

import pytest

from mute.acoustics.floors import FLOORS, FOOT_STIFFNESS, find_floors
from mute.acoustics.sources.impacts import contact_time


def test_an_unknown_floor_is_refused_by_name():
    with pytest.raises(ValueError, match=r"'lava' is not known; use one of wood, carpet, tile"):
        find_floors(("wood", "lava"))


def test_floors_come_in_the_order_of_their_names():
    assert [floor.name for floor in find_floors(("tile", "wood"))] == ["tile", "wood"]


def test_foot_and_floor_are_springs_in_series():
    carpet = FLOORS["carpet"]
    expected = FOOT_STIFFNESS * carpet.stiffness / (FOOT_STIFFNESS + carpet.stiffness)
    assert carpet.contact_stiffness == pytest.approx(expected)


def test_contact_on_carpet_lasts_longest():
    times = {name: float(contact_time(0.5, floor)) for name, floor in FLOORS.items()}
    assert max(times, key=lambda name: times[name]) == "carpet"
    assert times["concrete"] == pytest.approx(math.pi * math.sqrt(0.5 / 6e4), rel=1e-3)
    assert times["carpet"] > 1.5 * times["wood"]


@pytest.mark.parametrize("mass", [0.38, 0.67])
def test_a_landing_foot_touches_carpet_for_15_to_19_ms_and_hard_floors_for_8_to_11(mass):
    for name, floor in FLOORS.items():
        low, high = (14.5, 19.5) if name == "carpet" else (7.5, 11.0)
        assert low < 1e3 * float(contact_time(mass, floor)) < high


def test_a_policy_trained_at_friction_0_8_can_stand_on_every_floor():
    for floor in FLOORS.values():
        assert 0.6 <= floor.friction <= 1.0
        assert 0.004 <= floor.solref[0] <= 0.03


def test_no_floor_shares_a_mode_with_another():
    frequencies = [mode.frequency for floor in FLOORS.values() for mode in floor.modes]
    assert len(set(frequencies)) == len(frequencies)


def test_carpet_is_dull_and_tile_bright():
    assert max(mode.frequency for mode in FLOORS["carpet"].modes) < 500.0
    assert max(mode.decay_time for mode in FLOORS["carpet"].modes) < 0.1
    assert max(mode.frequency for mode in FLOORS["tile"].modes) > 3000.0
