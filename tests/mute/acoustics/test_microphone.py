"""Where the microphone is."""

import math

import numpy as np
import pytest
from sound_helpers import make_block

from mute.acoustics.microphone import Microphone, distance, mean_square


def _turned_block(quat):
    block = make_block(steps=2)
    block.trunk_pos = np.broadcast_to([1.0, 2.0, 0.3], (2, 1, 3))
    block.trunk_quat = np.broadcast_to(quat, (2, 1, 4))
    return block


QUARTER_TURN = [math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]  # about z, to the left
NOSE_UP = [math.cos(-0.25), 0.0, math.sin(-0.25), 0.0]  # 0.5 rad about y, upwards


def test_the_default_microphone_is_0_30_m_above_the_floor_when_standing():
    position = Microphone().position(make_block(steps=2))
    np.testing.assert_allclose(position[:, 0, 2], 0.30)


def test_a_trunk_microphone_turns_with_the_trunk():
    position = Microphone((0.2, 0.0, 0.1)).position(_turned_block(QUARTER_TURN))
    np.testing.assert_allclose(position[0, 0], [1.0, 2.2, 0.4], atol=1e-12)


def test_a_trunk_microphone_pitches_with_the_trunk():
    position = Microphone((0.2, 0.0, 0.0)).position(_turned_block(NOSE_UP))
    expected = [1.0 + 0.2 * math.cos(0.5), 2.0, 0.3 + 0.2 * math.sin(0.5)]
    np.testing.assert_allclose(position[0, 0], expected, atol=1e-12)


def test_a_listener_beside_follows_the_heading_and_not_the_pitch():
    listener = Microphone((0.0, 1.0, 1.6), "beside")
    turned = listener.position(_turned_block(QUARTER_TURN))
    np.testing.assert_allclose(turned[0, 0], [0.0, 2.0, 1.6], atol=1e-12)
    pitched = listener.position(_turned_block(NOSE_UP))
    np.testing.assert_allclose(pitched[0, 0], [1.0, 3.0, 1.6], atol=1e-12)


def test_a_listener_beside_a_robot_that_rolls_in_a_turn_follows_its_heading():
    # 0.8 rad to the left, then 0.6 rad of roll about its own x: the product of both quaternions.
    cos_yaw, sin_yaw, cos_roll, sin_roll = (f(a) for a in (0.4, 0.3) for f in (math.cos, math.sin))
    quat = [cos_yaw * cos_roll, cos_yaw * sin_roll, sin_yaw * sin_roll, sin_yaw * cos_roll]
    position = Microphone((0.0, 1.0, 1.6), "beside").position(_turned_block(quat))
    expected = [1.0 - math.sin(0.8), 2.0 + math.cos(0.8), 1.6]
    np.testing.assert_allclose(position[0, 0], expected, atol=1e-12)


def test_a_microphone_in_the_world_stays_there():
    position = Microphone((5.0, 6.0, 7.0), "world").position(_turned_block(QUARTER_TURN))
    np.testing.assert_array_equal(position[1, 0], [5.0, 6.0, 7.0])
    assert position.shape == (2, 1, 3)


def test_an_unknown_mount_is_refused():
    with pytest.raises(ValueError, match="mount must be trunk, beside or world"):
        Microphone(mount="ceiling")  # pyright: ignore[reportArgumentType]


def test_an_offset_that_is_no_place_is_refused():
    with pytest.raises(ValueError, match="offset"):
        Microphone((0.0, math.nan, 0.0))


def test_distance_is_never_zero():
    assert distance(np.zeros(3), np.zeros(3)) == pytest.approx(0.05)
    assert distance(np.array([3.0, 0.0, 4.0]), np.zeros(3)) == pytest.approx(5.0)


def test_a_milliwatt_over_a_hard_floor_is_heard_at_1_m_as_its_intensity_says():
    # Intensity W / (2 pi r^2); p^2 = rho c I.
    expected = 413.0 * 1e-3 / (2.0 * math.pi)
    assert mean_square(np.array(1e-3), np.array(1.0)) == pytest.approx(expected, rel=1e-3)
