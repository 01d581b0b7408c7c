"""Tests of the meter on several recordings, on spans of them, and of its third octaves."""

from __future__ import annotations

import json
import math
import os
import sys
import threading
from types import SimpleNamespace

import numpy as np
import pytest
from meter_helpers import run
from wav_helpers import RATE, tone, write_sound

from mute.acoustics.metering.third_octaves import ThirdOctaveMeter
from mute.command_lines import meter
from mute.support.errors import MuteError


@pytest.fixture(scope="module")
def walks(tmp_path_factory):
    """A folder with three recordings, each of half the amplitude, and a calibrator's tone."""
    folder = tmp_path_factory.mktemp("walks")
    for name, amplitude in (("a", 0.1), ("b", 0.05), ("c", 0.025), ("cal", 0.2)):
        write_sound(folder / f"{name}.wav", tone(amplitude, rate=8000), 8000)
    return folder


def test_several_recordings_are_told_one_after_the_other(capsys, walks):
    assert meter.main([str(walks / "a.wav"), str(walks / "b.wav")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(":")[0] for line in lines if " Hz, " in line] == [
        str(walks / "a.wav"),
        str(walks / "b.wav"),
    ]
    assert [line.split()[1] for line in lines if line.startswith("LAeq")] == ["-20.00", "-26.02"]


def test_the_json_of_several_recordings_is_a_list_and_of_one_an_object(capsys, walks):
    several, _ = run(capsys, walks / "a.wav", walks / "c.wav")
    assert [figures["file"] for figures in several] == [str(walks / "a.wav"), str(walks / "c.wav")]
    assert several[1]["laeq"] == pytest.approx(-32.04, abs=0.01)
    one, _ = run(capsys, walks / "a.wav")
    assert one == several[0]


@pytest.mark.parametrize("options", [[], ["--json"]])
def test_a_bad_file_is_one_line_and_costs_no_other_its_figures(capsys, walks, options):
    (walks / "bad.wav").write_text("It was loud.\n")
    files = [str(walks / name) for name in ("a.wav", "bad.wav", "none.wav", "b.wav")]
    assert meter.main([*files, *options]) == 2
    captured = capsys.readouterr()
    errors = [line for line in captured.err.splitlines() if line.startswith("error: ")]
    assert len(errors) == 2
    assert errors[0].startswith(f"error: {walks / 'bad.wav'}: not a WAV file")
    assert errors[1] == f"error: no file at {walks / 'none.wav'}"
    if options:
        assert [figures["file"] for figures in json.loads(captured.out)] == [files[0], files[3]]
    else:
        assert captured.out.count("LAeq") == 2


def test_what_all_recordings_need_is_told_once_and_ends_the_call(capsys, walks):
    files = [str(walks / "a.wav"), str(walks / "b.wav")]
    arguments = ["--calibration-db", "94", "--calibration-file", str(walks / "none.wav")]
    with pytest.raises(MuteError, match="no file at"):
        meter.main([*files, *arguments])
    assert capsys.readouterr() == ("", "")


def test_a_calibration_is_taken_once_for_all_recordings(capsys, walks, monkeypatch):
    taken = []
    from mute.acoustics.metering import recordings

    calibrate = recordings.calibrate
    monkeypatch.setattr(
        recordings, "calibrate", lambda *given: taken.append(given) or calibrate(*given)
    )
    files = [walks / name for name in ("a.wav", "b.wav", "c.wav")]
    arguments = ("--calibration-db", 94, "--calibration-file", walks / "cal.wav")
    several, _ = run(capsys, *files, *arguments)
    assert len(taken) == 1
    levels = [figures["laeq"] for figures in several]
    assert levels == pytest.approx([87.98, 81.96, 75.94], abs=0.01)


def test_a_warning_that_several_recordings_share_is_told_once(capsys, walks, tmp_path):
    samples = tone(0.2, rate=8000, seconds=4.0)
    samples[: RATE // 20] += np.random.default_rng(0).standard_normal(RATE // 20)
    write_sound(tmp_path / "cal.wav", samples, 8000)
    arguments = ("--calibration-db", 94, "--calibration-file", tmp_path / "cal.wav")
    several, told = run(capsys, walks / "a.wav", walks / "b.wav", *arguments)
    assert told.count("not a steady tone") == 1
    assert all("not a steady tone" in figures["warnings"][0] for figures in several)


def test_without_a_recording_there_is_nothing_to_measure():
    with pytest.raises(MuteError, match=r"a recording to measure must be named: FILE\.wav"):
        meter.main(["--json"])


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_pipe_is_one_of_several_recordings(capsys, walks, tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    sender = threading.Thread(target=pipe.write_bytes, args=((walks / "b.wav").read_bytes(),))
    sender.start()
    piped, other = run(capsys, pipe, walks / "c.wav", "--from", 1)[0]
    sender.join()
    assert (piped["laeq"], other["laeq"]) == pytest.approx((-26.02, -32.04), abs=0.01)


def test_a_span_has_the_figures_of_its_samples_alone(capsys, tmp_path):
    path = tmp_path / "walk.wav"
    parts = [tone(level, rate=8000) for level in (0.1, 0.2, 0.05)]
    write_sound(path, np.concatenate(parts), 8000)
    figures, _ = run(capsys, path, "--from", 3, "--to", 4)
    for name in ("mnl", "pnl", "laeq", "l10", "l90"):
        assert figures[name] == pytest.approx(20.0 * math.log10(0.2), abs=0.01)
    assert (figures["from"], figures["to"], figures["seconds"]) == (3.0, 4.0, 1.0)
    assert figures["readings"] == 20
    meter.main([str(path), "--from", "5"])
    assert f"{path}: 5.00 to 6.00 s at 8000 Hz" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--from", "-1"], "--from must be >= 0 and finite, got -1.0"),
        (["--to", "0"], "--to must be > 0 and finite, got 0.0"),
        (["--from", "1.5", "--to", "1.5"], r"--to must be above --from, 1\.5 s, got 1\.5"),
        (["--from", "2"], r"a\.wav: --from must be below 2\.000 s, where .* ends, got 2\.0"),
        (["--to", "2.5"], r"a\.wav: --to must be at most 2\.000 s, where .* ends, got 2\.5"),
    ],
)
def test_a_bad_span_is_refused_by_its_option(capsys, walks, arguments, reason):
    with pytest.raises(MuteError, match=reason):
        meter.main([str(walks / "a.wav"), *arguments])
    assert capsys.readouterr().out == ""


def test_a_span_that_one_of_several_recordings_lacks_is_that_one_s_fault(capsys, walks, tmp_path):
    write_sound(tmp_path / "long.wav", tone(0.1, rate=8000, seconds=3.0), 8000)
    files = [str(walks / "a.wav"), str(tmp_path / "long.wav")]
    assert meter.main([*files, "--from", "2", "--json"]) == 2
    captured = capsys.readouterr()
    assert [figures["file"] for figures in json.loads(captured.out)] == [files[1]]
    assert "a.wav: --from must be below 2.000 s" in captured.err


def test_the_json_has_the_third_octaves_always(capsys, tmp_path):
    noise = 0.1 * np.random.default_rng(6).standard_normal(RATE)
    write_sound(tmp_path / "noise.wav", noise, RATE, "DOUBLE")
    figures, _ = run(capsys, tmp_path / "noise.wav")
    whole = ThirdOctaveMeter(RATE, reference=1.0)
    whole.update(noise[None])
    expected = [{"frequency": band.frequency, "level": band.level} for band in whole.result()]
    assert [band["frequency"] for band in figures["third_octaves"]][::10] == [25.0, 250.0, 2500.0]
    for band, other in zip(figures["third_octaves"], expected, strict=True):
        assert band == pytest.approx(other, abs=1e-9)


def test_third_octaves_are_calibrated_and_unweighted(capsys, walks, tmp_path):
    write_sound(tmp_path / "low.wav", tone(0.1, 100.0, rate=8000), 8000)
    arguments = ("--calibration-db", 94, "--calibration-file", walks / "cal.wav")
    figures, _ = run(capsys, tmp_path / "low.wav", *arguments)
    levels = {band["frequency"]: band["level"] for band in figures["third_octaves"]}
    assert levels[100.0] == pytest.approx(94.0 - 6.02, abs=0.02)
    assert figures["laeq"] == pytest.approx(94.0 - 6.02 - 19.1, abs=0.1)


def test_a_band_without_a_level_is_null(capsys, tmp_path):
    write_sound(tmp_path / "step.wav", tone(0.1, seconds=0.3, rate=8000), 8000)
    figures, _ = run(capsys, tmp_path / "step.wav")
    levels = {band["frequency"]: band["level"] for band in figures["third_octaves"]}
    assert levels[25.0] is None
    assert levels[1000.0] == pytest.approx(-20.0, abs=0.05)


def test_the_table_of_third_octaves_is_printed_where_it_is_asked_for(capsys, walks):
    meter.main([str(walks / "a.wav")])
    assert "third octaves" not in capsys.readouterr().out
    meter.main([str(walks / "a.wav"), "--spectrum"])
    lines = capsys.readouterr().out.splitlines()
    first = lines.index("third octaves, unweighted: Hz, dBFS")
    table = " ".join(lines[first + 1 :]).split()
    assert len(lines) - first - 1 == 8
    assert table[::2][:4] == ["25", "31.5", "40", "50"]
    assert float(table[table.index("1000") + 1]) == pytest.approx(-20.0, abs=0.01)


def test_the_loudness_of_a_span_is_taken_of_it_alone(capsys, walks, monkeypatch):
    heard = []

    def loudness_zwtv(pressure, sample_rate, field_type):
        heard.append(len(pressure) / sample_rate)
        return np.arange(101.0), None, None, None

    monkeypatch.setitem(sys.modules, "mosqito", SimpleNamespace(loudness_zwtv=loudness_zwtv))
    arguments = ("--loudness", "--calibration-db", 94, "--calibration-file", walks / "cal.wav")
    figures, _ = run(capsys, walks / "a.wav", *arguments, "--from", 0.5, "--to", 1.25)
    assert heard == [0.75]
    assert figures["loudness_n5"] == 95.0
