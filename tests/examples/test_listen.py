"""One sound in which beta 0 and beta 1 take turns, its levels and its spectrogram can be made."""

from __future__ import annotations

import json

import listen
import numpy as np
import pytest
import soundfile
import torch
from listen import Sound, Turn, faded, full_scale_for, spectrogram, turn_levels
from PIL import Image
from places import SHIPPED_POLICY

from mute.acoustics.metering.sound_level_meter import SoundLevelMeter
from mute.support.errors import MuteError
from mute.support.provenance import file_sha256

_RATE = 48000
_SHORT = ["--seconds-each", "0.6", "--turns", "2", "--seed", "3"]
_TWO_TURNS = (Turn(0.0, 0.0, 1.0, 0.5), Turn(1.0, 1.0, 2.0, 0.4))


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The folder of a short sound."""
    out = tmp_path_factory.mktemp("made")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(listen, "_WARM_UP", 0.2)
        assert listen.main([*_SHORT, "--out", str(out)]) == 0
    return out


def _tone(pascal, seconds=1.0, frequency=1000.0):
    """Return a tone of some Pa, RMS."""
    time = np.arange(round(seconds * _RATE)) / _RATE
    return np.sqrt(2.0) * pascal * np.sin(2.0 * np.pi * frequency * time)


def _two_turns(pressure, seed=1):
    """Return a sound of two turns of a second each."""
    return Sound(np.rint(pressure * 32767.0 / 4.0).astype(np.int16), 4.0, _TWO_TURNS, seed)


def test_the_sound_has_its_length_and_begins_and_ends_in_silence(made):
    info = soundfile.info(made / "listen-wood.flac")
    assert (info.format, info.subtype, info.channels) == ("FLAC", "PCM_16", 1)
    samples, rate = soundfile.read(made / "listen-wood.flac", dtype="int16")
    assert (rate, len(samples)) == (_RATE, round(1.2 * _RATE))
    assert samples[0] == samples[-1] == 0
    assert 1000 < np.abs(samples.astype(int)).max() <= 32767  # within 30 dB of full scale


def test_the_levels_are_those_of_the_sound_that_is_written(made):
    told = json.loads((made / "listen-wood.json").read_text())
    samples, _ = soundfile.read(made / "listen-wood.flac")
    meter = SoundLevelMeter(_RATE)
    meter.update(samples * told["full_scale_pa"])
    times, readings = meter.detector.reading_times, meter.detector.readings[0]
    assert [(turn["beta"], turn["begin"], turn["end"]) for turn in told["turns"]] == [
        (0.0, 0.0, 0.6),
        (1.0, 0.6, 1.2),
    ]
    # From half a second after the change on; of the last turn, until it fades.
    for beta, first, last in (("beta 0", 0.5, 0.6), ("beta 1", 1.1, 1.1)):
        own = readings[(times > first - 0.01) & (times < last + 0.01)]
        assert told["levels"][beta]["mnl"] == pytest.approx(own.mean(), abs=0.01)
        assert told["levels"][beta]["pnl"] == pytest.approx(own.max(), abs=0.01)


def test_it_is_told_where_the_sound_comes_from(made):
    told = json.loads((made / "listen-wood.json").read_text())
    assert told["policy_sha256"] == file_sha256(SHIPPED_POLICY)
    assert {"commit", "calibration_sha256", "machine"} <= told.keys()
    assert (told["seed"], told["surface"], told["commanded_speed"]) == (3, "wood", 0.5)


def test_the_picture_shows_something(made):
    with Image.open(made / "listen-wood.png") as picture:
        assert picture.format == "PNG" and picture.width > 800
        assert np.asarray(picture.convert("L"), dtype=int).std() > 20.0


def test_equal_seeds_make_equal_sound_and_others_another(made, tmp_path, monkeypatch):
    monkeypatch.setattr(listen, "_WARM_UP", 0.2)
    monkeypatch.setattr(listen, "_picture", lambda *_: b"")  # it takes as long as the walk
    assert listen.main([*_SHORT, "--out", str(tmp_path / "again")]) == 0
    assert listen.main([*_SHORT[:-1], "4", "--out", str(tmp_path / "other")]) == 0
    first = (made / "listen-wood.flac").read_bytes()
    assert (tmp_path / "again" / "listen-wood.flac").read_bytes() == first
    assert (tmp_path / "other" / "listen-wood.flac").read_bytes() != first


def test_a_sound_comes_and_goes_with_half_a_period_of_a_cosine():
    steady = faded(np.ones(_RATE), seconds=0.1)
    assert steady[0] == steady[-1] == 0.0
    assert steady[2400] == pytest.approx(0.5)  # half way
    np.testing.assert_array_equal(steady, steady[::-1])
    assert (steady[4800:-4800] == 1.0).all()


@pytest.mark.parametrize(
    ("peak", "full_scale"), [(0.1, 10.0), (-10.0, 10.0), (10.1, 11.0), (-19.5, 20)]
)
def test_full_scale_is_the_usual_one_unless_that_would_clip(peak, full_scale):
    assert full_scale_for(np.array([0.0, peak, 0.05])) == full_scale


def test_levels_leave_out_what_follows_a_change_and_what_fades():
    quiet_after_loud = np.concatenate([_tone(0.2), _tone(0.1)])
    quiet_after_loud[-4800:] = 0.0
    loud, quiet = turn_levels(_two_turns(quiet_after_loud))
    # 20 readings a second: 0.5 to 1.0 s, and 1.55 to 1.9 s with the one at 1.5 s.
    assert (len(loud), len(quiet)) == (11, 9)
    assert loud == pytest.approx(80.0, abs=0.1)
    # After four time constants exp(-4) of the fourfold energy is left: 0.23 dB.
    assert quiet[0] == pytest.approx(73.98 + 0.23, abs=0.05)
    assert quiet[-1] == pytest.approx(73.98, abs=0.05)


def test_the_spectrogram_has_the_level_of_a_tone_at_its_frequency():
    times, edges, levels = spectrogram(_tone(1.0, seconds=2.0))
    assert levels.shape == (len(edges) - 1, len(times) - 1)
    middle = levels[:, len(times) // 2]
    band = int(np.argmax(middle))
    assert edges[band - 1] < 1000.0 < edges[band + 2]  # in its band or next to its edge
    assert 10.0 * np.log10(np.sum(10.0 ** (middle / 10.0))) == pytest.approx(93.98, abs=0.1)


def test_the_spectrogram_has_a_click_at_its_time():
    click = np.zeros(2 * _RATE)
    click[60000] = 1.0
    times, _, levels = spectrogram(click)
    column = int(np.argmax(levels.max(axis=0)))
    assert times[column] <= 60000 / _RATE <= times[column + 1]


class _Tumbler:
    """Stretches the legs of one side and folds those of the other."""

    num_envs = 1

    def __init__(self, *_):
        pass

    def reset(self, mask=None):
        pass

    def act(self, _):
        return torch.tensor([[0.0, 8.0, -8.0] * 2 + [0.0] * 6])


def test_a_robot_that_falls_gives_way_to_the_next_until_there_have_been_enough(
    monkeypatch, tmp_path, capsys
):
    monkeypatch.setattr(listen, "LearnedController", _Tumbler)
    monkeypatch.setattr(listen, "_SEEDS", 2)
    complaint = "falls on wood at --speed 0.5, with each seed from 3 to 4"
    with pytest.raises(MuteError, match=complaint):
        listen.main([*_SHORT, "--out", str(tmp_path)])
    fallen = [line for line in capsys.readouterr().err.splitlines() if line.endswith("fell")]
    assert fallen == ["the robot of seed 3 fell", "the robot of seed 4 fell"]
    assert list(tmp_path.iterdir()) == []


def test_the_robot_that_stays_up_is_the_one_that_is_told(monkeypatch, tmp_path):
    def walk(args, policy, seed):
        return None if seed == 3 else _two_turns(np.tile(_tone(0.1), 2), seed)

    monkeypatch.setattr(listen, "_walk", walk)
    assert listen.main([*_SHORT, "--out", str(tmp_path)]) == 0
    assert json.loads((tmp_path / "listen-wood.json").read_text())["seed"] == 4


def test_a_file_that_cannot_be_written_leaves_none_of_the_others(monkeypatch, tmp_path):
    monkeypatch.setattr(listen, "_walk", lambda *_: _two_turns(np.tile(_tone(0.1), 2)))
    (tmp_path / "listen-wood.json").mkdir()
    with pytest.raises(MuteError, match=r"cannot write .*listen-wood\.json"):
        listen.main([*_SHORT, "--out", str(tmp_path)])
    assert [path.name for path in tmp_path.iterdir()] == ["listen-wood.json"]


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--surface", "ice"], "--surface must be one of wood.*, got 'ice'"),
        (["--speed", "0"], "--speed must be > 0 and <= 2, got 0"),
        (["--speed", "nan"], "--speed must be > 0 and <= 2, got nan"),
        (["--seconds-each", "0.5"], "--seconds-each must be >= 0.6 and <= 20, got 0.5"),
        (["--turns", "1"], "--turns must be an integer >= 2 and <= 12, got 1"),
        (["--turns", "2.5"], "--turns"),
        (["--seed", "-1"], "--seed must be"),
        (["--sources", "impacts,wind"], "--sources must be of .*, got 'wind'"),
        (["--policy", "nobody.pt"], r"nobody\.pt"),
        (["--louder"], "--louder"),
    ],
)
def test_bad_arguments_are_told_in_one_line_and_make_nothing(
    words, complaint, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(MuteError, match=complaint) as error:
        listen.main([*words, "--out", "made"])
    assert "\n" not in str(error.value)
    assert list(tmp_path.iterdir()) == []


def test_an_out_that_is_no_directory_is_told_before_anybody_walks(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(MuteError, match=r"--out .*file: cannot be made a directory"):
        listen.main([*_SHORT, "--out", str(tmp_path / "file")])
