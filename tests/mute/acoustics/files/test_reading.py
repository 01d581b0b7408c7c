"""Tests of reading WAV files: what is read, and what is refused."""

from __future__ import annotations

import struct

import numpy as np
import pytest
import soundfile
from scipy.io import wavfile
from wav_helpers import integers, packed, tone, wav_bytes, write_bytes, write_sound

from mute.acoustics.files.reading import WavReader, read_wav
from mute.support.errors import MuteError

SAMPLES = np.array([[0.0, 0.5, -0.5, 0.25], [-1.0, 0.125, 0.75, 0.0]])


@pytest.mark.parametrize(
    ("dtype", "full_scale"), [("int16", 2**15), ("int32", 2**31), ("float32", 1), ("float64", 1)]
)
def test_what_other_programs_write_is_read(tmp_path, dtype, full_scale):
    path = tmp_path / "file.wav"
    wavfile.write(path, 11025, (SAMPLES.T * full_scale).astype(dtype))
    back, sample_rate = read_wav(path)
    assert sample_rate == 11025
    np.testing.assert_array_equal(back, SAMPLES)


def test_eight_bits_have_no_sign(tmp_path):
    back, _ = read_wav(write_bytes(tmp_path, wav_bytes(1, 8, bytes([0, 128, 192]))))
    np.testing.assert_array_equal(back, [[-1.0, 0.0, 0.5]])


def test_twenty_four_bits_are_scaled_to_one(tmp_path):
    data = bytes([0x00, 0x00, 0x80]) + bytes([0x00, 0x00, 0x40]) + bytes([0x01, 0x00, 0x00])
    back, _ = read_wav(write_bytes(tmp_path, wav_bytes(1, 24, data)))
    np.testing.assert_array_equal(back, [[-1.0, 0.5, 2.0**-23]])


def test_the_extensible_format_is_read(tmp_path):
    guid = struct.pack("<H", 1) + bytes.fromhex("000000001000800000aa00389b71")
    extra = struct.pack("<HHI", 22, 24, 0) + guid
    data = bytes([0, 0, 0, 0x40])
    back, _ = read_wav(write_bytes(tmp_path, wav_bytes(0xFFFE, 32, data, extra=extra)))
    np.testing.assert_array_equal(back, [[0.5]])


def test_other_chunks_before_the_samples_are_passed_over(tmp_path):
    content = wav_bytes(1, 16, struct.pack("<h", 1 << 14))
    odd = b"LIST" + struct.pack("<I", 3) + b"abc\0"
    back, _ = read_wav(write_bytes(tmp_path, content[:12] + odd + content[12:]))
    np.testing.assert_array_equal(back, [[0.5]])


def test_a_file_is_read_in_blocks_of_the_length_that_is_asked_for(tmp_path):
    path = tmp_path / "file.wav"
    samples = np.arange(20.0).reshape(2, 10) / 32.0
    write_sound(path, samples, 8000)
    with WavReader(path) as wav:
        assert (wav.channels, wav.frames, wav.sample_rate) == (2, 10, 8000)
        blocks = list(wav.blocks(4))
    assert [block.shape for block in blocks] == [(2, 4), (2, 4), (2, 2)]
    np.testing.assert_array_equal(np.concatenate(blocks, axis=1), samples)


def test_a_part_of_a_file_is_read_and_counted_alone(tmp_path):
    path = tmp_path / "file.wav"
    values = np.array([-(2**15), *range(1, 10), 2**15 - 1], dtype=np.int16)
    wavfile.write(path, 8000, values)
    with WavReader(path) as wav:
        blocks = list(wav.blocks(3, begin=4, end=9))
        assert [block.shape[1] for block in blocks] == [3, 2]
        np.testing.assert_array_equal(np.concatenate(blocks, axis=1)[0] * 2.0**15, values[4:9])
        assert wav.clipped.tolist() == [0]
        assert wav.peak.tolist() == [8.0 / 2.0**15]
        assert list(wav.blocks(begin=4, end=4)) == []


