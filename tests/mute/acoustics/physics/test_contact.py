"""A blow, against Hertz, against the phase plane and against a spring on a dashpot."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mute.acoustics.physics.contact import (
    ContactLaw,
    hertz_duration,
    hertz_stiffness,
    series_modulus,
)

MASS, SPEED, STIFFNESS = 0.5, 0.45, 8e5
RIGID = {e: ContactLaw(STIFFNESS, 1.5, e) for e in (1.0, 0.7, 0.5)}
YIELDS = (0.0, 0.05, 0.4, 3.0)
"""Relative mobilities, from a rigid ground to one that hardly resists."""


def yielding(give, exponent=1.5, restitution=1.0):
    """Make a contact whose ground gives way by so much under the usual blow."""
    rigid = ContactLaw(STIFFNESS, exponent, restitution)
    mobility = give * float(rigid.depth(MASS, SPEED)) / (MASS * SPEED)
    return ContactLaw(STIFFNESS, exponent, restitution, mobility)


def course(law, points=4096):
    """Return the force of the usual blow at equal steps, N, and how long a step is, s."""
    blow = law.blow(MASS, SPEED)
    passed = law.passed(blow.give.reshape(1), np.linspace(0.0, 1.0, points + 1)[None])[0]
    step = float(blow.duration) / points
    return np.diff(passed) * float(blow.impulse) / step, step


def test_bodies_give_way_one_after_the_other():
    soft, hard = (2e6, 0.5), (30e9, 0.2)
    assert series_modulus(soft) == pytest.approx(2e6 / 0.75)
    assert series_modulus(soft, soft) == pytest.approx(1e6 / 0.75)
    assert 1.0 / series_modulus(soft, hard) == pytest.approx(0.75 / 2e6 + 0.96 / 30e9)


def test_a_sphere_presses_as_hertz_says():
    # A ball of 10 mm radius on a plane, both of steel: d^3 = 9 F^2 / (16 R E*^2).
    modulus = series_modulus((210e9, 0.3), (210e9, 0.3))
    depth = (9.0 * 100.0**2 / (16.0 * 0.01 * modulus**2)) ** (1.0 / 3.0)
    assert hertz_stiffness(0.01, modulus) * depth**1.5 == pytest.approx(100.0)


def test_a_blow_without_loss_lasts_2_943_of_depth_over_speed():
    law = RIGID[1.0]
    depth = (1.25 * MASS * SPEED**2 / STIFFNESS) ** 0.4
    assert law.depth(MASS, SPEED) == pytest.approx(depth)
    expected = 2.943 * depth / SPEED
    assert hertz_duration(MASS, SPEED, STIFFNESS) == pytest.approx(expected, rel=1e-3)
    # The table ends a blow at a thousandth of its peak: it is some 0.4 % shorter.
    assert float(law.blow(MASS, SPEED).duration) == pytest.approx(expected, rel=5e-3)


def test_a_linear_spring_holds_a_blow_for_half_a_period():
    expected = math.pi * math.sqrt(MASS / STIFFNESS)
    assert hertz_duration(MASS, SPEED, STIFFNESS, 1.0) == pytest.approx(expected)
    law = ContactLaw(STIFFNESS, 1.0, 1.0)
    assert float(law.blow(MASS, SPEED).duration) == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize("restitution", [1.0, 0.9995, 0.99, 0.7, 0.3, 0.05])
def test_the_damping_leaves_the_restitution(restitution):
    u = ContactLaw(STIFFNESS, 1.5, restitution).damping
    integral = math.log((1.0 + u) / (1.0 - restitution * u))
    assert integral == pytest.approx(u * (1.0 + restitution), abs=1e-6)
    assert (u > 0.0) == (restitution < 1.0)
    if restitution > 0.98:  # where Hunt and Crossley have e = 1 - 2 u / 3
        assert u == pytest.approx(1.5 * (1.0 - restitution), rel=0.02)


@pytest.mark.parametrize("restitution", RIGID)
def test_a_rigid_ground_gives_back_what_the_restitution_says(restitution):
    blow = RIGID[restitution].blow(MASS, SPEED)
    assert float(blow.impulse) == pytest.approx((1.0 + restitution) * MASS * SPEED, rel=1e-4)
    energy = 0.5 * MASS * SPEED**2
    assert float(blow.lost) / energy == pytest.approx(1.0 - restitution**2, abs=1e-4)


@pytest.mark.parametrize("exponent", [1.5, 2.5])
def test_on_a_rigid_ground_durations_go_with_powers_of_mass_and_speed(exponent):
    law = ContactLaw(STIFFNESS, exponent, 0.7)
    mass, speed = np.array([0.3, 0.3, 2.4]), np.array([0.1, 0.8, 0.1])
    light, fast, heavy = law.blow(mass, speed).duration
    share = 1.0 / (exponent + 1.0)
    # For a sphere m^(2/5) v^(-1/5).
    assert fast / light == pytest.approx(8.0 ** (2.0 * share - 1.0))
    assert heavy / light == pytest.approx(8.0**share)


@pytest.mark.parametrize("give", YIELDS[1:])
def test_a_spring_on_a_ground_that_yields_is_a_spring_beside_a_dashpot(give):
    # F'' + k Y F' + k F / m = 0: half a period of an oscillator with the damping ratio y / 2.
    blow = yielding(give, exponent=1.0).blow(MASS, SPEED)
    assert float(blow.give) == pytest.approx(give)
    ratio = 0.5 * give
    if ratio < 1.0:
        root = math.sqrt(1.0 - ratio**2)
        left = math.exp(-math.pi * ratio / root)
        duration = math.pi / (math.sqrt(STIFFNESS / MASS) * root)
        assert float(blow.duration) == pytest.approx(duration, rel=0.01)
    else:
        left = 0.0  # it creeps into the ground and stays there
    assert float(blow.impulse) / (MASS * SPEED) == pytest.approx(1.0 + left, abs=3e-3)
    assert float(blow.lost) / (0.5 * MASS * SPEED**2) == pytest.approx(1.0 - left**2, abs=3e-3)


@pytest.mark.parametrize("give", YIELDS[1:])
def test_what_a_blow_without_loss_leaves_in_the_ground_is_what_it_lost(give):
    law = yielding(give)
    force, step = course(law)
    ground = law.mobility * np.square(force).sum() * step
    # The shape is kept at 257 points, and between the grounds of a table.
    assert ground == pytest.approx(float(law.blow(MASS, SPEED).lost), rel=0.03)


@pytest.mark.parametrize("restitution", [1.0, 0.5])
def test_a_ground_never_gives_way_faster_than_the_body_comes(restitution):
    peaks = []
    for give in YIELDS:
        law = yielding(give, restitution=restitution)
        force, _ = course(law)
        peaks.append(force.max())
        assert force.max() * law.mobility < SPEED
    assert np.all(np.diff(peaks) < 0.0)


def test_rubber_on_a_ground_that_yields_obeys_the_law_of_both():
    law = yielding(0.4, restitution=0.5)
    u, give = law.damping, law.mobility

    def pressed(speed, depth):
        """Return how fast it closes, and F, of F = k d^n (1 + u d' / v) and d' = w - Y F."""
        spring = STIFFNESS * max(depth, 0.0) ** 1.5
        closing = (speed - give * spring) / (1.0 + u * give * spring / SPEED)
        return closing, spring * (1.0 + u * closing / SPEED)

    def rates(_, state):
        closing, force = pressed(*state[:2])
        heat = force * closing - STIFFNESS * max(state[1], 0.0) ** 1.5 * closing
        return [-force / MASS, closing, give * force**2, heat]

    blow = law.blow(MASS, SPEED)
    times = (0.0, float(blow.duration))
    end = solve_ivp(rates, times, [SPEED, 0.0, 0.0, 0.0], rtol=1e-8, atol=1e-10).y[:, -1]
    left, _, ground, heat = end
    assert float(blow.impulse) == pytest.approx(MASS * (SPEED - left), rel=3e-3)
    assert float(blow.lost) == pytest.approx(0.5 * MASS * (SPEED**2 - left**2), rel=3e-3)
    # Both have their share, and nothing goes elsewhere.
    assert min(ground, heat) > 0.1 * float(blow.lost)
    assert ground + heat == pytest.approx(float(blow.lost), rel=3e-3)


def test_a_softer_ground_takes_longer_and_more_of_the_energy():
    blows = [yielding(give, restitution=0.7).blow(MASS, SPEED) for give in YIELDS]
    assert np.all(np.diff([float(blow.duration) for blow in blows]) > 0.0)
    assert np.all(np.diff([float(blow.lost) for blow in blows]) > 0.0)
    assert np.all(np.diff([float(blow.impulse) for blow in blows]) < 0.0)


def test_no_blow_gives_back_more_than_it_had():
    mass, speed = np.meshgrid(np.geomspace(0.05, 20.0, 9), np.geomspace(1e-3, 10.0, 9))
    for mobility in (0.0, 1e-5, 1e-3, 1e-1):
        blow = ContactLaw(STIFFNESS, 1.5, 0.7, mobility).blow(mass, speed)
        energy = 0.5 * mass * np.square(speed)
        assert blow.lost.shape == mass.shape
        assert np.all(blow.lost < energy * (1.0 + 1e-9))
        assert np.all(blow.lost > 0.5 * energy)  # of e = 0.7 half, and more of a yielding ground
        assert np.all((blow.impulse > 0.99 * mass * speed) & (blow.impulse < 1.71 * mass * speed))


def test_a_force_begins_rises_and_is_over():
    law = yielding(0.0, restitution=0.7)
    give = np.array(YIELDS)
    passed = law.passed(give, np.tile(np.linspace(-0.5, 1.5, 1001), (len(give), 1)))
    assert np.all(np.diff(passed, axis=1) >= 0.0)
    assert not passed[:, :251].any()
    np.testing.assert_allclose(passed[:, 750:], 1.0)
    assert np.all((passed[:, 500] > 0.4) & (passed[:, 500] < 1.0))  # no later than its middle


def test_a_blow_without_loss_is_the_same_backwards():
    elapsed = np.linspace(0.0, 1.0, 101)[None]
    passed = RIGID[1.0].passed(np.zeros(1), elapsed)
    # The faint end is cut off, 0.4 % of the time.
    np.testing.assert_allclose(passed, 1.0 - passed[:, ::-1], atol=0.01)


@pytest.mark.parametrize("give", YIELDS)
def test_the_spectrum_is_the_transform_of_the_force(give):
    law = yielding(0.0, restitution=0.7)
    gives, points, cycles = np.array([give]), 4096, np.arange(8.0)
    force = np.diff(law.passed(gives, np.linspace(0.0, 1.0, points + 1)[None]))
    # A sample stands for the middle of its interval.
    transform = np.fft.rfft(force)[:, : len(cycles)] * np.exp(-1j * np.pi * cycles / points)
    spectrum = law.spectrum(gives, cycles[None])
    assert spectrum[0, 0] == pytest.approx(1.0)
    np.testing.assert_allclose(spectrum, transform, atol=1e-5)
    assert np.all(np.abs(spectrum[0, 1:]) < 1.0)


def test_a_half_sine_has_the_spectrum_of_one():
    # A linear spring without loss: cos(pi c) / (1 - 4 c^2), 1 at 0 and 0 at 3/2.
    law, cycles = ContactLaw(STIFFNESS, 1.0, 1.0), np.array([[0.25, 1.0, 1.5, 3.0]])
    expected = np.abs(np.cos(np.pi * cycles) / (1.0 - 4.0 * cycles**2))
    np.testing.assert_allclose(np.abs(law.spectrum(np.zeros(1), cycles)), expected, atol=2e-3)
