"""Levels without audio, against audio and against closed forms."""

import dataclasses
import math

import numpy as np
import pytest
from sound_helpers import FEET, a_weighted_level, make_block, random_walk

from mute.acoustics.air import AIR_IMPEDANCE
from mute.acoustics.energy import EnergyMeter
from mute.acoustics.floors import FLOORS as FLOOR_TABLE
from mute.acoustics.metering.levels import P_REF
from mute.acoustics.metering.sound_level_meter import SoundLevelMeter
from mute.acoustics.metering.weighting import a_weighting_db
from mute.acoustics.microphone import TRUNK_OFFSET, Microphone
from mute.acoustics.physics.room import OPEN, ROOMS, Room
from mute.acoustics.soundscape import SOURCES, Soundscape
from mute.acoustics.sources.exposures import blow_exposures
from mute.acoustics.sources.landings import place_struck
from mute.acoustics.sources.response import PLACES

FLOORS = ("wood", "parquet", "laminate", "carpet", "tile", "concrete")
SECONDS = 4.0
SHARE = 0.045
"""Of the force that comes to the shell: agreement is not to go with the calibration."""
LISTENER = Microphone((0.0, 2.0, 1.6), "beside")


def _on_every_floor(seconds=SECONDS, seed=0, **how):
    """Make robots that walk side by side, each on a floor of its own."""
    block = random_walk(seconds, len(FLOORS), seed, **how)
    block.floor = np.broadcast_to(np.arange(len(FLOORS))[:, None], block.floor.shape)
    block.impacts.floor = block.impacts.robot
    return block


def _heard(block, microphone=None, sources=SOURCES):
    """Return what each source sounds like."""
    robots = block.num_robots
    return {
        name: Soundscape(
            robots, FLOORS, microphone, sources=(name,), transmissibility=SHARE
        ).render(block)
        for name in sources
    }


def _mix(sounds):
    return np.sum(list(sounds.values()), axis=0)


def _measured(pressure):
    meter = SoundLevelMeter(48000, len(pressure))
    meter.update(pressure)
    return meter.result()


def _counted(block, microphone=None, sources=SOURCES, share=SHARE, room=OPEN):
    meter = EnergyMeter(block.num_robots, FLOORS, microphone, sources, share, room)
    meter.update(block)
    return meter


def _level(exposure, seconds=SECONDS):
    return 10.0 * np.log10(exposure / seconds / P_REF**2)


@pytest.fixture(scope="module")
def walks():
    """What is heard and counted of a walk on every floor."""
    block = _on_every_floor(seed=3)
    return _heard(block), _counted(block)


@pytest.mark.parametrize("floor", range(len(FLOORS)), ids=FLOORS)
def test_energy_and_audio_agree_on_the_figures_of_a_walk(walks, floor):
    sounds, meter = walks
    heard = _measured(_mix(sounds)[[floor]])[0]
    counted = meter.result()[floor]
    assert counted.mnl == pytest.approx(heard.mnl, abs=0.5)
    assert counted.laeq == pytest.approx(heard.laeq, abs=0.5)
    assert counted.pnl == pytest.approx(heard.pnl, abs=1.5)
    assert counted.readings == heard.readings


def _assert_close(source, sound, exposure):
    """Check what is counted of a source on each floor against its sound, within a decibel."""
    deviation = _level(exposure) - a_weighted_level(sound)
    # What the shell sounds of on carpet is what little a soft, long blow has between its notches.
    on_carpet = (np.array(FLOORS) == "carpet") & (source == "body")
    assert (np.abs(deviation) < np.where(on_carpet, 2.5, 1.0)).all(), deviation


@pytest.mark.parametrize("source", SOURCES)
def test_they_agree_on_each_source_alone(walks, source):
    sounds, meter = walks
    _assert_close(source, sounds[source], meter.exposure[source])


