"""Tests of where the samples of WAV files lie, those too whose headers are not true of them."""

from __future__ import annotations

import struct
import tracemalloc

import numpy as np
import pytest
import soundfile
from wav_helpers import RATE, integers, packed, tone, wav_bytes, write_bytes

from mute.acoustics.files.reading import WavReader, read_wav
from mute.support.errors import MuteError

TONE = tone(0.1, seconds=0.1)
INT16 = packed(integers(TONE, 16), 2)
STEREO = packed(integers(np.repeat(TONE, 2), 16), 2)


def read(tmp_path, content):
    """Return the samples of the first channel, and the warnings."""
    with WavReader(write_bytes(tmp_path, content)) as wav:
        return np.concatenate(list(wav.blocks()), axis=1)[0], wav.warnings


def extension(valid_bits, code=1):
    """Return what follows the first 16 bytes of an extensible format."""
    guid = bytes.fromhex("000000001000800000aa00389b71")
    return struct.pack("<HHIH", 22, valid_bits, 4, code) + guid


# Bits, bytes, and by how many bits the samples are shifted up in their bytes.
LOW = [(24, 4, 0), (16, 4, 0), (16, 3, 0), (20, 3, 0), (20, 4, 0), (12, 2, 0), (10, 2, 0)]
HIGH = [(24, 4, 8), (16, 4, 16), (16, 3, 8), (20, 3, 4), (20, 4, 12), (12, 2, 4), (10, 2, 6)]


@pytest.mark.parametrize(("bits", "sample_bytes", "shift"), LOW + HIGH)
@pytest.mark.parametrize("name", [b"RIFF", b"RIFX"])
def test_samples_lie_in_the_bytes_of_the_block_align(tmp_path, bits, sample_bytes, shift, name):
    data = packed(integers(TONE, bits) << shift, sample_bytes, big_endian=name == b"RIFX")
    samples, warnings = read(
        tmp_path, wav_bytes(1, bits, data, rate=RATE, align=sample_bytes, name=name)
    )
    assert warnings == []
    np.testing.assert_allclose(samples, TONE, atol=2.0**-bits)


def test_the_byte_above_24_bits_may_be_left_at_zero(tmp_path):
    data = packed(integers(TONE, 24) & 0xFFFFFF, 4)
    samples, _ = read(tmp_path, wav_bytes(1, 24, data, rate=RATE, align=4))
    np.testing.assert_allclose(samples, TONE, atol=2.0**-24)


def test_two_channels_of_24_bits_in_4_bytes_are_kept_apart(tmp_path):
    values = np.stack((integers(TONE, 24), integers(-0.5 * TONE, 24)), axis=1)
    content = wav_bytes(1, 24, packed(values.ravel(), 4), channels=2, rate=RATE, align=8)
    samples, _ = read_wav(write_bytes(tmp_path, content))
    np.testing.assert_allclose(samples, [TONE, -0.5 * TONE], atol=2.0**-24)


def test_coarse_samples_of_24_bits_in_4_bytes_are_taken_to_lie_as_alsa_puts_them(tmp_path):
    # What a converter of 16 bits gives with `arecord -f S24_LE`: no sample uses the lowest byte.
    data = packed(integers(TONE, 16) << 8, 4)
    samples, warnings = read(tmp_path, wav_bytes(1, 24, data, rate=RATE, align=4))
    np.testing.assert_allclose(samples, TONE, atol=2.0**-16)
    assert "24 bits in 4 bytes may lie low or high in them, taken to lie low" in warnings[0]


def test_quiet_samples_of_12_bits_in_2_bytes_are_taken_to_lie_high(tmp_path):
    data = packed(integers(0.1 * TONE, 12) << 4, 2)
    samples, warnings = read(tmp_path, wav_bytes(1, 12, data, rate=RATE, align=2))
    np.testing.assert_allclose(samples, 0.1 * TONE, atol=2.0**-12)
    assert "taken to lie high" in warnings[0]


def test_samples_that_use_all_bytes_though_they_should_not_are_refused(tmp_path):
    floats = TONE.astype("<f4").tobytes()
    path = write_bytes(tmp_path, wav_bytes(1, 24, floats, rate=RATE, align=4))
    with pytest.raises(MuteError, match=r"24 bits in 4 bytes, but its samples use them all"):
        read_wav(path)


