"""Tests of the files that the meter keeps: readings as CSV, and pictures."""

from __future__ import annotations

import csv
import io
import json

import numpy as np
import pytest
from meter_helpers import run
from PIL import Image
from wav_helpers import tone, write_sound

from mute.acoustics.metering.sound_level_meter import SoundLevelMeter
from mute.command_lines import meter
from mute.support.errors import MuteError

RATE = 8000


@pytest.fixture(scope="module")
def walks(tmp_path_factory):
    """A folder with two recordings, and another with one of the same name."""
    folder = tmp_path_factory.mktemp("walks")
    rng = np.random.default_rng(8)
    (folder / "other").mkdir()
    for name in ("a", "b", "other/a"):
        noise = 0.1 * rng.standard_normal(3 * RATE)
        write_sound(folder / f"{name}.wav", noise, RATE, "DOUBLE")
        np.save(folder / f"{name}.npy", noise)
    return folder


def readings(path):
    """Return the times and levels of a CSV."""
    rows = list(csv.DictReader(io.StringIO(path.read_text())))
    assert list(rows[0]) == ["time_s", "level"]
    return tuple(np.array([float(row[name]) for row in rows]) for name in ("time_s", "level"))


def test_the_csv_has_the_readings_of_the_detector(capsys, walks, tmp_path):
    path = tmp_path / "new" / "history.csv"
    figures, _ = run(capsys, walks / "a.wav", "--history", path)
    times, levels = readings(path)
    heard = SoundLevelMeter(RATE, reference=1.0)
    heard.update(np.load(walks / "a.npy"))
    np.testing.assert_allclose(times, heard.detector.reading_times, atol=1e-9)
    np.testing.assert_allclose(levels, heard.detector.readings[0], rtol=0.0, atol=1e-9)
    assert figures["mnl"] == pytest.approx(levels.mean())
    assert figures["pnl"] == levels.max()
    assert figures["readings"] == len(levels) == 51


def test_the_csv_of_a_span_has_its_readings_at_the_recording_s_times(walks, tmp_path):
    whole, part = tmp_path / "whole.csv", tmp_path / "part.csv"
    meter.main([str(walks / "a.wav"), "--history", str(whole)])
    meter.main([str(walks / "a.wav"), "--history", str(part), "--from", "2.5", "--to", "2.8"])
    times, levels = readings(part)
    np.testing.assert_allclose(times, [2.55, 2.6, 2.65, 2.7, 2.75, 2.8])
    all_times, all_levels = readings(whole)
    within = (all_times > 2.51) & (all_times < 2.81)
    np.testing.assert_allclose(levels, all_levels[within], rtol=0.0, atol=1e-5)


def test_a_recording_without_a_reading_has_a_csv_of_none(tmp_path):
    write_sound(tmp_path / "step.wav", tone(0.1, seconds=0.3, rate=RATE), RATE)
    meter.main([str(tmp_path / "step.wav"), "--history", str(tmp_path / "step.csv")])
    assert (tmp_path / "step.csv").read_text() == "time_s,level\n"


def test_the_csv_has_what_was_read_with_the_background_in_it(walks, tmp_path):
    write_sound(tmp_path / "room.wav", 0.03 * np.load(walks / "b.npy"), RATE, "DOUBLE")
    plain, less = tmp_path / "plain.csv", tmp_path / "less.csv"
    meter.main([str(walks / "a.wav"), "--history", str(plain)])
    background = ["--background", str(tmp_path / "room.wav")]
    meter.main([str(walks / "a.wav"), "--history", str(less), *background])
    assert plain.read_text() == less.read_text()


@pytest.mark.parametrize("background", [False, True])
def test_the_plot_is_a_picture_of_any_sound_under_any_name(capsys, recwarn, tmp_path, background):
    # No markup, whatever stands in the name, no font has all scripts, and silence has no level.
    samples = tone(0.1, rate=RATE)
    samples[RATE:] = 0.0
    path = tmp_path / "$a_{^\\frac \u6b69.wav"
    write_sound(path, samples, RATE)
    write_sound(tmp_path / "room.wav", 0.01 * samples + 1e-5, RATE)
    arguments = ["--background", str(tmp_path / "room.wav")] if background else []
    meter.main([str(path), "--plot", str(tmp_path / "walk.png"), *arguments])
    with Image.open(tmp_path / "walk.png") as picture:
        assert picture.format == "PNG"
        colours = np.asarray(picture.convert("RGB")).reshape(-1, 3)
    assert np.any(np.all(colours == [0xB5, 0x48, 0x2F], axis=1))  # bars
    assert list(recwarn) == []
    assert f"written: {tmp_path / 'walk.png'}" in capsys.readouterr().out


