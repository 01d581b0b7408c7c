"""Floors as they are built: what a foot feels on them, and which ones can be."""

from __future__ import annotations

import dataclasses
import math
from types import MappingProxyType

import mujoco
import numpy as np
import pytest

from mute.acoustics import floors
from mute.acoustics.floors import (
    FLOORS,
    RUBBER,
    Covering,
    Floor,
    find_floors,
    register_floor,
)
from mute.acoustics.physics.contact import hertz_duration, hertz_stiffness, series_modulus
from mute.acoustics.physics.plate import Layer, bonded
from mute.envs.scene import FOOT_RADIUS

MASS, SPEED = 0.5, 0.45
"""Of a landing, kg and m/s."""

HARD = [name for name, floor in FLOORS.items() if floor.covering is None]


def landing(floor, mass=MASS, speed=SPEED):
    return floor.contact.blow(mass, speed)


def test_an_unknown_floor_is_refused_by_name():
    with pytest.raises(ValueError, match=r"'lava' is not known; use one of wood, parquet, .*tile"):
        find_floors(("wood", "lava"))


def test_floors_come_in_the_order_of_their_names():
    assert [floor.name for floor in find_floors(("tile", "wood"))] == ["tile", "wood"]
    assert all(floor.name == name for name, floor in FLOORS.items())


def test_no_two_floors_look_alike():
    assert len({floor.colour for floor in FLOORS.values()}) == len(FLOORS)


def test_a_policy_trained_at_friction_0_8_can_stand_on_every_floor():
    for floor in FLOORS.values():
        assert 0.6 <= floor.friction <= 1.0


def test_a_floor_is_the_plate_of_its_layers():
    tile = FLOORS["tile"]
    assert tile.plate == bonded(tile.layers, tile.edges, tile.size, tile.underlay)
    assert tile.plate.surface_mass == pytest.approx(0.009 * 2400.0 + 0.07 * 2000.0)
    assert FLOORS["concrete"].plate.surface_mass == pytest.approx(440.0)


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        # What books have for such plates, Hz: f_c h is about 17 to 20 Hz m for concrete, 30 for
        # chipboard, 17 to 20 for plywood.
        ("concrete", 80.0, 105.0),
        ("wood", 1100.0, 1700.0),
        ("parquet", 1050.0, 1500.0),
        ("tile", 180.0, 300.0),
    ],
)
def test_critical_frequencies_are_those_of_the_materials(name, low, high):
    assert low < FLOORS[name].plate.critical_frequency < high


@pytest.mark.parametrize("name", ["concrete", "tile"])
def test_rubber_on_what_is_heavy_is_hertz_alone(name):
    stiffness = hertz_stiffness(FOOT_RADIUS, series_modulus(RUBBER))
    contact = FLOORS[name].contact
    assert contact.stiffness == pytest.approx(stiffness, rel=1e-3)
    assert contact.exponent == 1.5
    # The loss of rubber that gives back half of its energy draws it out by 5 %.
    free = hertz_duration(MASS, SPEED, stiffness)
    assert free < float(landing(FLOORS[name]).duration) < 1.06 * free


@pytest.mark.parametrize(("speed", "milliseconds"), [(0.23, 13.7), (0.455, 12.0), (0.61, 11.3)])
def test_a_faster_foot_touches_for_a_shorter_time(speed, milliseconds):
    # 12 ms at 0.45 m/s, by v^(-1/5).
    duration = 1e3 * float(landing(FLOORS["tile"], speed=speed).duration)
    assert duration == pytest.approx(milliseconds, abs=0.1)


def test_the_lighter_a_floor_the_longer_a_foot_presses_on_it():
    order = sorted(HARD, key=lambda name: FLOORS[name].plate.mobility)
    durations = [float(landing(FLOORS[name]).duration) for name in order]
    assert durations == sorted(durations)
    assert order[0] == "concrete"
    assert order[-1] == "laminate"


def test_contact_on_carpet_lasts_longest_and_gives_back_least():
    durations = {name: float(landing(floor).duration) for name, floor in FLOORS.items()}
    assert max(durations, key=lambda name: durations[name]) == "carpet"
    assert durations["carpet"] > 2.0 * durations["concrete"]
    lost = {name: float(landing(FLOORS[name]).lost) for name in ("carpet", "concrete")}
    assert lost["carpet"] > 1.2 * lost["concrete"]


