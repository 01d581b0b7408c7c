"""Tests of the meter with a background that is taken away."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from meter_helpers import run
from wav_helpers import tone, write_sound

from mute.command_lines import meter
from mute.support.errors import MuteError

RATE = 8000
FIGURES = ("mnl", "pnl", "laeq", "lafmax", "l10", "l90")


@pytest.fixture(scope="module")
def room():
    """Noise of a room, three seconds."""
    return 0.01 * np.random.default_rng(7).standard_normal(3 * RATE)


@pytest.fixture(scope="module")
def files(tmp_path_factory, room):
    """The room alone; with a tone of 1 kHz that is 10 dB above it; and that in every second one."""
    folder = tmp_path_factory.mktemp("room")
    robot = tone(0.03, 1000.0, 3.0, RATE)
    write_sound(folder / "room.wav", room, RATE, "DOUBLE")
    write_sound(folder / "walk.wav", room[::-1] + robot, RATE, "DOUBLE")
    now_and_then = robot * (np.arange(3 * RATE) % (2 * RATE) < RATE)
    write_sound(folder / "steps.wav", room[::-1] + now_and_then, RATE, "DOUBLE")
    write_sound(folder / "cal.wav", tone(0.2, rate=RATE), RATE)
    return folder


def less(level, background):
    return 10.0 * math.log10(10.0 ** (level / 10.0) - 10.0 ** (background / 10.0))


def test_the_energy_of_the_background_is_taken_from_every_figure(capsys, files):
    alone, _ = run(capsys, files / "room.wav")
    heard, _ = run(capsys, files / "walk.wav")
    left, _ = run(capsys, files / "walk.wav", "--background", files / "room.wav")
    for name in FIGURES:
        assert left[name] == pytest.approx(less(heard[name], alone["laeq"]), abs=1e-9)
    assert left["laeq"] == pytest.approx(20.0 * math.log10(0.03), abs=0.1)
    assert left["background"]["file"] == str(files / "room.wav")
    assert left["background"]["laeq"] == alone["laeq"]
    assert left["background"]["third_octaves"] == alone["third_octaves"]
    assert left["uncorrected"] == {name: heard[name] for name in (*FIGURES, "third_octaves")}
    assert "uncorrected" not in heard and "background" not in heard


def test_bands_lose_their_own_background_or_have_no_level(capsys, files):
    heard, _ = run(capsys, files / "walk.wav")
    alone, _ = run(capsys, files / "room.wav")
    left, told = run(capsys, files / "walk.wav", "--background", files / "room.wav")
    both = zip(heard["third_octaves"], alone["third_octaves"], strict=True)
    expected = {
        band["frequency"]: less(band["level"], other["level"])
        if band["level"] - other["level"] >= 3.0
        else None
        for band, other in both
    }
    levels = {band["frequency"]: band["level"] for band in left["third_octaves"]}
    assert levels == pytest.approx(expected, abs=1e-9)
    assert levels[1000.0] == pytest.approx(20.0 * math.log10(0.03), abs=0.05)
    assert levels[100.0] is None
    assert "walk.wav: cannot be told from the background, less than 3 dB above it: third" in told
    assert " 80, 100, 125," in told


def test_a_figure_within_3_db_is_null_and_named(capsys, files):
    left, told = run(capsys, files / "steps.wav", "--background", files / "room.wav")
    assert left["l90"] is None
    assert left["pnl"] is not None
    assert left["uncorrected"]["l90"] is not None
    assert "less than 3 dB above it: L90, third octaves of 25, 31.5," in told
    assert any("L90" in line for line in left["warnings"])
    assert meter.main([str(files / "steps.wav"), "--background", str(files / "room.wav")]) == 0
    lines = capsys.readouterr().out.splitlines()
    (l90,) = [line for line in lines if line.startswith("L90")]
    assert l90.split()[1] == "-"
    assert l90.split()[2] == f"[{left['uncorrected']['l90']:.2f}]"


def test_a_recording_that_is_the_background_is_refused(capsys, files):
    arguments = ["--background", str(files / "room.wav")]
    with pytest.raises(MuteError, match=r"its LAeq of .* must be 3 dB or more above the"):
        meter.main([str(files / "room.wav"), *arguments])
    assert capsys.readouterr().out == ""
    several = [str(files / "room.wav"), str(files / "walk.wav"), *arguments, "--json"]
    assert meter.main(several) == 2
    captured = capsys.readouterr()
    assert [figures["file"] for figures in json.loads(captured.out)] == [str(files / "walk.wav")]
    assert "error: " in captured.err and "cannot be told from the background" in captured.err


def test_recording_and_background_are_calibrated_alike(capsys, files):
    calibration = ("--calibration-db", 94, "--calibration-file", files / "cal.wav")
    background = ("--background", files / "room.wav")
    left, _ = run(capsys, files / "walk.wav", *background)
    calibrated, _ = run(capsys, files / "walk.wav", *background, *calibration)
    shift = 94.0 - 20.0 * math.log10(0.2)
    assert calibrated["laeq"] - left["laeq"] == pytest.approx(shift, abs=0.01)
    difference = calibrated["background"]["laeq"] - left["background"]["laeq"]
    assert difference == pytest.approx(shift, abs=0.01)


def test_a_span_has_the_whole_background_taken_away(capsys, files):
    whole, _ = run(capsys, files / "walk.wav", "--background", files / "room.wav")
    part, _ = run(
        capsys, files / "walk.wav", "--background", files / "room.wav", "--from", 1, "--to", 2
    )
    assert part["background"] == whole["background"]
    assert part["laeq"] == pytest.approx(whole["laeq"], abs=0.1)


def test_the_background_is_measured_once_for_all_recordings(capsys, files, monkeypatch):
    from mute.acoustics.metering import recordings

    measure, paths = recordings.measure_span, []
    monkeypatch.setattr(
        recordings, "measure_span", lambda wav, *rest: paths.append(wav.path) or measure(wav, *rest)
    )
    walks = [files / "walk.wav", files / "steps.wav"]
    run(capsys, *walks, "--background", files / "room.wav")
    assert sorted(paths) == sorted([*walks, files / "room.wav"])


def test_digital_silence_is_a_background_that_takes_nothing_away(capsys, files, tmp_path):
    write_sound(tmp_path / "silence.wav", np.zeros(RATE), RATE)
    heard, _ = run(capsys, files / "walk.wav")
    left, told = run(capsys, files / "walk.wav", "--background", tmp_path / "silence.wav")
    assert left["laeq"] == heard["laeq"]
    assert left["background"]["laeq"] is None
    assert "silence.wav: digital silence in the readings" in told


def test_the_background_of_one_channel_is_that_of_the_same_channel(capsys, files, tmp_path, room):
    other = tone(0.03, 1000.0, 3.0, RATE)
    write_sound(tmp_path / "room.wav", np.stack([10.0 * room, room]), RATE, "DOUBLE")
    write_sound(tmp_path / "walk.wav", np.stack([room, room[::-1] + other]), RATE, "DOUBLE")
    one, _ = run(capsys, files / "walk.wav", "--background", files / "room.wav")
    arguments = ("--background", tmp_path / "room.wav", "--channel", 2)
    two, _ = run(capsys, tmp_path / "walk.wav", *arguments)
    assert two["laeq"] == pytest.approx(one["laeq"], abs=1e-9)


@pytest.mark.parametrize(
    ("samples", "rate", "reason"),
    [
        (np.ones((2, 8000)), 8000, "2 channels at 8000 Hz, but 1 at 8000 Hz in"),
        (np.ones((1, 8000)), 16000, "1 channels at 16000 Hz, but 1 at 8000 Hz in"),
    ],
)
def test_a_background_of_another_kind_is_refused(files, tmp_path, samples, rate, reason):
    path = tmp_path / "room.wav"
    write_sound(path, 0.01 * samples, rate)
    with pytest.raises(MuteError, match=f"{path}: {reason}"):
        meter.main([str(files / "walk.wav"), "--background", str(path)])


def test_a_background_that_is_not_there_is_told_once(capsys, files):
    walks = [str(files / "walk.wav"), str(files / "steps.wav")]
    with pytest.raises(MuteError, match=r"no file at .*none\.wav"):
        meter.main([*walks, "--background", str(files / "none.wav")])
    assert capsys.readouterr() == ("", "")


def test_the_lines_say_what_was_taken_away(capsys, files):
    meter.main([str(files / "walk.wav"), "--background", str(files / "room.wav")])
    lines = capsys.readouterr().out
    figures, _ = run(capsys, files / "walk.wav", "--background", files / "room.wav")
    alone = figures["background"]["laeq"]
    assert f"without the background of {alone:.2f} dBFS(A); with it in brackets" in lines
    heard, left = figures["uncorrected"]["mnl"], figures["mnl"]
    assert f"MNL    {left:8.2f}  [{heard:.2f}]  mean of the readings" in lines
