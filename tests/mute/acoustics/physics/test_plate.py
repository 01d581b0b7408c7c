"""A plate that is struck, against closed forms of structural acoustics and against energy."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from mute.acoustics.air import AIR_DENSITY, AIR_IMPEDANCE, SPEED_OF_SOUND
from mute.acoustics.body import SHELL, load_transmissibility
from mute.acoustics.floors import FLOORS, Floor
from mute.acoustics.physics.plate import Layer, Plate, bonded

STEEL = Layer(thickness=0.01, density=7850.0, modulus=210e9, poisson=0.3, loss=0.002)
BOARD = Layer(thickness=0.022, density=760.0, modulus=3.35e9, poisson=0.3, loss=0.03)
PLATES = [floor.plate for floor in FLOORS.values()]
FREQUENCY = np.geomspace(20.0, 16e3, 200)
_EDGES = np.geomspace(2.0, 40e3, 1001)
_MIDDLE = np.sqrt(_EDGES[1:] * _EDGES[:-1])


def thick(layer, times):
    return dataclasses.replace(layer, thickness=times * layer.thickness)


def wave_speed(layer):
    """Return the speed of longitudinal waves in a sheet, m/s."""
    return math.sqrt(layer.modulus / (layer.density * (1.0 - layer.poisson**2)))


@pytest.mark.parametrize("layer", [STEEL, BOARD])
def test_a_point_gives_way_by_one_over_2_31_rho_c_h_squared(layer):
    # 1 / (8 sqrt(B m'')) with B = rho c_L^2 h^3 / 12.
    expected = math.sqrt(12.0) / (8.0 * layer.density * wave_speed(layer) * layer.thickness**2)
    assert bonded([layer]).mobility == pytest.approx(expected)


@pytest.mark.parametrize("layer", [STEEL, BOARD])
def test_bending_waves_are_as_fast_as_sound_at_the_critical_frequency(layer):
    plate = bonded([layer])
    critical = plate.critical_frequency
    # c^2 / (1.8 c_L h).
    expected = SPEED_OF_SOUND**2 / (1.814 * wave_speed(layer) * layer.thickness)
    assert critical == pytest.approx(expected, rel=1e-3)
    speed = 2.0 * np.pi * np.array([1.0, 4.0]) * critical
    speed /= plate.wave_number(np.array([1.0, 4.0]) * critical)
    # They are dispersive: at four times the frequency twice as fast.
    np.testing.assert_allclose(speed, [SPEED_OF_SOUND, 2.0 * SPEED_OF_SOUND])


def test_10_mm_of_steel_have_the_critical_frequency_of_the_books():
    assert 1150.0 < bonded([STEEL]).critical_frequency < 1250.0  # about 12 Hz m over 10 mm


def test_bonded_layers_of_one_material_are_one_layer():
    one, two, three = bonded([BOARD]), bonded([BOARD, BOARD]), bonded([BOARD] * 3)
    assert two.surface_mass == pytest.approx(2.0 * one.surface_mass)
    assert two.bending_stiffness == pytest.approx(8.0 * one.bending_stiffness)
    assert three.bending_stiffness == pytest.approx(27.0 * one.bending_stiffness)
    assert bonded([thick(BOARD, 2.0)]).bending_stiffness == pytest.approx(two.bending_stiffness)
    assert three.loss == pytest.approx(BOARD.loss)


def test_two_layers_bend_about_the_plane_in_which_nothing_is_stretched():
    top, below = STEEL, BOARD
    pair, turned = bonded([top, below]), bonded([below, top])
    stiff = [layer.modulus * layer.thickness / (1.0 - layer.poisson**2) for layer in (top, below)]
    apart = 0.5 * (top.thickness + below.thickness)
    expected = sum(s * x.thickness**2 / 12.0 for s, x in zip(stiff, (top, below), strict=True))
    expected += stiff[0] * stiff[1] / sum(stiff) * apart**2
    assert pair.bending_stiffness == pytest.approx(expected)
    assert turned.bending_stiffness == pytest.approx(expected)
    assert STEEL.loss < pair.loss < BOARD.loss


def test_the_loss_of_equal_layers_is_their_mean():
    lossy = dataclasses.replace(BOARD, loss=0.07)
    assert bonded([BOARD, lossy]).loss == pytest.approx(0.05)


def test_a_plate_of_nothing_is_refused():
    with pytest.raises(ValueError, match="one layer"):
        bonded([])


def test_modes_are_as_dense_as_those_of_a_plate_that_rests_on_its_edges():
    plate = bonded([BOARD], size=(4.0, 3.0))
    unit = 0.5 * math.pi * math.sqrt(plate.bending_stiffness / plate.surface_mass)
    along, across = np.meshgrid(np.arange(1, 400), np.arange(1, 400), indexing="ij")
    modes = unit * (np.square(along / 4.0) + np.square(across / 3.0))
    assert plate.first_mode == pytest.approx(modes.min())
    low, high = 2000.0, 4000.0
    counted = np.count_nonzero((modes > low) & (modes < high))
    # In a band the modes that the edges cost are few: some of the root of the frequency.
    assert plate.mode_density * (high - low) == pytest.approx(counted, rel=0.03)


@pytest.mark.parametrize("plate", [bonded([STEEL]), bonded([BOARD]), FLOORS["concrete"].plate])
def test_below_the_critical_frequency_a_blow_sounds_like_a_monopole(plate):
    low = 0.05 * plate.critical_frequency
    assert np.abs(plate.direct_pressure(low)) == pytest.approx(
        AIR_DENSITY / (2.0 * np.pi * plate.surface_mass), rel=1e-4
    )
    power = AIR_DENSITY / (2.0 * np.pi * SPEED_OF_SOUND * plate.surface_mass**2)
    assert plate.direct_power(low) == pytest.approx(power, rel=1e-4)


def test_what_is_radiated_at_once_ends_at_the_critical_frequency():
    plate = bonded([BOARD])
    ratio = np.array([1.0, 10.0, 100.0])
    power = plate.direct_power(ratio * plate.critical_frequency) / plate.direct_power(1.0)
    np.testing.assert_allclose(power, 1.0 / (1.0 + ratio**4), rtol=1e-6)


@pytest.mark.parametrize("plate", PLATES)
def test_well_above_the_critical_frequency_bending_waves_radiate_as_pistons(plate):
    critical = plate.critical_frequency
    # 1 / sqrt(1 - f_c / f)
    np.testing.assert_allclose(
        plate.radiation_factor(np.array([8.0, 80.0]) * critical),
        [math.sqrt(8.0 / 7.0), math.sqrt(80.0 / 79.0)],
    )
    factor = plate.radiation_factor(FREQUENCY)
    assert np.all((factor > 0.0) & (factor <= 2.0))


@pytest.mark.parametrize("name", ["wood", "parquet", "laminate"])
def test_a_light_plate_hardly_radiates_two_octaves_below_its_critical_frequency(name):
    plate = FLOORS[name].plate
    assert plate.radiation_factor(0.25 * plate.critical_frequency) < 0.05


def test_radiation_is_a_loss_of_rho_c_over_omega_m():
    plate = bonded([BOARD], edges=0.5)
    frequency = 40.0 * plate.critical_frequency
    expected = AIR_IMPEDANCE / (2.0 * np.pi * frequency * plate.surface_mass)
    loss = plate.radiation_loss(frequency)
    assert loss == pytest.approx(expected / math.sqrt(1.0 - 1.0 / 40.0))
    total = BOARD.loss + 0.5 / math.sqrt(frequency) + 2.0 * loss
    assert plate.total_loss(frequency) == pytest.approx(total)


def test_ringing_falls_by_60_db_in_2_2_over_f_eta():
    plate = bonded([BOARD])
    expected = 2.2 / (FREQUENCY * plate.total_loss(FREQUENCY))
    np.testing.assert_allclose(plate.decay_time(FREQUENCY), expected, rtol=1e-3)


@pytest.mark.parametrize("plate", PLATES)
def test_both_sides_of_a_plate_share_what_it_is_given(plate):
    without = dataclasses.replace(plate, loss=0.0, edges=0.0)
    given = 2.0 * without.ringing_power(FREQUENCY)
    radiated = 2.0 * plate.ringing_power(FREQUENCY)
    assert np.all((radiated > 0.0) & (radiated < given))
    free = dataclasses.replace(without, underlay=0.0)
    np.testing.assert_allclose(2.0 * free.ringing_power(FREQUENCY), plate.mobility)


MASS, SPEED = (
    each.ravel() for each in np.meshgrid([0.2, 0.5, 2.0], [0.05, 0.45, 1.0, 3.0], indexing="ij")
)


def force_squares(floor: Floor):
    """Return the integrals of F^2 of blows over steps of frequency, N^2 s."""
    blow = floor.contact.blow(MASS, SPEED)
    share = np.abs(floor.contact.spectrum(blow.give, blow.duration[:, None] * _MIDDLE))
    return 2.0 * np.square(share * blow.impulse[:, None]) * np.diff(_EDGES)


@pytest.mark.parametrize("name", FLOORS)
def test_no_blow_radiates_more_than_it_lost(name):
    floor = FLOORS[name]
    squares, lost = force_squares(floor), floor.contact.blow(MASS, SPEED).lost
    given = squares.sum(axis=1) * floor.plate.mobility
    ringing = 2.0 * squares @ floor.plate.ringing_power(_MIDDLE)
    direct = 2.0 * squares @ floor.plate.direct_power(_MIDDLE)
    assert np.all(given < lost)
    assert np.all(ringing < given)
    assert np.all(direct < given)
    assert np.all(ringing + direct < 0.2 * lost)


@pytest.mark.parametrize("name", FLOORS)
def test_floor_and_shell_together_radiate_less_than_a_blow_lost(name):
    floor = FLOORS[name]
    squares, lost = force_squares(floor), floor.contact.blow(MASS, SPEED).lost
    sound = np.zeros(len(lost))
    for plate, share in ((floor.plate, 1.0), (SHELL, load_transmissibility())):
        power = plate.ringing_power(_MIDDLE) + plate.direct_power(_MIDDLE)
        sound += 2.0 * share**2 * squares @ power
    # What comes to the shell is taken from what the leg swallows; it is no more than was lost.
    given = load_transmissibility() ** 2 * SHELL.mobility * squares.sum(axis=1)
    assert np.all(sound < 0.3 * lost)
    assert np.all(given < lost)


@pytest.mark.parametrize("plate", PLATES)
def test_far_off_ringing_comes_as_from_a_point(plate):
    distance = np.array([[50.0], [200.0]])
    spread = plate.spread(FREQUENCY, distance) * 2.0 * np.pi * distance**2
    np.testing.assert_allclose(spread, 1.0, atol=2e-3)


@pytest.mark.parametrize("plate", PLATES)
def test_nearer_it_is_louder_but_no_louder_than_from_a_point(plate):
    distance = np.geomspace(0.05, 20.0, 40)[:, None]
    spread = plate.spread(FREQUENCY, distance)
    assert np.all(spread > 0.0)
    assert np.all(np.diff(spread, axis=0) < 0.0)
    # No spot of the plate is nearer than the one under the listener.
    assert np.all(spread < 1.0 / (2.0 * np.pi * distance**2))


def test_a_plate_without_loss_is_heard_as_a_disc():
    # The same from each spot of a disc: ln(1 + R^2 / r^2) / (2 S).
    plate = dataclasses.replace(bonded([BOARD]), loss=1e-9)
    distance = np.array([0.3, 1.0, 4.0])
    disc = np.log1p(plate.area / (np.pi * distance**2)) / (2.0 * plate.area)
    low = 1.0  # there it radiates next to nothing, which is a loss, too
    np.testing.assert_allclose(plate.spread(low, distance), disc, rtol=0.01)


def test_a_plate_of_great_loss_is_heard_where_it_was_struck():
    plate = dataclasses.replace(bonded([BOARD]), loss=2.0)
    distance = np.array([1.0, 2.0])
    spread = plate.spread(4000.0, distance) * 2.0 * np.pi * distance**2
    np.testing.assert_allclose(spread, 1.0, atol=0.02)


def floating(stiffness=8e6):
    """Make the plate of 160 kg / m^2 on a mineral wool."""
    return Plate(160.0, 1e6, 0.03, underlay=stiffness)


def test_a_floating_plate_bounces_at_160_roots_of_stiffness_over_mass():
    # s' in MN / m^3: the standard's form.
    assert floating().floating_frequency == pytest.approx(160.0 * math.sqrt(8.0 / 160.0), rel=0.01)
    assert floating(0.0).floating_frequency == 0.0


def test_a_floating_plate_moves_freely_above_that_and_not_below():
    free, held = floating(0.0), floating()
    f0 = held.floating_frequency
    high, low = 16.0 * f0, np.array([f0 / 10.0, f0 / 20.0])
    for power in (Plate.direct_power, Plate.ringing_power):
        assert power(held, high) == pytest.approx(power(free, high), rel=0.05)
    reduced = Plate.direct_power(held, low) / Plate.direct_power(free, low)
    np.testing.assert_allclose(reduced, [1e-4, 1e-4 / 16.0], rtol=0.06)
    assert np.all(Plate.ringing_power(held, low) < 1e-3 * Plate.ringing_power(free, low))


def test_a_floating_plate_never_radiates_more_than_its_waves_are_given():
    held = floating()
    around = held.floating_frequency * np.geomspace(0.05, 20.0, 200)
    # An underlay takes from the mass, so that more goes in above f0, and all is gone below it.
    given = held.mobility * (1.0 / np.sqrt(1.0 / held.freedom(around))).real
    assert np.all(2.0 * held.ringing_power(around) <= given)
    assert given[0] < 0.02 * held.mobility < 10.0 * given.min()
    assert np.all(floating(0.0).freedom(FREQUENCY) == 1.0)