@pytest.mark.parametrize("name", FLOORS)
def test_what_is_heard_of_a_landing_is_both_parts_of_its_floors_law(name):
    # By the laws of the plate alone, and in the mean of the places that may be struck.
    floor, apart = FLOOR_TABLE[name], np.full(PLACES, 0.45)
    mass, speed = np.full(PLACES, 0.5), np.full(PLACES, 0.45)
    blow, frequency = floor.contact.blow(mass[:1], speed[:1]), np.geomspace(22.4, 14e3, 2000)
    spectrum = floor.contact.spectrum(blow.give, blow.duration[:, None] * frequency)[0]
    force = np.square(np.abs(spectrum * blow.impulse)) * 10.0 ** (a_weighting_db(frequency) / 10.0)
    at_once = np.square(np.abs(floor.plate.direct_pressure(frequency)) / apart[0])
    spread = floor.plate.spread(frequency, apart[:1])
    ringing = AIR_IMPEDANCE * floor.plate.ringing_power(frequency) * spread
    expected = np.trapezoid(2.0 * force * (at_once + ringing), frequency)
    heard = blow_exposures(floor, mass, speed, np.arange(PLACES), np.zeros(PLACES, dtype=int))
    difference = _level(heard.floor_at(apart).mean(), 1.0) - _level(expected, 1.0)
    assert difference == pytest.approx(0.0, abs=1.0)


def test_they_agree_for_a_listener_beside():
    block, sources = _on_every_floor(seed=1), ("impacts", "body", "scuffing", "fan")
    sounds, meter = _heard(block, LISTENER, sources), _counted(block, LISTENER, sources)
    for source, sound in sounds.items():
        _assert_close(source, sound, meter.exposure[source])


def test_they_agree_at_the_steps_of_training():
    block = _on_every_floor(seconds=3.0, seed=9, timestep=0.005)
    sources = ("impacts", "body", "scuffing", "fan")
    pressure = _mix(_heard(block, sources=sources))
    heard, counted = _measured(pressure), _counted(block, sources=sources).result()
    for own, other in zip(counted, heard, strict=True):
        assert own.mnl == pytest.approx(other.mnl, abs=0.5)


def test_blocks_of_any_length_give_the_same_readings():
    block = _on_every_floor(seconds=1.0, seed=10)
    whole, parts = (EnergyMeter(6, FLOORS, room=ROOMS["office"]) for _ in range(2))
    whole.update(block)
    for first in range(0, block.steps, 37):
        parts.update(block.part(first, first + 37))
    np.testing.assert_allclose(parts.detector.readings, whole.detector.readings, atol=1e-9)
    assert whole.detector.readings.shape == (6, 11)  # at 0.50, 0.55, ... 1.00 s


def test_the_fan_reads_55_dba():
    result = _counted(make_block(2000), sources=("fan",)).result()[0]
    assert result.laeq == pytest.approx(55.0, abs=1e-9)
    assert result.mnl == pytest.approx(55.0, abs=0.02)  # the detector started from silence


def test_ten_times_the_share_of_the_force_is_20_db_more_of_shell_and_drive():
    block = random_walk(seconds=1.0)
    little, much = (_counted(block, share=share).exposure for share in (0.01, 0.1))
    for source in SOURCES:
        factor = 100.0 if source in ("body", "drive") else 1.0
        np.testing.assert_allclose(much[source], factor * little[source])


def test_the_exposures_of_the_sources_add_up_to_the_level():
    block = make_block(10000, landings=[(100 * k, 0, 0, 1.2, 0.5) for k in range(100)])
    meter = EnergyMeter(1, FLOORS)
    meter.update(block.part(0, 3000))
    meter.update(block.part(3000, 10000))
    total = sum(float(own[0]) for own in meter.exposure.values())
    assert _level(total, 10.0) == pytest.approx(meter.result()[0].laeq, abs=1e-6)
    once = _counted(make_block(100, landings=[(0, 0, 0, 1.2, 0.5)]), sources=("impacts",))
    assert meter.exposure["impacts"][0] == pytest.approx(100.0 * once.exposure["impacts"][0])