def test_a_recording_without_any_level_has_a_picture(tmp_path):
    write_sound(tmp_path / "silence.wav", np.zeros(RATE // 10), RATE)
    meter.main([str(tmp_path / "silence.wav"), "--plot", str(tmp_path / "silence.png")])
    assert (tmp_path / "silence.png").read_bytes().startswith(b"\x89PNG")


def test_several_recordings_have_a_file_each_named_by_their_stems(capsys, walks, tmp_path):
    folder = tmp_path / "deep" / "kept"
    files = [walks / "a.wav", walks / "b.wav"]
    several, _ = run(capsys, *files, "--history", folder)
    assert sorted(path.name for path in folder.iterdir()) == ["a.csv", "b.csv"]
    for stem, figures in zip("ab", several, strict=True):
        assert readings(folder / f"{stem}.csv")[1].max() == figures["pnl"]


def test_nothing_but_json_is_printed_beside_the_files(capsys, walks, tmp_path):
    assert meter.main([str(walks / "a.wav"), "--json", "--history", str(tmp_path / "a.csv")]) == 0
    json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("option", ["--history", "--plot"])
def test_recordings_of_one_name_are_refused_before_any_is_measured(capsys, walks, tmp_path, option):
    files = [str(walks / "a.wav"), str(walks / "b.wav"), str(walks / "other" / "a.wav")]
    with pytest.raises(MuteError, match=rf"{option}: .*a\.wav and .*other/a\.wav would both be"):
        meter.main([*files, option, str(tmp_path / "kept")])
    assert capsys.readouterr() == ("", "")
    assert not (tmp_path / "kept").exists()


@pytest.mark.parametrize(
    ("names", "arguments", "reason"),
    [
        (["a"], ["--history", "levels.txt"], r"--history must name a \.csv file, got 'levels.txt'"),
        (["a"], ["--plot", "levels.svg"], r"--plot must name a \.png file, got 'levels.svg'"),
        (["a"], ["--plot", "."], r"--plot must name a \.png file, got '\.'"),
        (
            ["a", "b"],
            ["--history", "levels.csv"],
            r"--history must name a directory for several recordings, got 'levels\.csv'",
        ),
        (
            ["a", "b"],
            ["--plot", "file"],
            "--plot must name a directory for several recordings, got 'file'",
        ),
        (["a", "b"], ["--plot", "file/deeper"], "--plot file/deeper: cannot be made a directory"),
    ],
)
def test_a_place_that_does_not_fit_is_refused_before_anything_is_measured(
    capsys, walks, tmp_path, monkeypatch, names, arguments, reason
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(MuteError, match=reason):
        meter.main([*(str(walks / f"{name}.wav") for name in names), *arguments])
    assert capsys.readouterr() == ("", "")


def test_no_file_replaces_a_recording_that_is_read(walks, tmp_path):
    path = tmp_path / "walk.csv"  # a WAV file by any name
    path.write_bytes((walks / "a.wav").read_bytes())
    with pytest.raises(MuteError, match=r"--history must not replace what is measured"):
        meter.main([str(path), "--history", str(path)])
    with pytest.raises(MuteError, match=r"--history must not replace what is measured"):
        meter.main([str(walks / "b.wav"), "--background", str(path), "--history", str(path)])
    assert path.read_bytes() == (walks / "a.wav").read_bytes()


def test_a_file_that_cannot_be_written_costs_no_figures(capsys, walks, tmp_path):
    folder = tmp_path / "kept"
    (folder / "a.csv").mkdir(parents=True)  # in the place of a file
    files = [str(walks / "a.wav"), str(walks / "b.wav")]
    assert meter.main([*files, "--history", str(folder)]) == 2
    captured = capsys.readouterr()
    assert captured.out.count("LAeq") == 2
    assert f"error: cannot write {folder / 'a.csv'}" in captured.err
    assert (folder / "b.csv").is_file()


def test_a_matplotlib_that_does_not_load_is_told_before_anything_is_measured(
    capsys, walks, tmp_path, monkeypatch
):
    def refuse():
        raise MuteError("no matplotlib")

    monkeypatch.setattr(meter, "check_matplotlib", refuse)
    with pytest.raises(MuteError, match="no matplotlib"):
        meter.main([str(walks / "a.wav"), "--plot", str(tmp_path / "a.png")])
    assert capsys.readouterr().out == ""