@pytest.mark.parametrize("name", HARD)
def test_rubber_loses_half_of_a_landing_and_a_light_floor_takes_more(name):
    energy = 0.5 * MASS * SPEED**2
    lost = float(landing(FLOORS[name]).lost) / energy
    assert 0.499 < lost < 1.0
    if name in ("concrete", "tile"):
        assert lost == pytest.approx(0.5, abs=0.005)


def test_a_sphere_presses_each_spot_of_a_pile_as_deep_as_it_reaches_there():
    pile, radius, depth = Covering(stiffness=1e9, restitution=0.3), 0.023, 0.002
    reach = math.sqrt(2.0 * radius * depth)
    rings = (np.arange(10000) + 0.5) / 10000 * reach
    pressure = pile.stiffness * (depth - rings**2 / (2.0 * radius)) ** 1.5
    force = (pressure * 2.0 * np.pi * rings).sum() * reach / 10000
    stiffness, exponent = pile.under_a_sphere(radius)
    assert stiffness * depth**exponent == pytest.approx(force, rel=1e-6)


def test_a_flat_plate_presses_all_of_a_pile_alike():
    stiffness, exponent = Covering(stiffness=1e9, restitution=0.3).under_a_plate(0.01)
    assert stiffness * 0.002**exponent == pytest.approx(1e9 * 0.002**1.5 * 0.01)


def test_rubber_and_pile_give_way_one_upon_the_other():
    carpet = FLOORS["carpet"]
    assert carpet.covering is not None
    force = np.array([5.0, 20.0, 60.0])
    modulus = series_modulus(RUBBER, (carpet.layers[0].modulus, carpet.layers[0].poisson))
    rubber = (force / hertz_stiffness(FOOT_RADIUS, modulus)) ** (1.0 / 1.5)
    stiffness, exponent = carpet.covering.under_a_sphere(FOOT_RADIUS)
    pile = (force / stiffness) ** (1.0 / exponent)
    contact = carpet.contact
    both = (force / contact.stiffness) ** (1.0 / contact.exponent)
    np.testing.assert_allclose(both, rubber + pile, rtol=0.03)
    assert 1.5 < contact.exponent < 2.5
    assert carpet.covering.restitution < contact.restitution < math.sqrt(0.5)


# A foot that knows nothing but its mass. MuJoCo has the floor's contact alone, by its priority.
_FOOT = """
<mujoco>
  <option timestep="1e-4" gravity="0 0 0" cone="elliptic"/>
  <worldbody>
    <geom type="plane" size="1 1 1" priority="1" solref="{constant} {ratio}"/>
    <body pos="0 0 {radius}">
      <joint type="slide" axis="0 0 1"/>
      <geom size="{radius}" mass="{mass}"/>
    </body>
  </worldbody>
</mujoco>
"""


def dropped(solref):
    """Return for how long MuJoCo's floor presses on a foot, s, and its rebound over its speed."""
    constant, ratio = solref
    text = _FOOT.format(constant=constant, ratio=ratio, radius=FOOT_RADIUS, mass=MASS)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qvel[0] = -SPEED
    steps = 0
    mujoco.mj_step(model, data)
    while data.qpos[0] < 0.0:
        mujoco.mj_step(model, data)
        steps += bool(data.nefc and data.efc_force.any())
        assert steps < 5000
    return steps * model.opt.timestep, float(data.qvel[0]) / SPEED


@pytest.mark.parametrize("name", FLOORS)
def test_mujoco_presses_as_long_as_the_usual_landing_and_gives_back_as_much(name):
    floor = FLOORS[name]
    duration, rebound = dropped(floor.solref)
    blow = landing(floor)
    assert duration == pytest.approx(float(blow.duration), rel=0.06)
    kept = 1.0 - float(blow.lost) / (0.5 * MASS * SPEED**2)
    assert rebound == pytest.approx(math.sqrt(kept), abs=0.03)


