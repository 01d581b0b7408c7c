"""What a floor is."""

import dataclasses
import math

import pytest

from mute.acoustics import floors
from mute.acoustics import gains as mute_gains
from mute.acoustics.floors import FLOORS, FOOT_STIFFNESS, Mode, find_floors, register_floor
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


@pytest.fixture
def _registry(monkeypatch):
    """Let a test register what no other one sees."""
    known, gains = dict(floors._floors), dict(floors._own_gains)
    for module in (floors, mute_gains):
        monkeypatch.setattr(module, "FLOORS", known)
        monkeypatch.setattr(module, "OWN_GAINS", gains)
    monkeypatch.setattr(floors, "_floors", known)
    monkeypatch.setattr(floors, "_own_gains", gains)


CORK = dataclasses.replace(FLOORS["carpet"], name="cork", stiffness=1e5)


@pytest.mark.usefixtures("_registry")
def test_a_registered_floor_is_found_and_has_the_gain_that_it_came_with():
    shipped = mute_gains.load_gains()
    register_floor(CORK, gain=1.5)
    register_floor(dataclasses.replace(CORK, name="lino"), gain="tile")
    register_floor(dataclasses.replace(CORK, name="lino-2"), gain="lino")
    register_floor(dataclasses.replace(CORK, name="cork_2"), gain="cork")
    assert find_floors(["cork"]) == (CORK,)
    own = {"cork": 1.5, "cork_2": 1.5, "lino": shipped["tile"], "lino-2": shipped["tile"]}
    assert mute_gains.load_gains() == shipped | own


@pytest.mark.parametrize(
    ("changed", "gain", "words"),
    [
        ({"name": "wood"}, 1.0, ["'wood'", "already"]),
        ({"name": "Cork Oak"}, 1.0, ["'Cork Oak'", "small letters"]),
        ({}, 0.0, ["cork", "gain", "> 0", "0.0"]),
        ({}, math.nan, ["cork", "gain", "> 0", "nan"]),
        ({}, None, ["cork", "gain", "None"]),
        ({"name": None}, 1.0, ["small letters", "None"]),
        ({"friction": 1e30}, 1.0, ["cork", "friction", "<= 10", "1e+30"]),
        ({"friction": "dry"}, 1.0, ["cork", "friction", "dry"]),
        ({"solref": (0.02, 1.0, 1.0)}, 1.0, ["cork", "solref", "2 numbers"]),
        ({"scuff_band": (100.0, math.nan)}, 1.0, ["cork", "scuff_band", "nan"]),
        ({"scuff_band": (100.0,)}, 1.0, ["cork", "scuff_band", "2 numbers"]),
        ({"colour": (0.5, 0.5)}, 1.0, ["cork", "colour", "3 numbers"]),
        ({"restitution": math.nan}, 1.0, ["cork", "restitution", "nan"]),
        ({"modes": ((100.0, 0.1, 1.0),)}, 1.0, ["cork", "modes[0]", "Mode"]),
        ({}, "oak", ["'oak'", "wood"]),
        ({"friction": 0.0}, 1.0, ["cork", "friction", "0.0"]),
        ({"solref": (0.02, -1.0)}, 1.0, ["cork", "solref", "-1.0"]),
        ({"stiffness": math.inf}, 1.0, ["cork", "stiffness", "inf"]),
        ({"restitution": 1.0}, 1.0, ["cork", "restitution", "< 1", "1.0"]),
        ({"modes": ()}, 1.0, ["cork", "modes"]),
        ({"modes": (Mode(100.0, 0.0, 1.0),)}, 1.0, ["cork", "modes[0].decay_time", "0.0"]),
        ({"scuff_band": (500.0, 200.0)}, 1.0, ["cork", "scuff_band", "rise"]),
        ({"scuff_efficiency": math.nan}, 1.0, ["cork", "scuff_efficiency", "nan"]),
        ({"colour": (0.0, 0.0, 2.0)}, 1.0, ["cork", "colour", "2.0"]),
    ],
)
@pytest.mark.usefixtures("_registry")
def test_a_floor_that_cannot_be_is_refused_by_the_field(changed, gain, words):
    before = dict(floors._floors)
    with pytest.raises(ValueError) as caught:
        register_floor(dataclasses.replace(CORK, **changed), gain)
    assert all(word in str(caught.value) for word in words), str(caught.value)
    assert floors._floors == before


@pytest.mark.usefixtures("_registry")
def test_what_is_no_floor_is_refused():
    with pytest.raises(ValueError, match="takes a Floor, got 'wood'"):
        register_floor("wood", 1.0)  # pyright: ignore[reportArgumentType]
