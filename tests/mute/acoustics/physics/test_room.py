"""Rooms, against Sabine and the classical sum of the direct and the reverberant field."""

from __future__ import annotations

import math

import numpy as np
import pytest
from sound_helpers import make_block

from mute.acoustics.air import AIR_IMPEDANCE
from mute.acoustics.energy import EnergyMeter
from mute.acoustics.microphone import Microphone
from mute.acoustics.physics.room import OPEN, ROOMS, Room

HALL = Room(absorption=10.0, size=(10.0, 5.0, 4.0))


def test_reverberation_follows_sabine():
    # Sabine's 24 ln(10) / c is 0.161 s / m.
    assert HALL.volume == pytest.approx(200.0)
    expected = 24.0 * math.log(10.0) / 343.0 * 200.0 / 10.0
    assert HALL.reverberation_time == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(("name", "seconds"), [("office", 0.5), ("corridor", 1.0), ("ward", 1.2)])
def test_rooms_that_ship_reverberate_as_such_rooms_do(name, seconds):
    assert ROOMS[name].has_walls
    assert ROOMS[name].reverberation_time == pytest.approx(seconds, abs=0.01)


def test_nothing_comes_back_in_the_open():
    assert ROOMS["open"] is OPEN
    assert not OPEN.has_walls
    assert OPEN.echo == 0.0
    assert OPEN.reverberation_time == 0.0
    assert OPEN.volume == math.inf


def test_the_reverberant_field_is_4_over_a_of_the_power():
    power = 1e-6
    near = AIR_IMPEDANCE * power / (2.0 * math.pi)  # p^2 at 1 m
    assert HALL.echo * near == pytest.approx(4.0 * AIR_IMPEDANCE * power / 10.0)


def test_both_fields_are_equal_at_the_critical_distance():
    critical = math.sqrt(10.0 / (8.0 * math.pi))
    assert critical == pytest.approx(0.63, abs=0.005)
    assert HALL.echo == pytest.approx(1.0 / critical**2)


@pytest.mark.parametrize("room", [HALL, ROOMS["office"]])
def test_levels_of_a_steady_source_are_the_classical_sum(room):
    levels = []
    for apart in (0.5, 4.0):
        microphone = Microphone((apart, 0.0, 0.3), "world")
        for walls in (OPEN, room):
            meter = EnergyMeter(1, ("wood",), microphone, ("fan",), 0.0, walls)
            meter.update(make_block(4000, timestep=0.005))
            levels.append(meter.detector.level[0])  # the room has long been filled
    near, near_room, far, far_room = levels
    terms = 1.0 / (2.0 * np.pi * np.array([0.5, 4.0]) ** 2)
    both = 10.0 * np.log10(terms + 4.0 / room.absorption) - 10.0 * np.log10(terms)
    assert near_room - near == pytest.approx(both[0], abs=0.01)
    assert far_room - far == pytest.approx(both[1], abs=0.01)
    assert near - far == pytest.approx(20.0 * math.log10(8.0), abs=0.01)


def test_a_room_that_swallows_all_is_nearly_the_open():
    assert Room(absorption=1e9, size=(10.0, 5.0, 4.0)).echo == pytest.approx(0.0, abs=1e-7)