def test_a_block_align_of_zero_says_nothing(tmp_path):
    samples, _ = read(tmp_path, wav_bytes(1, 16, INT16, rate=RATE, align=0))
    np.testing.assert_allclose(samples, TONE, atol=2.0**-16)


@pytest.mark.parametrize(("bits", "sample_bytes", "valid_bits"), [(32, 4, 24), (24, 3, 20)])
def test_valid_bits_of_the_extensible_format_lie_high(tmp_path, bits, sample_bytes, valid_bits):
    data = packed(integers(TONE, valid_bits) << bits - valid_bits, sample_bytes)
    content = wav_bytes(0xFFFE, bits, data, rate=RATE, extra=extension(valid_bits))
    samples, warnings = read(tmp_path, content)
    assert warnings == []
    np.testing.assert_allclose(samples, TONE, atol=2.0**-valid_bits)


def test_the_block_align_counts_in_the_extensible_format_too(tmp_path):
    data = packed(integers(TONE, 24), 4)
    content = wav_bytes(0xFFFE, 24, data, rate=RATE, align=4, extra=extension(24))
    np.testing.assert_allclose(read(tmp_path, content)[0], TONE, atol=2.0**-24)


def test_clipping_is_seen_at_the_valid_bits(tmp_path):
    data = struct.pack("<3i", 0x7FFFFF, -0x800000, 0x7FFFFE)
    with WavReader(write_bytes(tmp_path, wav_bytes(1, 24, data, align=4))) as wav:
        list(wav.blocks())
    np.testing.assert_array_equal(wav.clipped, [2])


WITHOUT_A_LENGTH = {
    0: "its header promises no samples",
    0x7FFFF000: "its header does not know its length",
    0x7FFFEFDC: "of 2147479516 bytes of samples are missing",
    0x7FFFFFFF: "its header does not know its length",
    0x80000000: "its header does not know its length",
    0xFFFFFFFF: "its header does not know its length",
}


@pytest.mark.parametrize("promised", WITHOUT_A_LENGTH)
@pytest.mark.parametrize("rest", [0, 1, 3])
def test_a_recording_without_a_length_is_read_to_its_end_and_told(tmp_path, promised, rest):
    content = wav_bytes(1, 16, STEREO + bytes(rest), 2, RATE, promised=promised)
    samples, warnings = read(tmp_path, content)
    np.testing.assert_allclose(samples, TONE, atol=2.0**-16)
    (warning,) = warnings
    assert WITHOUT_A_LENGTH[promised] in warning
    assert "measured to its end (0.100 s)" in warning


def test_a_file_whose_samples_are_none_but_has_a_chunk_behind_them_has_no_samples(tmp_path):
    after = b"LIST" + struct.pack("<I", 4) + b"INFO"
    with pytest.raises(MuteError, match="holds no samples"):
        read_wav(write_bytes(tmp_path, wav_bytes(1, 16, b"", after=after)))


def test_samples_that_begin_as_a_chunk_would_are_samples(tmp_path):
    content = wav_bytes(1, 16, b"LIST" + INT16[4:], rate=RATE, promised=0)
    samples, warnings = read(tmp_path, content)
    np.testing.assert_allclose(samples[2:], TONE[2:], atol=2.0**-16)
    assert "its header promises no samples" in warnings[0]


@pytest.mark.parametrize("missing", [1, 2, 3, 4, 101, 9600])
def test_a_recording_of_which_the_end_is_missing_is_read_and_told(tmp_path, missing):
    content = wav_bytes(1, 16, STEREO[:-missing], 2, RATE, promised=len(STEREO))
    samples, warnings = read(tmp_path, content)
    there = (len(STEREO) - missing) // 4
    np.testing.assert_allclose(samples, TONE[:there], atol=2.0**-16)
    (warning,) = warnings
    assert f"cut off: {missing} of 19200 bytes of samples are missing; measured to its" in warning
    assert warning.endswith(f"end ({there / RATE:.3f} s)")


def test_samples_that_end_within_a_frame_are_read_without_it_and_told(tmp_path):
    samples, warnings = read(tmp_path, wav_bytes(1, 16, STEREO + b"abc", 2, RATE))
    np.testing.assert_allclose(samples, TONE, atol=2.0**-16)
    assert "end with 3 bytes of a frame, which are left out" in warnings[0]


