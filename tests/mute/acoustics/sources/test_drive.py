"""Teeth that meet, tones of motors and gears."""

import math

import numpy as np
import pytest
from sound_helpers import RATE, a_weighted_level, level, make_block

from mute.acoustics.metering.levels import P_REF
from mute.acoustics.microphone import Microphone
from mute.acoustics.sources.drive import (
    BACKLASH,
    GEAR_RATIO,
    INERTIA,
    LEVER,
    POLE_PAIRS,
    RING_TEETH,
    STIFFNESS,
    TONES,
    DriveExposure,
    DriveSound,
    Joints,
    Teeth,
    pulse_duration,
    tone_forces,
)
from mute.acoustics.sources.shell import shell_response

SHARE = 0.05
ONE_METRE_AHEAD = Microphone((1.0, 0.0, 0.3), "world")


def _torques(torque, joint=0, timestep=0.001, **how):
    """Make a robot of one joint whose torque takes a course, N m."""
    torques = np.zeros((len(torque), 1, 12))
    torques[:, 0, joint] = torque
    return make_block(len(torque), timestep=timestep, joint_torque=torques, **how)


def _jump(torque, joint=0, steps=600, at=10):
    course = np.full(steps, torque)
    course[:at] *= -1.0
    return _torques(course, joint)


def _meet(block):
    return Teeth(block.num_robots).meet(block)


def _energy(met):
    """Return the energies with which teeth met, J."""
    return np.square(met.force * LEVER) / (2.0 * INERTIA[met.joint])


def _hear(block, microphone=ONE_METRE_AHEAD, share=SHARE):
    sound = DriveSound(block.num_robots, RATE, share)
    return sound.render(block, microphone.position(block), np.arange(block.steps + 1) * 48)


def _bounds(steps):
    return np.arange(steps + 1) * RATE // 1000


@pytest.mark.parametrize("joint", [0, 2])
@pytest.mark.parametrize("torque", [0.3, -4.0, 12.0])
def test_after_a_jump_of_the_torque_teeth_meet_with_its_work_over_the_play(torque, joint):
    met = _meet(_jump(torque, joint))
    assert list(met.joint) == [joint]
    assert _energy(met)[0] == pytest.approx(BACKLASH * abs(torque), rel=1e-9)
    assert np.sign(met.force[0]) == np.sign(torque)


def test_after_a_jump_teeth_meet_when_the_rotor_has_crossed_the_play():
    crossing = math.sqrt(2.0 * BACKLASH * INERTIA[0] / 0.3)
    met = _meet(_jump(0.3, at=10))
    assert met.step[0] == 10 + math.floor(crossing / 0.001)


@pytest.mark.parametrize("slope", [20.0, 500.0])
def test_a_torque_that_rises_through_zero_makes_teeth_meet_with_its_closed_form(slope):
    timestep = 2e-5
    ramp = slope * timestep * (np.arange(3000) - 499.5)
    energy = _energy(_meet(_torques(ramp, timestep=timestep)))
    expected = INERTIA[0] ** (1 / 3) * slope ** (2 / 3) * (6.0 * BACKLASH) ** (4 / 3) / 8.0
    assert energy == pytest.approx([expected], rel=0.01)


def test_at_the_steps_of_physics_a_ramp_is_within_two_tenths_of_a_decibel():
    ramp = 100.0 * 0.001 * (np.arange(300) - 99.5)
    energy = _energy(_meet(_torques(ramp)))
    expected = INERTIA[0] ** (1 / 3) * 100.0 ** (2 / 3) * (6.0 * BACKLASH) ** (4 / 3) / 8.0
    assert 10.0 * np.log10(energy / expected) == pytest.approx([0.0], abs=0.2)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_without_a_change_of_sign_no_teeth_meet(sign):
    torque = sign * (5.0 + 4.9 * np.sin(np.arange(1000) / 7.0))
    assert len(_meet(_torques(torque)).step) == 0


def test_every_change_of_sign_makes_teeth_meet_once_on_the_side_that_it_presses_on():
    torque = 8.0 * np.sin(2.0 * np.pi * 5.0 * (np.arange(1000) + 0.5) / 1000.0)
    met = _meet(_torques(torque))
    np.testing.assert_array_equal(np.sign(met.force), np.resize([-1.0, 1.0], 9))
    assert (np.diff(met.step) > 80).all()