def test_a_file_can_be_gone_through_twice_and_counts_anew(tmp_path):
    data = struct.pack("<3h", 32767, 0, -16384)
    with WavReader(write_bytes(tmp_path, wav_bytes(1, 16, data))) as wav:
        for _ in range(2):
            np.testing.assert_allclose(np.concatenate(list(wav.blocks(2)), axis=1)[0, 2], -0.5)
            assert (wav.clipped[0], wav.peak[0]) == (1, 32767 / 32768)


@pytest.mark.parametrize("subtype", ["ULAW", "ALAW"])
def test_the_encodings_of_telephones_are_read_to_their_own_precision(tmp_path, subtype):
    path = tmp_path / "phone.wav"
    write_sound(path, tone(0.1), 48000, subtype)
    with WavReader(path) as wav:
        samples = np.concatenate(list(wav.blocks()), axis=1)[0]
    # ITU-T G.711: sixteen steps to each octave, so an error of at most 1/32 of a sample.
    np.testing.assert_allclose(samples, tone(0.1), rtol=1 / 32, atol=3e-4)


@pytest.mark.parametrize("subtype", ["ULAW", "ALAW"])
def test_the_largest_code_of_a_telephone_counts_as_full_scale(tmp_path, subtype):
    path = tmp_path / "phone.wav"
    write_sound(path, np.array([0.0, 1.0, -1.0, 0.9]), 48000, subtype)
    with WavReader(path) as wav:
        list(wav.blocks())
    np.testing.assert_array_equal(wav.clipped, [2])


@pytest.mark.parametrize("subtype", ["IMA_ADPCM", "MS_ADPCM", "GSM610"])
def test_lossy_encodings_are_refused_by_their_code(tmp_path, subtype):
    path = tmp_path / "small.wav"
    write_sound(path, tone(0.1), 8000, subtype)
    with pytest.raises(
        MuteError, match=r"small\.wav: WAV encoding 0x00\d\d with \d+ bits is not read"
    ):
        read_wav(path)


