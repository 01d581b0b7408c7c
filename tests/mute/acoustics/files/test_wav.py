"""Tests of WAV files: what is read, written, and refused."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from scipy.io import wavfile

from mute.acoustics.files.wav import WavReader, has_samples, read_wav, write_wav
from mute.support.errors import MuteError

SAMPLES = np.array([[0.0, 0.5, -0.5, 0.25], [-1.0, 0.125, 0.75, 0.0]])


def wav_bytes(code, bits, data, channels=1, rate=8000, extra=b"", promised=None):
    """Return a WAV file, made by hand."""
    frame = channels * bits // 8
    fmt = struct.pack("<HHIIHH", code, channels, rate, rate * frame, frame, bits) + extra
    promised = len(data) if promised is None else promised
    chunks = b"fmt " + struct.pack("<I", len(fmt)) + fmt
    chunks += b"data" + struct.pack("<I", promised) + data
    return b"RIFF" + struct.pack("<I", 4 + len(chunks)) + b"WAVE" + chunks


def write(tmp_path, content):
    path = tmp_path / "recording.wav"
    path.write_bytes(content)
    return path


@pytest.mark.parametrize(
    ("encoding", "step"), [("float32", 2.0**-24), ("int16", 2.0**-15), ("int24", 2.0**-23)]
)
@pytest.mark.parametrize("channels", [1, 2, 3])
def test_what_is_written_is_read_back(tmp_path, encoding, step, channels):
    samples = np.random.default_rng(0).uniform(-1.0, 1.0, (channels, 777))
    path = tmp_path / "made" / "file.wav"
    write_wav(path, samples, 44100, encoding)
    back, sample_rate = read_wav(path)
    assert sample_rate == 44100
    np.testing.assert_allclose(back, samples, atol=step)


@pytest.mark.parametrize("count", [0, 1])
def test_a_file_without_samples_is_known(tmp_path, count):
    path = tmp_path / "file.wav"
    write_wav(path, np.zeros(count), 48000, "int16")
    assert has_samples(path) is bool(count)


@pytest.mark.parametrize("encoding", ["float32", "int16", "int24"])
def test_other_programs_can_read_what_is_written(tmp_path, encoding):
    path = tmp_path / "file.wav"
    write_wav(path, SAMPLES, 22050, encoding)
    rate, data = wavfile.read(path)
    full_scale = {"float32": 1.0, "int16": 2.0**15, "int24": 2.0**31}[encoding]
    assert rate == 22050
    np.testing.assert_allclose(data.T / full_scale, SAMPLES, atol=2.0**-15)


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
    back, _ = read_wav(write(tmp_path, wav_bytes(1, 8, bytes([0, 128, 192]))))
    np.testing.assert_array_equal(back, [[-1.0, 0.0, 0.5]])


def test_twenty_four_bits_are_scaled_to_one(tmp_path):
    data = bytes([0x00, 0x00, 0x80]) + bytes([0x00, 0x00, 0x40]) + bytes([0x01, 0x00, 0x00])
    back, _ = read_wav(write(tmp_path, wav_bytes(1, 24, data)))
    np.testing.assert_array_equal(back, [[-1.0, 0.5, 2.0**-23]])


def test_the_extensible_format_is_read(tmp_path):
    guid = struct.pack("<H", 1) + bytes.fromhex("000000001000800000aa00389b71")
    extra = struct.pack("<HHI", 22, 24, 0) + guid
    data = bytes([0, 0, 0, 0x40])
    back, _ = read_wav(write(tmp_path, wav_bytes(0xFFFE, 32, data, extra=extra)))
    np.testing.assert_array_equal(back, [[0.5]])


def test_other_chunks_before_the_samples_are_passed_over(tmp_path):
    content = wav_bytes(1, 16, struct.pack("<h", 1 << 14))
    odd = b"LIST" + struct.pack("<I", 3) + b"abc\0"
    back, _ = read_wav(write(tmp_path, content[:12] + odd + content[12:]))
    np.testing.assert_array_equal(back, [[0.5]])


def test_a_file_from_a_pipe_goes_on_to_its_end(tmp_path):
    content = wav_bytes(1, 16, struct.pack("<2h", 1 << 14, 0) + b"\0", promised=0xFFFFFFFF)
    back, _ = read_wav(write(tmp_path, content))
    np.testing.assert_array_equal(back, [[0.5, 0.0]])


def test_a_file_is_read_in_blocks_of_the_length_that_is_asked_for(tmp_path):
    path = tmp_path / "file.wav"
    samples = np.arange(20.0).reshape(2, 10) / 32.0
    write_wav(path, samples, 8000)
    with WavReader(path) as wav:
        assert (wav.channels, wav.frames, wav.sample_rate) == (2, 10, 8000)
        blocks = list(wav.blocks(4))
    assert [block.shape for block in blocks] == [(2, 4), (2, 4), (2, 2)]
    np.testing.assert_array_equal(np.concatenate(blocks, axis=1), samples)


def test_integer_samples_at_full_scale_are_counted_in_each_channel(tmp_path):
    data = struct.pack("<6h", 32767, 0, -32768, 32766, 5, 32767)
    with WavReader(write(tmp_path, wav_bytes(1, 16, data, channels=2))) as wav:
        list(wav.blocks(1))
    np.testing.assert_array_equal(wav.clipped, [2, 1])


def test_float_samples_beyond_one_are_not_taken_for_clipped(tmp_path):
    path = tmp_path / "file.wav"
    write_wav(path, np.array([1.5, 1.0, -1.0, 0.5]), 8000)
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
        (WHOLE[:30], "broken WAV file: its format is cut off"),
        (WHOLE[:36], "broken WAV file"),
        (WHOLE[:12] + WHOLE[36:], "broken WAV file: no format"),
        (WHOLE[:-40], "truncated: 100 bytes of samples are promised, 60 are there"),
        (wav_bytes(1, 16, b""), "holds no samples"),
        (wav_bytes(0x55, 16, bytes(4)), "encoding 0x0055 with 16 bits is not read"),
        (wav_bytes(1, 12, bytes(4)), "encoding 0x0001 with 12 bits is not read"),
        (wav_bytes(1, 16, bytes(4), channels=0), "broken WAV file: 0 channels"),
        (wav_bytes(1, 16, bytes(4), rate=0), "broken WAV file: 1 channels at a sample rate of 0"),
        (wav_bytes(3, 32, struct.pack("<3f", 0, np.nan, 0)), "sample 1 of channel 1 is nan"),
        (wav_bytes(3, 32, struct.pack("<2f", 0, -np.inf), 2), "sample 0 of channel 2 is -inf"),
        (wav_bytes(3, 64, struct.pack("<2d", 0, -1e200)), "sample 1 of channel 1 is -1e+200, not"),
        (wav_bytes(1, 16, bytes(101)), "broken WAV file: its 101 bytes end within a sample"),
        (wav_bytes(1, 16, bytes(102), channels=2), "its 102 bytes end within a sample"),
    ],
)
def test_a_bad_file_is_refused_with_its_name_and_the_reason_in_one_line(tmp_path, content, reason):
    path = write(tmp_path, content)
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


@pytest.mark.parametrize("value", [1.5, np.nan, np.inf])
def test_what_an_integer_file_cannot_hold_is_not_written(tmp_path, value):
    path = tmp_path / "file.wav"
    with pytest.raises(ValueError, match="samples must be"):
        write_wav(path, np.array([0.0, value]), 8000, "int16")
    assert not path.exists()