def test_a_change_of_sign_that_is_too_short_makes_nothing_meet_on_the_other_side():
    torque = np.full(100, 3.0)
    torque[50] = -3.0  # in 1 ms the rotor comes 0.4 mrad far, and then back
    met = _meet(_torques(torque))
    assert (met.force > 0.0).all()


def test_blocks_of_any_length_make_the_same_teeth_meet():
    generator = np.random.default_rng(0)
    block = make_block(200, robots=2, joint_torque=generator.normal(0.0, 5.0, (200, 2, 12)))
    whole = _meet(block)
    teeth = Teeth(2)
    parts = [(first, teeth.meet(block.part(first, first + 23))) for first in range(0, 200, 23)]
    assert len(whole.step) > 100
    np.testing.assert_array_equal(
        np.concatenate([first + part.step for first, part in parts]), whole.step
    )
    for name in ("robot", "joint", "force"):
        joined = np.concatenate([getattr(part, name) for _, part in parts])
        np.testing.assert_allclose(joined, getattr(whole, name))


def test_teeth_press_on_each_other_for_half_a_period_of_rotor_and_gear():
    for joint in (0, 2):
        omega = math.sqrt(STIFFNESS / (1.11842e-4 * GEAR_RATIO[joint] ** 2))
        assert pulse_duration(np.array([joint]))[0] == pytest.approx(math.pi / omega)


@pytest.mark.parametrize("joint", [0, 2])
def test_teeth_that_meet_are_heard_as_half_a_sine_through_the_shell(joint):
    # Less the constant torque, whose uneven share is the same on both sides.
    sound = (_hear(_jump(5.0, joint)) - _hear(_torques(np.full(600, 5.0), joint)))[0]
    meeting = 10 + math.floor(math.sqrt(2.0 * BACKLASH * INERTIA[joint] / 5.0) / 0.001)
    duration = math.pi * math.sqrt(INERTIA[joint] / STIFFNESS)
    impulse = math.sqrt(2.0 * INERTIA[joint] * BACKLASH * 5.0) / LEVER
    fine = (np.arange(600 * 500) + 0.5) / (500 * RATE)
    sine = np.sin(np.pi * fine / duration) * (fine < duration) * impulse * np.pi / (2.0 * duration)
    force = sine.reshape(600, 500).mean(axis=1)
    expected = np.convolve(force, SHARE * shell_response(RATE).impulse(0))
    heard = sound[48 * meeting :]
    expected = np.pad(expected, (0, len(heard)))[: len(heard)]
    assert not np.abs(sound[: 48 * meeting]).max() > 1e-4 * np.abs(sound).max()
    np.testing.assert_allclose(heard, expected, atol=2e-3 * np.abs(expected).max())


def test_tones_are_where_joint_speed_puts_them():
    # At a turn a second of the joint: 6 p N and Z Hz.
    for joint in (0, 2):
        torque = np.full(1000, 7.0)
        block = _torques(torque, joint, joint_vel=2.0 * math.pi)
        force = tone_forces(block, Joints.before(block), _bounds(1000))[0]
        spectrum = np.abs(np.fft.rfft(force)) / (RATE / 2.0)
        peaks = np.flatnonzero(spectrum > 0.5 * spectrum.max())
        poles = 6 * POLE_PAIRS * int(GEAR_RATIO[joint])
        assert {RING_TEETH, poles} == {int(peak) for peak in peaks}


@pytest.mark.parametrize("speed", [1.0, 3.0])
def test_tones_follow_the_joints_speed(speed):
    block = _torques(np.full(1000, 7.0), joint_vel=2.0 * math.pi * speed)
    force = tone_forces(block, Joints.before(block), _bounds(1000))[0]
    spectrum = np.abs(np.fft.rfft(force))
    assert spectrum[round(6 * POLE_PAIRS * 6 * speed)] > 20.0 * spectrum[4 * RING_TEETH]


def test_tones_have_the_share_of_the_torque_that_they_are():
    block = _torques(np.full(1000, -7.0), joint_vel=2.0 * math.pi)
    force = tone_forces(block, Joints.before(block), _bounds(1000))[0]
    spectrum = np.abs(np.fft.rfft(force)) / (RATE / 2.0)
    for periods, uneven in TONES:
        tone = spectrum[round(periods[0])]
        assert tone == pytest.approx(uneven * 7.0 / LEVER, rel=0.01)


def _joints_at_random(steps):
    generator = np.random.default_rng(0)
    return make_block(
        steps,
        robots=2,
        joint_vel=generator.normal(0.0, 5.0, (steps, 2, 12)),
        joint_torque=generator.normal(0.0, 5.0, (steps, 2, 12)),
    )


