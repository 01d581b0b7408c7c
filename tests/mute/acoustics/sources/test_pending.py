"""Sound that is yet to be heard."""

import numpy as np
import pytest

from mute.acoustics.sources.pending import Pending

FIRST, SECOND = np.array(0), np.array(1)


def _sounds():
    generator = np.random.default_rng(0)
    return [(5, generator.normal(size=20)), (0, generator.normal(size=7)), (12, np.ones(3))]


def test_sounds_come_at_their_offsets_and_add_up():
    pending, expected = Pending(1), np.zeros(30)
    for offset, sound in _sounds():
        pending.add(FIRST, offset, sound)
        expected[offset : offset + len(sound)] += sound
    np.testing.assert_allclose(pending.take(30)[0], expected)


@pytest.mark.parametrize("length", [1, 4, 13, 100])
def test_pieces_of_any_length_are_the_whole(length):
    whole, pieces = Pending(1), Pending(1)
    for offset, sound in _sounds():
        whole.add(FIRST, offset, sound)
        pieces.add(FIRST, offset, sound)
    taken = [pieces.take(length) for _ in range(-(-30 // length))]
    np.testing.assert_allclose(np.concatenate(taken, axis=1)[:, :30], whole.take(30))


def test_an_offset_counts_from_the_next_sample():
    pending = Pending(1)
    pending.add(FIRST, 0, np.ones(4))
    pending.take(3)
    pending.add(FIRST, 2, np.full(2, 5.0))
    np.testing.assert_allclose(pending.take(6)[0], [1.0, 0.0, 5.0, 5.0, 0.0, 0.0])


def test_what_was_heard_is_forgotten():
    pending = Pending(2)
    pending.add(slice(None), 0, np.ones((2, 5)))
    assert pending.take(5).all()
    assert not pending.take(5).any()


def test_each_robot_has_its_own():
    pending = Pending(3)
    pending.add(SECOND, 2, np.ones(4))
    heard = pending.take(8)
    assert heard.shape == (3, 8)
    np.testing.assert_allclose(heard.sum(axis=1), [0.0, 4.0, 0.0])


def test_to_take_nothing_leaves_all():
    pending = Pending(1)
    pending.add(FIRST, 0, np.ones(4))
    assert pending.take(0).shape == (1, 0)
    np.testing.assert_allclose(pending.take(4)[0], np.ones(4))


def test_many_sounds_add_up_also_where_they_overlap():
    robots, offsets = np.array([0, 1, 0]), np.array([2, 0, 3])
    sounds = np.arange(12.0).reshape(3, 4)
    pending, expected = Pending(2), Pending(2)
    pending.add_all(robots, offsets, sounds)
    for robot, offset, sound in zip(robots, offsets, sounds, strict=True):
        expected.add(robot, offset, sound)
    np.testing.assert_allclose(pending.take(9), expected.take(9))


def test_no_sounds_are_silence():
    pending = Pending(1)
    pending.add_all(np.zeros(0, dtype=int), np.zeros(0, dtype=int), np.zeros((0, 4)))
    assert not pending.take(5).any()