def test_a_landing_counts_on_the_floor_that_it_hits():
    block = make_block(100, landings=[(0, 0, 0, 0.4, 0.5), (50, 0, 0, 0.4, 0.5)])
    block.impacts.floor = np.array([0, 5])
    both = _counted(block, sources=("impacts",)).exposure["impacts"][0]
    block.impacts.floor = np.array([0, 0])
    assert both == pytest.approx(
        0.5 * _counted(block, sources=("impacts",)).exposure["impacts"][0], rel=0.01
    )  # concrete is 25 dB quieter than wood, and more


# Rooms: the classical sum p^2 = rho c W (1 / (2 pi r^2) + 4 / A).


@pytest.mark.parametrize("name", ["office", "corridor", "ward"])
@pytest.mark.parametrize("apart", [0.3, 1.0, 2.0])
def test_a_steady_source_in_a_room_has_the_level_of_the_classical_sum(name, apart):
    room, block = ROOMS[name], make_block(4000)
    microphone = Microphone((0.0, apart, 0.3), "world")
    meter = _counted(block, microphone, ("fan",), room=room)
    power = P_REF**2 * 10.0**5.5 * 2.0 * math.pi * TRUNK_OFFSET[0] ** 2 / AIR_IMPEDANCE
    expected = AIR_IMPEDANCE * power * (1.0 / (2.0 * math.pi * apart**2) + 4.0 / room.absorption)
    # After 4 s, 3 of its reverberation times at least, the room is full.
    assert meter.detector.level[0] == pytest.approx(_level(expected, 1.0), abs=1e-3)


def test_at_the_distance_where_both_fields_are_equal_a_room_adds_3_01_db():
    ward = ROOMS["ward"]
    radius = math.sqrt(ward.absorption / (8.0 * math.pi))
    microphone, block = Microphone((0.0, radius, 0.3), "world"), make_block(4000)
    within, outside = (
        _counted(block, microphone, ("fan",), room=room).detector.level[0] for room in (ward, OPEN)
    )
    assert within - outside == pytest.approx(3.0103, abs=1e-3)


@pytest.mark.parametrize("source", ["impacts", "body", "scuffing", "drive"])
def test_what_comes_back_from_the_walls_is_8_pi_over_a_of_the_mean_square_at_1_m(source):
    room = Room(absorption=10.0, size=(2.0, 2.0, 2.0))  # 0.13 s: soon empty again
    rest = np.zeros((1000, 1, 12))
    rest[:300, 0, 0] = np.where(np.arange(300) % 60 < 30, 3.0, -3.0)
    slide = np.zeros((1000, 1, 4))
    slide[:300] = 1.0
    landings = [(20, 0, 1, 0.4, 0.5), (150, 0, 1, 0.5, 0.4)]
    block = make_block(1000, 1, 0.001, landings, slide, rest)
    at_1_m = {
        "impacts": AIR_IMPEDANCE / (2.0 * math.pi) * _floor_energy(block),
        "scuffing": _exposure_1_m_from_the_foot(slide),
        "body": _exposure(block, "body", Microphone((1.0, 0.0, 0.3), "world")),
        "drive": _exposure(block, "drive", Microphone((1.0, 0.0, 0.3), "world")),
    }
    echo = _exposure(block, source, None, room=room) - _exposure(block, source, None)
    assert echo == pytest.approx(8.0 * math.pi / 10.0 * at_1_m[source], rel=1e-3)


def _exposure(block, source, microphone, **how):
    return _counted(block, microphone, (source,), **how).exposure[source][0]


def _floor_energy(block):
    """Return the A-weighted sound energy that wood radiates of landings, J."""
    impacts = block.impacts
    place = place_struck(impacts.position)
    wood = FLOOR_TABLE["wood"]
    return blow_exposures(wood, impacts.mass, impacts.speed, place, impacts.foot).floor_power.sum()


def _exposure_1_m_from_the_foot(slide):
    """Return the exposure of all feet's slides if one foot did them, 1 m away."""
    alone = np.zeros_like(slide)
    alone[..., 0] = slide.sum(axis=2)
    above = Microphone((FEET[0, 0], FEET[0, 1], 1.0), "world")
    return _exposure(make_block(len(slide), friction_power=alone), "scuffing", above)