@pytest.fixture
def registry(monkeypatch):
    """Let a test register what no other one sees."""
    known = dict(FLOORS)
    monkeypatch.setattr(floors, "_floors", known)
    monkeypatch.setattr(floors, "FLOORS", MappingProxyType(known))
    return known


LAYER = Layer(thickness=0.03, density=900.0, modulus=5e9, poisson=0.3, loss=0.04)
PILE = Covering(stiffness=1e10, restitution=0.4)
CORK = Floor(
    name="cork",
    friction=0.8,
    layers=(LAYER,),
    colour=(0.7, 0.5, 0.3),
    covering=PILE,
)


def test_a_registered_floor_is_found_beside_the_others(registry):
    register_floor(CORK)
    register_floor(dataclasses.replace(CORK, name="lino-2", covering=None, underlay=1e7))
    assert find_floors(["cork", "wood"]) == (CORK, FLOORS["wood"])
    assert [*registry][-2:] == ["cork", "lino-2"]
    assert float(landing(CORK).duration) > 0.0


def test_the_table_of_floors_is_written_by_nobody_else():
    with pytest.raises(TypeError):
        FLOORS["lava"] = CORK  # pyright: ignore[reportIndexIssue]


def layered(**changed):
    return {"layers": (LAYER, dataclasses.replace(LAYER, **changed))}


def covered(**changed):
    return {"covering": dataclasses.replace(PILE, **changed)}


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"name": "wood"}, ["'wood'", "already"]),
        ({"name": "Cork Oak"}, ["'Cork Oak'", "small letters"]),
        ({"name": "2-cork"}, ["'2-cork'", "small letters"]),
        ({"name": None}, ["small letters", "None"]),
        ({"friction": 0.0}, ["cork", "friction", "> 0", "0.0"]),
        ({"friction": 1e30}, ["cork", "friction", "<= 10", "1e+30"]),
        ({"friction": "dry"}, ["cork", "friction", "dry"]),
        ({"friction": True}, ["cork", "friction", "True"]),
        ({"layers": ()}, ["cork", "layers", "at least one"]),
        ({"layers": [LAYER]}, ["cork", "layers", "at least one"]),
        ({"layers": (LAYER, 0.02)}, ["cork", "layers[1]", "Layer", "0.02"]),
        (layered(thickness=0.0), ["cork", "layers[1].thickness", "0.0"]),
        (layered(density=-1.0), ["cork", "layers[1].density", "-1.0"]),
        (layered(modulus=math.inf), ["cork", "layers[1].modulus", "inf"]),
        (layered(poisson=0.51), ["cork", "layers[1].poisson", "<= 0.5", "0.51"]),
        (layered(loss=math.nan), ["cork", "layers[1].loss", "nan"]),
        ({"size": (4.0,)}, ["cork", "size", "2 numbers"]),
        ({"size": (4.0, 0.0)}, ["cork", "size", ">= 0.1", "0.0"]),
        ({"edges": -0.1}, ["cork", "edges", "-0.1"]),
        ({"underlay": math.inf}, ["cork", "underlay", "inf"]),
        ({"colour": (0.5, 0.5)}, ["cork", "colour", "3 numbers"]),
        ({"colour": (0.0, 0.0, 2.0)}, ["cork", "colour", "<= 1", "2.0"]),
        ({"covering": 1e10}, ["cork", "covering", "Covering"]),
        (covered(stiffness=0.0), ["cork", "covering.stiffness", "0.0"]),
        (covered(restitution=0.0), ["cork", "covering.restitution", "> 0"]),
        (covered(restitution=1.1), ["cork", "covering.restitution", "<= 1", "1.1"]),
    ],
)
def test_a_floor_that_cannot_be_is_refused_by_the_field(registry, changed, words):
    before = dict(registry)
    with pytest.raises(ValueError) as caught:
        register_floor(dataclasses.replace(CORK, **changed))
    assert all(word in str(caught.value) for word in words), str(caught.value)
    assert registry == before


def test_what_is_no_floor_is_refused():
    with pytest.raises(ValueError, match="takes a Floor, got 'wood'"):
        register_floor("wood")  # pyright: ignore[reportArgumentType]