@pytest.mark.parametrize("bits", [16, 24, 32])
def test_big_endian_integers_are_read(tmp_path, bits):
    values = integers(SAMPLES.T * 0.5, bits)
    data = packed(values.ravel(), bits // 8, big_endian=True)
    content = wav_bytes(1, bits, data, channels=2, name=b"RIFX")
    np.testing.assert_array_equal(read_wav(write_bytes(tmp_path, content))[0], SAMPLES * 0.5)


@pytest.mark.parametrize("dtype", [">f4", ">f8"])
def test_big_endian_floats_are_read(tmp_path, dtype):
    data = SAMPLES[0].astype(dtype).tobytes()
    content = wav_bytes(3, 8 * int(dtype[2]), data, name=b"RIFX")
    np.testing.assert_array_equal(read_wav(write_bytes(tmp_path, content))[0], SAMPLES[:1])


@pytest.mark.parametrize("subtype", ["PCM_U8", "PCM_16", "PCM_24", "PCM_32", "FLOAT", "DOUBLE"])
@pytest.mark.parametrize("name", ["WAV", "WAVEX", "RF64"])
def test_what_soundfile_writes_is_read_as_soundfile_reads_it(tmp_path, subtype, name):
    path = tmp_path / "file.wav"
    samples = np.random.default_rng(0).uniform(-0.9, 0.9, (777, 3))
    soundfile.write(path, samples, 44100, subtype, format=name)
    back, rate = read_wav(path)
    assert rate == 44100
    np.testing.assert_array_equal(back.T, soundfile.read(path)[0])
    np.testing.assert_allclose(back.T, samples, atol=2.0**-7 if subtype == "PCM_U8" else 2.0**-15)


def test_integer_samples_at_full_scale_are_counted_in_each_channel(tmp_path):
    data = struct.pack("<6h", 32767, 0, -32768, 32766, 5, 32767)
    with WavReader(write_bytes(tmp_path, wav_bytes(1, 16, data, channels=2))) as wav:
        list(wav.blocks(1))
    np.testing.assert_array_equal(wav.clipped, [2, 1])


def test_float_samples_beyond_one_are_not_taken_for_clipped(tmp_path):
    path = tmp_path / "file.wav"
    write_sound(path, np.array([1.5, 1.0, -1.0, 0.5]), 8000)
    with WavReader(path) as wav:
        list(wav.blocks())
    np.testing.assert_array_equal(wav.clipped, [2])


WHOLE = wav_bytes(1, 16, bytes(100))


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "empty file"),
        (b"The robot was loud.\n", "not a WAV file"),
        (b"RIFF\x00\x00\x00\x00AVI ", "not a WAV file"),
        (WHOLE[:8], "broken WAV file"),
        (WHOLE[:20], "broken WAV file"),
        (WHOLE[:30], "broken WAV file: it ends before its samples begin"),
        (WHOLE[:16] + b"\x0e\0\0\0" + WHOLE[20:34] + WHOLE[36:], "its format is cut off"),
        (WHOLE[:36], "broken WAV file"),
        (WHOLE[:12] + WHOLE[36:], "broken WAV file: no format"),
        (WHOLE[:-100], "holds no samples"),
        (wav_bytes(1, 16, b""), "holds no samples"),
        (wav_bytes(0x55, 16, bytes(4)), "encoding 0x0055 with 16 bits is not read"),
        (wav_bytes(1, 4, bytes(4), align=1), "encoding 0x0001 with 4 bits is not read"),
        (wav_bytes(1, 64, bytes(8)), "encoding 0x0001 with 64 bits is not read"),
        (wav_bytes(3, 16, bytes(8)), "encoding 0x0003 with 16 bits is not read"),
        (wav_bytes(1, 24, bytes(8), align=2), "broken WAV file: 2 bytes for 1 samples of 24 bits"),
        (wav_bytes(1, 8, bytes(8), align=2), "broken WAV file: 2 bytes for 1 samples of 8 bits"),
        (wav_bytes(3, 32, bytes(8), align=8), "broken WAV file: 8 bytes for 1 samples of 32 bits"),
        (wav_bytes(1, 16, bytes(8), 2, align=5), "broken WAV file: 5 bytes for 2 samples of 16"),
        (wav_bytes(1, 16, bytes(4), channels=0), "broken WAV file: 0 channels"),
        (wav_bytes(1, 16, bytes(4), channels=1025), "1025 channels, must be 1 to 1024"),
        (wav_bytes(1, 16, bytes(4), rate=0), "sample rate 0 Hz, must be 1 to 2147483647 Hz"),
        (wav_bytes(1, 16, bytes(4), rate=2**32 - 1), "sample rate 4294967295 Hz, must be 1 to"),
        (wav_bytes(3, 32, struct.pack("<3f", 0, np.nan, 0)), "sample 1 of channel 1 is nan"),
        (wav_bytes(3, 32, struct.pack("<2f", 0, -np.inf), 2), "sample 0 of channel 2 is -inf"),
        (wav_bytes(3, 64, struct.pack("<2d", 0, -1e200)), "sample 1 of channel 1 is -1e+200, not"),
    ],
)
def test_a_bad_file_is_refused_with_its_name_and_the_reason_in_one_line(tmp_path, content, reason):
    path = write_bytes(tmp_path, content)
    with pytest.raises(MuteError) as refusal:
        read_wav(path)
    message = str(refusal.value)
    assert message.startswith(f"{path}: ")
    assert reason in message
    assert "\n" not in message


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(MuteError, match=r"no file at .*missing\.wav"):
        read_wav(tmp_path / "missing.wav")


def test_a_directory_is_refused(tmp_path):
    with pytest.raises(MuteError, match="cannot be read"):
        read_wav(tmp_path)
