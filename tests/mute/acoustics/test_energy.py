"""Levels without audio, against audio."""

import numpy as np
import pytest
from sound_helpers import FEET, FLOORS, a_weighted_level, make_block, random_walk

from mute.acoustics.contacts import ContactBlock
from mute.acoustics.energy import EnergyMeter, impact_exposure
from mute.acoustics.floors import FLOORS as FLOOR_TABLE
from mute.acoustics.metering.levels import P_REF
from mute.acoustics.metering.sound_level_meter import SoundLevelMeter
from mute.acoustics.microphone import Microphone
from mute.acoustics.soundscape import SOURCES, Soundscape


def _audio_and_energy(block, sources=SOURCES, microphone=None, gains=None):
    robots = block.num_robots
    meter = SoundLevelMeter(48000, robots)
    meter.update(Soundscape(robots, FLOORS, microphone, sources=sources, gains=gains).render(block))
    energy = EnergyMeter(robots, FLOORS, microphone, sources, gains)
    energy.update(block)
    return meter.result(), energy.result()


@pytest.mark.parametrize("floor", range(4))
def test_energy_and_audio_agree_on_mnl_and_laeq(floor):
    heard, counted = _audio_and_energy(random_walk(seconds=6.0, seed=floor, floor=floor))
    assert counted[0].mnl == pytest.approx(heard[0].mnl, abs=0.5)
    assert counted[0].laeq == pytest.approx(heard[0].laeq, abs=0.5)
    assert counted[0].pnl == pytest.approx(heard[0].pnl, abs=1.5)
    assert counted[0].readings == heard[0].readings


@pytest.mark.parametrize("source", SOURCES)
def test_they_agree_on_each_source(source):
    heard, counted = _audio_and_energy(random_walk(seconds=6.0, seed=7), (source,))
    assert counted[0].mnl == pytest.approx(heard[0].mnl, abs=0.5)
    assert counted[0].laeq == pytest.approx(heard[0].laeq, abs=0.5)


def test_they_agree_for_a_listener_and_a_calibrated_floor():
    listener = Microphone((0.0, 2.0, 1.6), "beside")
    heard, counted = _audio_and_energy(
        random_walk(seconds=6.0, seed=8), microphone=listener, gains={"wood": 3.0}
    )
    assert counted[0].mnl == pytest.approx(heard[0].mnl, abs=0.5)


def test_they_agree_at_the_steps_of_training():
    heard, counted = _audio_and_energy(random_walk(seconds=6.0, seed=9, timestep=0.005))
    assert counted[0].mnl == pytest.approx(heard[0].mnl, abs=0.5)


@pytest.mark.parametrize("name", FLOORS)
@pytest.mark.parametrize("mass", [0.3, 0.5, 3.0])
def test_the_exposure_of_a_landing_is_that_of_its_sound(name, mass):
    block = make_block(1000, landings=[(0, 0, 0, 1.0, mass)])
    above = Microphone((FEET[0, 0], FEET[0, 1], 1.0), "world")
    pressure = Soundscape(1, (name,), above, sources=("impacts",)).render(block)
    counted = 10.0 * np.log10(impact_exposure(np.array(mass), FLOOR_TABLE[name]) / 20e-6**2)
    assert counted == pytest.approx(a_weighted_level(pressure)[0], abs=0.05)  # over 1 s


def test_blocks_of_any_length_give_the_same_readings():
    block = random_walk(seconds=1.0, robots=2, seed=10)
    whole, parts = EnergyMeter(2, FLOORS), EnergyMeter(2, FLOORS)
    whole.update(block)
    for first in range(0, block.steps, 37):
        parts.update(block.part(first, first + 37))
    np.testing.assert_allclose(parts.detector.readings, whole.detector.readings, atol=1e-9)
    assert whole.detector.readings.shape == (2, 11)  # at 0.50, 0.55, ... 1.00 s


def test_the_fan_reads_55_dba():
    meter = EnergyMeter(1, FLOORS, sources=("fan",))
    meter.update(make_block(2000))
    result = meter.result()[0]
    assert result.laeq == pytest.approx(55.0, abs=1e-9)
    assert result.mnl == pytest.approx(55.0, abs=0.02)  # the detector started from silence


def test_a_meter_that_heard_nothing_has_no_levels():
    with pytest.raises(ValueError, match="no levels"):
        EnergyMeter(1, FLOORS).result()


def test_steps_that_do_not_fill_a_second_are_refused():
    with pytest.raises(ValueError, match="timestep"):
        EnergyMeter(1, FLOORS).update(make_block(10, timestep=0.003))


def test_the_exposures_of_the_sources_add_up_to_the_level():
    steps = 10000
    block = make_block(steps, landings=[(100 * k, 0, 0, 1.2, 0.5) for k in range(100)])
    meter = EnergyMeter(1, FLOORS)
    meter.update(block.part(0, 3000))
    meter.update(block.part(3000, steps))
    seconds = steps * block.timestep
    total = sum(float(own[0]) for own in meter.exposure.values()) / seconds
    assert 10.0 * np.log10(total / P_REF**2) == pytest.approx(meter.result()[0].laeq, abs=1e-6)
    assert meter.exposure["impacts"][0] == pytest.approx(
        100 * _alone("impacts", make_block(100, landings=[(0, 0, 0, 1.2, 0.5)])), rel=1e-6
    )


def _alone(source: str, block: ContactBlock) -> float:
    meter = EnergyMeter(1, FLOORS, sources=(source,))
    meter.update(block)
    return float(meter.exposure[source][0])
