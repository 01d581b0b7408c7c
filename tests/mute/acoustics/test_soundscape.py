"""All sources together, streamed."""

import dataclasses
import os
import select
import signal

import numpy as np
import pytest
from sound_helpers import make_block, random_walk

from mute.acoustics import soundscape
from mute.acoustics.body import load_transmissibility
from mute.acoustics.soundscape import SOURCES, Soundscape, check_sources

FLOORS = ("tile", "carpet")
CLOSE = 1e-6
"""Share of the largest pressure: samples are single precision."""


def _in_parts(block, length, sample_rate=48000, **options):
    sound = Soundscape(block.num_robots, FLOORS, sample_rate=sample_rate, **options)
    starts = range(0, block.steps, length)
    return np.concatenate([sound.render(block.part(k, k + length)) for k in starts], axis=1)


def _assert_close(heard, expected):
    np.testing.assert_allclose(heard, expected, rtol=0.0, atol=CLOSE * np.abs(expected).max())


def _on_two_floors(seconds, robots, seed):
    block = random_walk(seconds, robots, seed, landings_per_second=40)
    block.floor = (np.arange(block.steps) // 25)[:, None, None] % 2 + np.zeros((1, robots, 4), int)
    block.impacts.floor = block.floor[block.impact_steps(), 0, 0]
    return block


@pytest.mark.parametrize(
    ("length", "sample_rate", "seconds"),
    [(1, 48000, 0.06), (7, 44100, 0.2), (20, 48000, 0.4), (501, 44100, 0.4)],
)
def test_streamed_equals_whole(length, sample_rate, seconds):
    block = _on_two_floors(seconds, robots=2, seed=3)
    whole = Soundscape(2, FLOORS, sample_rate=sample_rate).render(block)
    parts = _in_parts(block, length, sample_rate)
    assert parts.shape == whole.shape == (2, round(seconds * sample_rate))
    _assert_close(parts, whole)


def test_sources_side_by_side_sound_as_one_after_the_other(monkeypatch):
    block = _on_two_floors(seconds=0.4, robots=5, seed=6)
    beside = Soundscape(5, FLOORS).render(block)
    monkeypatch.setattr(soundscape, "_MANY", 1000)
    np.testing.assert_array_equal(Soundscape(5, FLOORS).render(block), beside)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are not copied here")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_process_that_is_copied_still_hears():
    block = _on_two_floors(seconds=0.1, robots=4, seed=7)
    expected = Soundscape(4, FLOORS).render(block)
    pipe, into = os.pipe()
    child = os.fork()
    if not child:
        try:
            os.write(into, Soundscape(4, FLOORS).render(block).tobytes()[-64:])
        finally:
            os._exit(0)
    ready, _, _ = select.select([pipe], [], [], 60.0)
    if not ready:
        os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    assert ready, "the copy of the process hangs"
    assert os.read(pipe, 64) == expected.tobytes()[-64:]


@pytest.mark.parametrize("source", SOURCES)
def test_every_source_streams(source):
    block = _on_two_floors(seconds=0.3, robots=2, seed=4)
    whole = Soundscape(2, FLOORS, sources=(source,)).render(block)
    assert whole.any(axis=1).all()
    _assert_close(_in_parts(block, 37, sources=(source,)), whole)


def test_the_mix_is_the_sum_of_the_sources_alone():
    block = random_walk(seconds=0.5, seed=5)
    mix = Soundscape(1, FLOORS).render(block)
    alone = [Soundscape(1, FLOORS, sources=(name,)).render(block) for name in SOURCES]
    _assert_close(mix, np.sum(alone, axis=0))


def test_a_source_sounds_the_same_whatever_else_is_heard():
    block = random_walk(seconds=0.2, seed=5)
    without = Soundscape(1, FLOORS, sources=("impacts", "body", "drive", "fan")).render(block)
    scuffing = Soundscape(1, FLOORS, sources=("scuffing",)).render(block)
    _assert_close(without + scuffing, Soundscape(1, FLOORS).render(block))


def test_equal_seeds_give_equal_sound_and_others_do_not():
    block = random_walk(seconds=0.2, robots=2)
    first, again, other = (Soundscape(2, FLOORS, seed=s).render(block) for s in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.allclose(first, other, atol=1e-3)


def test_the_seed_is_that_of_noise_and_of_nothing_else():
    block = random_walk(seconds=0.2)
    first, other = (
        Soundscape(1, FLOORS, seed=s, sources=("impacts", "body", "drive")).render(block)
        for s in (1, 2)
    )
    np.testing.assert_array_equal(first, other)


def test_robots_do_not_share_their_noise():
    pressure = Soundscape(2, FLOORS, sources=("fan",)).render(make_block(2000, robots=2))
    assert abs(np.corrcoef(pressure[0], pressure[1]).item(1)) < 0.05


@pytest.mark.parametrize("source", ["body", "drive"])
def test_what_comes_through_the_legs_goes_with_the_transmissibility(source):
    block = random_walk(seconds=0.3, seed=2)
    little, much = (
        Soundscape(1, FLOORS, sources=(source,), transmissibility=share).render(block)
        for share in (0.01, 0.1)
    )
    _assert_close(10.0 * little, much)


@pytest.mark.parametrize("source", ["impacts", "scuffing", "fan"])
def test_the_rest_does_not_go_with_the_transmissibility(source):
    block = random_walk(seconds=0.3, seed=2)
    without, much = (
        Soundscape(1, FLOORS, sources=(source,), transmissibility=share).render(block)
        for share in (0.0, 0.1)
    )
    np.testing.assert_array_equal(without, much)


def test_with_no_share_of_the_force_the_shell_is_silent():
    sources = ("body", "drive")
    silent = Soundscape(1, FLOORS, sources=sources, transmissibility=0.0)
    assert not silent.render(random_walk(seconds=0.2)).any()


def test_the_share_is_the_calibrations_unless_told_otherwise():
    block = random_walk(seconds=0.2)
    default, same = (
        Soundscape(1, FLOORS, sources=("body",), transmissibility=share).render(block)
        for share in (None, load_transmissibility())
    )
    np.testing.assert_array_equal(default, same)


def test_a_pulse_that_reaches_over_the_end_of_a_block_goes_on_in_the_next():
    block = make_block(100, landings=[(49, 0, 0, 0.4, 1.5)])
    sound = Soundscape(1, FLOORS, sources=("impacts",))
    first, second = sound.render(block.part(0, 50)), sound.render(block.part(50, 100))
    # It is still on its way; a filter between samples begins with next to nothing.
    assert np.abs(first).max() < 1e-3 * np.abs(second).max()


def test_blocks_of_samples_tile_time_at_odd_rates():
    block = make_block(1000)
    sound = Soundscape(1, FLOORS, sample_rate=22050, sources=("fan",))
    starts = range(0, 1000, 3)
    counts = [sound.render(block.part(first, first + 3)).shape[1] for first in starts]
    assert sum(counts) == 22050
    assert set(counts) == {66, 67, 22}  # 66.15 in 3 ms, 22.05 in the last block of 1 ms


def test_pressure_is_float32_and_has_a_row_for_each_robot():
    pressure = Soundscape(3, FLOORS).render(make_block(10, robots=3))
    assert pressure.dtype == np.float32
    assert pressure.shape == (3, 480)


def test_a_block_that_leaves_a_gap_is_refused():
    block = make_block(100)
    sound = Soundscape(1, FLOORS)
    sound.render(block.part(0, 50))
    with pytest.raises(ValueError, match=r"block starts at 0\.06 s, not at 0\.05 s"):
        sound.render(block.part(60, 100))


def test_a_recording_may_begin_at_any_time():
    block = random_walk(seconds=0.3, landings_per_second=40)
    sound = Soundscape(1, FLOORS, sources=("impacts",))
    assert sound.render(block.part(123, 300)).shape == (1, 177 * 48)


def test_a_block_of_another_number_of_robots_is_refused():
    with pytest.raises(ValueError, match="block has 2 robots, not 1"):
        Soundscape(1, FLOORS).render(make_block(10, robots=2))


def test_an_unknown_floor_is_refused():
    with pytest.raises(ValueError, match="'moss' is not known"):
        Soundscape(1, ("moss",))


def test_an_unknown_source_is_refused():
    with pytest.raises(ValueError, match=r"sources must be of impacts, .*, got 'barking'"):
        Soundscape(1, FLOORS, sources=("barking",))


def test_a_silent_soundscape_is_refused():
    with pytest.raises(ValueError, match=r"sources must be of impacts, .*, got none"):
        Soundscape(1, FLOORS, sources=())


def test_a_sample_rate_that_hears_no_step_is_refused():
    with pytest.raises(ValueError, match="sample_rate must be at least 8000 Hz, got 4000"):
        Soundscape(1, FLOORS, sample_rate=4000)


def test_sources_that_can_be_heard_are_given_back():
    assert check_sources(["fan", "body"]) == ("fan", "body")


def test_parts_of_a_block_hold_each_impact_once():
    block = random_walk(seconds=0.5, landings_per_second=100)
    parts = [block.part(k, k + 30) for k in range(0, block.steps, 30)]
    times = np.concatenate([part.impacts.time for part in parts])
    np.testing.assert_array_equal(times, block.impacts.time)
    for part in parts:
        assert (part.impacts.time > part.start - 1e-9).all()
        assert (part.impacts.time < part.end - 1e-9).all()


def test_an_impact_between_two_steps_belongs_to_the_one_that_it_is_in():
    block = make_block(10, landings=[(3, 0, 0, 0.4, 1.5), (6, 0, 1, 0.4, 1.5)])
    block.impacts.time = np.array([0.0039, 0.006 - 1e-12])
    np.testing.assert_array_equal(block.impact_steps(), [3, 6])


def test_sound_does_not_depend_on_the_precision_of_physics():
    block = random_walk(seconds=0.2, seed=6)
    floats = {
        field.name: value.astype(np.float32)
        for field in dataclasses.fields(block)
        if isinstance(value := getattr(block, field.name), np.ndarray) and value.dtype == float
    }
    single = dataclasses.replace(block, **floats)
    double, float32 = (Soundscape(1, FLOORS).render(each) for each in (block, single))
    np.testing.assert_allclose(float32, double, atol=1e-3 * np.abs(double).max())