def test_a_room_empties_by_60_db_in_its_reverberation_time():
    slide = np.zeros((1200, 1, 4))
    slide[:500] = 1.0
    block = make_block(1200, friction_power=slide)
    room = ROOMS["office"]
    meter = EnergyMeter(1, FLOORS, sources=("scuffing",), room=room)
    passed = []
    for first in range(0, 1200, 10):
        before = meter.exposure["scuffing"][0]
        meter.update(block.part(first, first + 10))
        passed.append(meter.exposure["scuffing"][0] - before)
    steps = round(room.reverberation_time / 0.01)
    levels = 10.0 * np.log10(passed[50 : 51 + steps])
    assert levels[0] - levels[-1] == pytest.approx(60.0, abs=1.5)
    assert levels[0] - levels[steps // 2] == pytest.approx(30.0, abs=0.8)


def test_a_small_room_is_louder_than_a_large_one_and_the_open_is_quietest():
    block = _on_every_floor(seconds=1.0, seed=1)
    rooms = (Room(5.0, (2.0, 2.0, 2.5)), Room(50.0, (20.0, 8.0, 3.0)), ROOMS["open"])
    levels = [[own.laeq for own in _counted(block, room=room).result()] for room in rooms]
    assert (np.diff(levels, axis=0) < 0.0).all()


def test_an_open_room_is_none():
    block = random_walk(seconds=1.0)
    given, without = _counted(block, room=ROOMS["open"]), _counted(block)
    np.testing.assert_array_equal(given.detector.readings, without.detector.readings)


def test_what_the_robot_sounds_of_does_not_go_with_where_it_is_heard():
    block = random_walk(seconds=1.0)
    near, far = (_exposure(block, "body", Microphone((r, 0.0, 0.0))) for r in (0.5, 1.0))
    assert near == pytest.approx(4.0 * far)


def test_a_meter_that_heard_nothing_has_no_levels():
    with pytest.raises(ValueError, match="no levels of an empty recording"):
        EnergyMeter(1, FLOORS).result()


def test_steps_that_do_not_fill_a_second_are_refused():
    with pytest.raises(ValueError, match=r"timestep must be a whole part of 1 s, got 0\.003 s"):
        EnergyMeter(1, FLOORS).update(make_block(10, timestep=0.003))


def test_a_block_that_leaves_a_gap_is_refused():
    block, meter = make_block(100), EnergyMeter(1, FLOORS)
    meter.update(block.part(0, 50))
    with pytest.raises(ValueError, match=r"block starts at 0\.06 s, not at 0\.05 s"):
        meter.update(block.part(60, 100))


def test_a_block_of_another_number_of_robots_is_refused():
    with pytest.raises(ValueError, match="block has 2 robots, not 1"):
        EnergyMeter(1, FLOORS).update(make_block(10, robots=2))


def test_an_unknown_floor_is_refused():
    with pytest.raises(ValueError, match="floor 'moss' is not known; use one of wood"):
        EnergyMeter(1, ("moss",))


@pytest.mark.parametrize(("sources", "words"), [(("barking",), "got 'barking'"), ((), "got none")])
def test_sources_that_are_none_are_refused(sources, words):
    with pytest.raises(ValueError, match=f"sources must be of impacts, body.*{words}"):
        EnergyMeter(1, FLOORS, sources=sources)


def test_levels_do_not_depend_on_the_precision_of_physics():
    block = random_walk(seconds=1.0, seed=6)
    floats = {
        field.name: value.astype(np.float32)
        for field in dataclasses.fields(block)
        if isinstance(value := getattr(block, field.name), np.ndarray) and value.dtype == float
    }
    single, double = (
        _counted(each).result()[0] for each in (dataclasses.replace(block, **floats), block)
    )
    assert single.laeq == pytest.approx(double.laeq, abs=0.01)