@pytest.mark.parametrize("pad", [b"", b"\0", b"x"])
@pytest.mark.parametrize("name", [b"LIST", b"bext", b"id3 ", b"fact"])
def test_an_odd_chunk_is_passed_over_with_its_pad_byte_or_without(tmp_path, name, pad):
    odd = name + struct.pack("<I", 5) + b"abcde" + pad
    content = wav_bytes(1, 16, INT16, rate=RATE, before=odd)
    samples, warnings = read(tmp_path, content)
    assert warnings == []
    np.testing.assert_allclose(samples, TONE, atol=2.0**-16)


def test_chunks_behind_the_samples_are_no_samples(tmp_path):
    after = b"LIST" + struct.pack("<I", 4) + b"INFO"
    samples, warnings = read(tmp_path, wav_bytes(1, 16, INT16, rate=RATE, after=after))
    assert len(samples) == len(TONE)
    assert warnings == []


def rf64(length=9600, promised=0xFFFFFFFF, name=b"RF64"):
    """Return a file with lengths of 64 bits."""
    ds64 = b"ds64" + struct.pack("<IQQQI", 28, 2**40, length, length // 2, 0)
    return wav_bytes(1, 16, INT16, rate=RATE, promised=promised, name=name, before=ds64)


@pytest.mark.parametrize("name", [b"RF64", b"BW64"])
def test_lengths_of_64_bits_are_read(tmp_path, name):
    after = rf64(name=name) + b"LIST" + struct.pack("<I", 4) + b"INFO"
    samples, warnings = read(tmp_path, after)
    assert warnings == []
    np.testing.assert_allclose(samples, TONE, atol=2.0**-16)


@pytest.mark.parametrize("length", [0, 2**64 - 1, 2**40])
def test_untrue_lengths_of_64_bits_are_told(tmp_path, length):
    samples, warnings = read(tmp_path, rf64(length))
    np.testing.assert_allclose(samples, TONE, atol=2.0**-16)
    assert "measured to its end (0.100 s)" in warnings[0]


@pytest.mark.parametrize("promised", [0x7FFFF000, 0xFFFFFFFF])
def test_a_recording_beyond_what_a_header_can_say_keeps_all_its_samples(tmp_path, promised):
    path = write_bytes(tmp_path, wav_bytes(1, 16, b"", rate=RATE, promised=promised))
    begin = path.stat().st_size
    with path.open("r+b") as file:  # a hole, which takes no space
        file.truncate(begin + (5 << 30))
    with WavReader(path) as wav:
        assert wav.frames == 5 << 29


def test_damage_anywhere_in_a_header_gives_samples_or_one_line(tmp_path):
    random = np.random.default_rng(0)
    whole = [
        wav_bytes(1, 16, STEREO[:400], 2, RATE),
        wav_bytes(1, 24, packed(integers(TONE[:99], 24), 4), rate=RATE, align=4),
        wav_bytes(0xFFFE, 32, INT16[:400], rate=RATE, extra=extension(24)),
        wav_bytes(3, 64, TONE[:50].tobytes(), rate=RATE, name=b"RIFX"),
        rf64()[:500],
    ]
    soundfile.write(tmp_path / "made.wav", TONE[:100], RATE, "ALAW", format="WAVEX")
    whole.append((tmp_path / "made.wav").read_bytes())
    read, refused = 0, 0
    tracemalloc.start()
    for _ in range(500):
        content = bytearray(whole[random.integers(len(whole))])
        for place in random.integers(0, 100, random.integers(0, 4)):
            content[place % len(content)] = random.integers(256)
        if random.random() < 0.3:
            content = content[: random.integers(len(content))]
        path = write_bytes(tmp_path, bytes(content))
        try:
            samples, rate = read_wav(path)
        except MuteError as error:
            assert str(path) in str(error)
            assert "\n" not in str(error)
            refused += 1
        else:
            assert np.isfinite(samples).all()
            assert 0 < samples.size <= len(content)
            assert rate > 0
            read += 1
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert min(read, refused) > 50
    assert peak < 1 << 20