def test_tones_follow_angles_and_torques_that_change_at_any_sample_rate():
    block, rate = _joints_at_random(40), 44_100  # 44 or 45 samples a step
    bounds = np.arange(41) * rate // 1000
    force = tone_forces(block, Joints.before(block), bounds)
    position = np.concatenate((block.joint_pos[:1], block.joint_pos))
    torque = np.abs(np.concatenate((block.joint_torque[:1], block.joint_torque)))
    at = np.concatenate(
        [step + np.arange(count) / count for step, count in enumerate(np.diff(bounds))]
    )
    expected = np.zeros((2, len(at)))
    for robot, joint in np.ndindex(2, 12):
        size = np.interp(at, np.arange(41), torque[:, robot, joint])
        angle = np.interp(at, np.arange(41), position[:, robot, joint])
        for periods, uneven in TONES:
            expected[robot] += uneven / LEVER * size * np.cos(periods[joint] * angle)
    np.testing.assert_allclose(force, expected, atol=1e-3 * np.abs(expected).max())


def test_tones_of_blocks_in_a_row_are_those_of_the_whole():
    block = _joints_at_random(40)
    bounds = _bounds(40)
    whole = tone_forces(block, Joints.before(block), bounds)
    first, rest = block.part(0, 15), block.part(15, 40)
    parts = (
        tone_forces(first, Joints.before(first), bounds[:16]),
        tone_forces(rest, Joints.after(first), bounds[15:]),
    )
    np.testing.assert_allclose(np.concatenate(parts, axis=1), whole, atol=1e-4)


def test_joints_that_rest_without_a_torque_are_silent():
    assert not _hear(_torques(np.zeros(100))).any()
    assert not DriveExposure(1, RATE, SHARE).squares(_torques(np.zeros(100))).any()


def test_a_robot_that_stands_is_silent():
    # What a constant torque begins with has rung out.
    standing, moving = (_hear(_torques(np.full(900, 10.0), joint_vel=v))[0] for v in (0.0, 4.0))
    assert a_weighted_level(standing[RATE // 2 :]) < a_weighted_level(moving[RATE // 2 :]) - 20.0
    assert a_weighted_level(standing[RATE // 2 :]) < 0.0
    assert not DriveExposure(1, RATE, SHARE).squares(_torques(np.full(900, 10.0))).any()


def test_four_times_as_far_the_drive_is_12_04_db_quieter():
    block = _joints_at_random(200)
    near, far = (_hear(block, Microphone((r, 0.0, 0.3), "world")) for r in (0.5, 2.0))
    np.testing.assert_allclose(level(near) - level(far), 12.0412, atol=1e-3)


def test_ten_times_the_share_is_20_db_more():
    block = _joints_at_random(200)
    little, much = (_hear(block, share=share) for share in (0.004, 0.04))
    np.testing.assert_allclose(level(much) - level(little), 20.0, atol=1e-3)
    counted = [DriveExposure(2, RATE, share).squares(block) for share in (0.004, 0.04)]
    np.testing.assert_allclose(counted[1], 100.0 * counted[0])


@pytest.mark.parametrize("speed", [2.0, 6.0])
def test_the_exposure_of_tones_is_that_of_their_sound(speed):
    block = _torques(np.full(1500, 7.0), 2, joint_vel=speed)
    counted = DriveExposure(1, RATE, SHARE).squares(block).mean()
    heard = a_weighted_level(_hear(block)[0, -RATE:])
    assert 10.0 * math.log10(counted / P_REF**2) == pytest.approx(heard, abs=0.2)


def test_a_joint_of_no_speed_at_all_is_no_error():
    # A simulation of somebody else's may blow up.
    for speed in (math.nan, math.inf, 1e6):
        block = _torques(np.full(20, 7.0), 2, joint_vel=speed)
        assert DriveExposure(1, RATE, SHARE).squares(block).shape == (20, 1)


@pytest.mark.parametrize("joint", [0, 2])
def test_the_exposure_of_teeth_that_meet_is_that_of_their_sound(joint):
    block = _jump(5.0, joint, steps=1000)
    counted = DriveExposure(1, RATE, SHARE).squares(block).sum() * block.timestep
    sound = _hear(block) - _hear(_torques(np.full(1000, 5.0), joint))
    expected = a_weighted_level(sound[0])  # over 1 s
    assert 10.0 * math.log10(counted / P_REF**2) == pytest.approx(expected, abs=0.1)
