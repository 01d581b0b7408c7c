"""What comes back from the walls, as sound."""

import importlib.util
import math
import sys

import numpy as np
import pytest
from sound_helpers import RATE, a_weighted_level, make_block, random_walk

from mute.acoustics.energy import EnergyMeter
from mute.acoustics.floors import FLOORS
from mute.acoustics.metering.levels import P_REF
from mute.acoustics.metering.sound_level_meter import SoundLevelMeter
from mute.acoustics.microphone import Microphone
from mute.acoustics.physics.room import ROOMS, Room
from mute.acoustics.room_sound import (
    RoomSound,
    _response,
    check_rooms_heard,
    near_feet,
    near_floors,
    near_trunk,
)
from mute.acoustics.soundscape import SOURCES, Soundscape
from mute.support.errors import MuteError

heard_rooms = pytest.mark.skipif(
    importlib.util.find_spec("pyroomacoustics") is None, reason="pyroomacoustics is not installed"
)

ROOM = Room(absorption=10.0, size=(4.0, 3.0, 2.5))  # 0.48 s
TILE = FLOORS["tile"]


@pytest.fixture
def _without_the_library(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyroomacoustics", None)


@pytest.mark.usefixtures("_without_the_library")
def test_sound_in_a_room_without_the_library_names_what_to_install():
    unseen = Room(absorption=7.0, size=(3.0, 3.0, 2.0))
    with pytest.raises(MuteError, match=r"needs the library pyroomacoustics.*'mute\[rooms\]'"):
        Soundscape(1, ("tile",), room=unseen)
    with pytest.raises(MuteError, match=r"mute\[rooms\]"):
        check_rooms_heard()


@pytest.mark.usefixtures("_without_the_library")
def test_in_the_open_and_of_levels_the_library_is_not_needed():
    block = make_block(600)
    assert Soundscape(1, ("tile",), sources=("fan",)).render(block).any()
    meter = EnergyMeter(1, ("tile",), sources=("fan",), room=ROOMS["ward"])
    meter.update(block)
    assert meter.result()[0].laeq > 55.0


# By what the sound at a microphone is less than at 1 m of a source of that power.


def test_of_what_sounds_in_the_trunk_it_is_the_distance():
    block = make_block(2)
    where = Microphone((0.0, 3.0, 4.3), "world").position(block)
    np.testing.assert_allclose(near_trunk(block, where), 5.0)


def test_of_feet_it_is_the_mean_of_their_energies():
    block = make_block(2)
    above = Microphone((0.0, 0.0, 2.0), "world").position(block)
    assert near_feet(block, above)[0, 0] == pytest.approx(math.sqrt(4.0 + 0.19**2 + 0.13**2))
    beside = Microphone((0.19, 0.5, 0.0), "world").position(block)
    apart = np.array([0.63, 0.37, math.hypot(0.38, 0.63), math.hypot(0.38, 0.37)])
    expected = 1.0 / math.sqrt(np.mean(apart**-2.0))
    assert near_feet(block, beside)[0, 0] == pytest.approx(expected)


def test_a_floor_that_rings_is_nearer_than_its_power_says_only_from_afar():
    block = make_block(1)
    nearness = near_floors([TILE])
    for height, low, high in ((0.3, 1.2, 4.0), (30.0, 0.9, 1.1)):
        above = Microphone((0.0, 0.0, height), "world").position(block)
        ratio = nearness(block, above)[0, 0] / near_feet(block, above)[0, 0]
        assert low < ratio < high


def test_of_feet_on_several_floors_it_is_the_mean():
    block = make_block(1)
    where = Microphone().position(block)
    both = near_floors([TILE, FLOORS["concrete"]])
    single = [near_floors([floor])(block, where)[0, 0] for floor in (TILE, FLOORS["concrete"])]
    block.floor = np.array([[[0, 0, 0, 1]]])
    assert both(block, where)[0, 0] == pytest.approx(0.75 * single[0] + 0.25 * single[1])


# Sound.


@heard_rooms
def test_the_field_of_a_steady_source_is_8_pi_over_a_of_its_mean_square_at_1_m():
    # A noise of equal octaves from 100 Hz to 4 kHz that repeats, so that its second time is steady.
    generator = np.random.default_rng(0)
    frequency = np.fft.rfftfreq(2 * RATE, 1.0 / RATE)
    band = (frequency > 100.0) & (frequency < 4000.0)
    phase = generator.uniform(0.0, 2.0 * np.pi, len(frequency))
    size = np.where(band, 1.0, 0.0) / np.sqrt(np.maximum(frequency, 1.0))
    near = np.fft.irfft(size * np.exp(1j * phase))
    sound = RoomSound(1, RATE, ROOM)
    sound.render(near[None])
    echo = sound.render(near[None])[0]
    expected = 8.0 * math.pi / ROOM.absorption
    assert np.mean(echo**2) / np.mean(near**2) == pytest.approx(expected, rel=0.03)


def _echo_of_a_blow(seconds=0.8):
    blow = np.zeros((1, round(seconds * RATE)))
    blow[0, 0] = 1.0
    return RoomSound(1, RATE, ROOM).render(blow)[0]


@heard_rooms
def test_the_direct_sound_is_not_among_what_comes_back():
    long, wide, _ = ROOM.size or (0.0, 0.0, 0.0)
    straight = math.hypot(0.25 * long, 0.15 * wide, 1.05) / 343.0
    response = _echo_of_a_blow()
    early = np.abs(response[: round((straight + 2e-3) * RATE)])
    assert early.max() < 1e-9 * np.abs(response).max()


@heard_rooms
def test_what_comes_back_falls_by_60_db_in_the_reverberation_time():
    left = np.cumsum(np.square(_echo_of_a_blow())[::-1])[::-1]  # Schroeder
    level = 10.0 * np.log10(left / left[0] + 1e-20)
    begin, end = (int(np.argmax(level < limit)) for limit in (-5.0, -25.0))
    assert 3.0 * (end - begin) / RATE == pytest.approx(ROOM.reverberation_time, rel=0.25)


@heard_rooms
def test_the_field_streams_and_each_robot_has_its_own():
    near = np.random.default_rng(1).normal(size=(2, 4800))
    near[1] = 0.0
    whole, parts = RoomSound(2, RATE, ROOM), RoomSound(2, RATE, ROOM)
    expected = whole.render(near)
    pieces = np.split(near, [7, 1000, 3333], axis=1)
    heard = np.concatenate([parts.render(piece) for piece in pieces], axis=1)
    np.testing.assert_allclose(heard, expected, atol=1e-9 * np.abs(expected).max())
    assert np.abs(heard[1]).max() < 1e-9 * np.abs(heard[0]).max()


@heard_rooms
def test_a_room_draws_nothing_from_the_chance_of_others():
    np.random.seed(5)
    expected = np.random.standard_normal()
    np.random.seed(5)
    RoomSound(1, RATE, Room(absorption=8.0, size=(3.0, 2.0, 2.0)))
    assert np.random.standard_normal() == expected


@heard_rooms
def test_a_room_sounds_the_same_each_time():
    first, again = (_response.__wrapped__(ROOM, RATE) for _ in range(2))
    np.testing.assert_array_equal(first, again)


@heard_rooms
def test_a_soundscape_in_a_room_is_the_open_one_and_what_comes_back():
    block = random_walk(seconds=0.3, seed=1)
    where = Microphone((1.0, 0.0, 0.0))
    options = {"microphone": where, "sources": ("body",)}
    within = Soundscape(1, ("tile",), room=ROOM, **options).render(block)
    direct = Soundscape(1, ("tile",), **options).render(block)
    # The microphone is 1 m from the trunk, of which all of it comes.
    echo = RoomSound(1, RATE, ROOM).render(direct.astype(float))
    np.testing.assert_allclose(within, direct + echo, atol=1e-5 * np.abs(within).max())


@heard_rooms
def test_energies_and_audio_agree_in_a_room():
    block = random_walk(seconds=4.0, robots=2, seed=2)
    block.floor = np.broadcast_to(np.array([[0], [1]]), block.floor.shape)
    block.impacts.floor = block.impacts.robot
    floors, away = ("tile", "concrete"), Microphone((0.0, 1.5, 1.2), "beside")
    office, share = ROOMS["office"], 0.045
    counted = EnergyMeter(2, floors, away, transmissibility=share, room=office)
    counted.update(block)
    sounds = {
        source: Soundscape(
            2, floors, away, sources=(source,), transmissibility=share, room=office
        ).render(block)
        for source in SOURCES
    }
    # At one place of a room each third octave is by chance some decibels more or less: of noise,
    # which fills many of them, little is left of that.
    for source in ("scuffing", "fan"):
        expected = 10.0 * np.log10(counted.exposure[source] / 4.0 / P_REF**2)
        np.testing.assert_allclose(a_weighted_level(sounds[source]), expected, atol=0.75)
    meter = SoundLevelMeter(RATE, 2)
    meter.update(np.sum(list(sounds.values()), axis=0))
    for own, other in zip(counted.result(), meter.result(), strict=True):
        assert own.mnl == pytest.approx(other.mnl, abs=1.0)
        assert own.laeq == pytest.approx(other.laeq, abs=1.0)
