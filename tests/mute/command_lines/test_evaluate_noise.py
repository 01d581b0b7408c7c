"""`evaluate.py noise`, the sweeps, `walk` and the calibration as command lines: files, refusals."""

from __future__ import annotations

import csv
import dataclasses
import json
import wave
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from places import SHIPPED_POLICY

from mute.acoustics.microphone import Microphone
from mute.acoustics.physics.room import OPEN, ROOMS
from mute.command_lines import evaluate, evaluate_noise, sound_options
from mute.command_lines import evaluate_walk as walk
from mute.command_lines.arguments import make_directory
from mute.controllers import load_policy
from mute.evaluation.noise_figures import draw_speed_sweep
from mute.evaluation.noise_levels import NoiseRow
from mute.support.errors import MuteError

SHIPPED = SHIPPED_POLICY
PROMISED = {
    "method", "beta", "surface", "robots", "command_speed", "trials", "mnl_mean", "mnl_std",
    "pnl_mean", "pnl_std", "laeq_mean", "laeq_body", "speed_mean", "velocity_error_sq",
    "landing_speed_rms", "apex_mean", "duty_factor", "stride_frequency", "power",
    "cost_of_transport",
}  # fmt: skip
_FILMED = ["sweep-speed", "--trials", "8", "--beta", "0,0.5,1", "--video", "walk.mp4"]
TENTHS = ",".join(f"{0.1 * tenth:.1f}" for tenth in range(1, 12))


def _row(beta: float, surface: str = "wood", speed: float = 0.5, nominal: bool = False) -> NoiseRow:
    values: dict[str, Any] = dict.fromkeys(NoiseRow.__dataclass_fields__, 0.25)
    values |= {"method": "go1_mute", "beta": beta, "surface": surface, "trials": 1}
    values["robots"] = "nominal" if nominal else "different"
    values |= {"command_speed": speed, "speed_mean": speed, "mnl_mean": 60.0, "pnl_mean": 65.0}
    return NoiseRow(**values)


@pytest.fixture
def asked(monkeypatch) -> list[dict[str, Any]]:
    """Take the place of the measurement; return what it was asked for, floor by floor."""
    calls: list[dict[str, Any]] = []

    def measure(policy, surface, settings, trials, seconds, seed, keep, nominal, **options):
        calls.append({"surface": surface, "keep": keep, "nominal": nominal, **options})
        return [_row(each.beta, surface, each.command_speed, nominal) for each in settings]

    monkeypatch.setattr(evaluate_noise, "measure_noise", measure)
    return calls


def _read_back(directory: Path, name: str) -> list[dict]:
    rows = json.loads((directory / f"{name}.json").read_text())
    with (directory / f"{name}.csv").open() as file:
        for row, line in zip(rows, csv.DictReader(file), strict=True):
            assert row.keys() == line.keys() >= PROMISED
            assert float(line["mnl_mean"]) == row["mnl_mean"]
            assert line["surface"] == row["surface"]
    return rows


# -- really measured -------------------------------------------------------------------------------


def test_noise_prints_a_table_and_writes_csv_json_and_sound(tmp_path, capsys):
    wav = tmp_path / "walk.wav"
    arguments = ["noise", "--surface", "tile,carpet", "--trials", "1", "--seconds", "1.5"]
    assert evaluate.main([*arguments, "--out", str(tmp_path), "--wav", str(wav)]) == 0
    shown = capsys.readouterr().out
    assert "modelled" in shown
    rows = _read_back(tmp_path, "noise")
    assert [(row["surface"], row["beta"]) for row in rows] == [
        ("tile", 0.0), ("tile", 1.0), ("carpet", 0.0), ("carpet", 1.0)
    ]  # fmt: skip
    assert rows[0]["mnl_std"] is None  # one trial has no spread
    assert f" {rows[0]['mnl_mean']:.1f} " in shown
    assert "±" not in shown
    names = ("tile-beta0", "tile-beta1", "carpet-beta0", "carpet-beta1")
    kept = [tmp_path / f"walk-{name}.wav" for name in names]
    for path in kept:
        with wave.open(str(path)) as file:
            assert file.getnframes() == 1.5 * file.getframerate()
    assert not wav.exists()
    written, last = shown.splitlines()[-2:]
    assert written == f"written to {tmp_path}: noise.json, noise.csv, noise_about.json"
    assert last == f"kept: {', '.join(map(str, kept))}"


def test_the_sweeps_write_figures_with_the_data_beside(tmp_path):
    common = ["--trials", "1", "--seconds", "1.2", "--out", str(tmp_path)]
    assert evaluate.main(["sweep-speed", "--speed", "0.4,0.8", "--beta", "0", *common]) == 0
    assert evaluate.main(["sweep-beta", "--beta", "0,1", *common]) == 0
    assert [row["command_speed"] for row in _read_back(tmp_path, "sweep_speed")] == [0.4, 0.8]
    assert [row["command_speed"] for row in _read_back(tmp_path, "sweep_beta")] == [0.8, 0.8]
    for name in ("sweep_speed", "sweep_beta"):
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert "<svg" in (tmp_path / f"{name}.svg").read_text()


def test_the_fan_alone_reads_55_dba_at_the_trunk(tmp_path):
    arguments = ["noise", "--surface", "wood", "--beta", "0", "--trials", "1", "--seconds", "1.5"]
    evaluate.main([*arguments, "--sources", "fan", "--out", str(tmp_path)])
    (row,) = _read_back(tmp_path, "noise")
    assert row["mnl_mean"] == pytest.approx(55.0, abs=0.5)
    about = json.loads((tmp_path / "noise_about.json").read_text())
    assert (about["sources"], about["microphone"]) == (["fan"], "trunk")


# -- what is asked for -----------------------------------------------------------------------------


def test_a_single_setting_keeps_its_sound_in_the_file_that_was_named(asked, tmp_path):
    wav = tmp_path / "walk.wav"
    words = ["--beta", "0.5", "--out", str(tmp_path), "--wav", str(wav)]
    for command in (["noise", "--surface", "tile"], ["sweep-speed", "--speed", "1"]):
        evaluate.main([*command, *words])
        assert asked[-1]["keep"].wav == {0: wav}
        assert asked[-1]["keep"].video == {}


def test_the_sounds_of_a_sweep_are_told_apart_by_speed_and_beta(asked, tmp_path):
    words = ["--speed", "0.4,1", "--beta", "0,0.5", "--wav", str(tmp_path / "s.wav")]
    evaluate.main(["sweep-speed", *words, "--out", str(tmp_path)])
    names = ("s-speed0.4-beta0", "s-speed1-beta0", "s-speed0.4-beta0.5", "s-speed1-beta0.5")
    assert asked[0]["keep"].wav == {i: tmp_path / f"{name}.wav" for i, name in enumerate(names)}


def test_a_listener_and_the_sources_come_to_the_measurement(asked, tmp_path):
    words = ["--microphone", "-0.5,-1,1.2", "--sources", "impacts,drive", "--out", str(tmp_path)]
    evaluate.main(["noise", *words])
    assert [call["surface"] for call in asked] == ["wood", "carpet", "tile"]
    assert asked[0]["microphone"] == Microphone((-0.5, -1.0, 1.2), "beside")
    assert asked[0]["sources"] == ("impacts", "drive")


def test_robots_as_they_are_are_measured_and_twins_of_the_exact_model_beside_if_asked(
    asked, tmp_path, capsys
):
    wav = tmp_path / "walk.wav"
    words = ["--surface", "tile", "--beta", "0", "--out", str(tmp_path), "--wav", str(wav)]
    evaluate.main(["noise", *words])
    assert [call["nominal"] for call in asked] == [False]
    evaluate.main(["noise", *words, "--nominal"])
    assert [call["nominal"] for call in asked[1:]] == [False, True]
    assert [call["keep"].wav for call in asked[1:]] == [{0: wav}, {}]
    assert [row["robots"] for row in _read_back(tmp_path, "noise")] == ["different", "nominal"]
    assert "tile, exact" in capsys.readouterr().out


def test_the_figures_of_a_sweep_are_of_robots_as_they_are(asked, monkeypatch, tmp_path):
    drawn = []
    monkeypatch.setattr(
        "mute.evaluation.noise_figures.draw_beta_sweep", lambda rows, _: drawn.extend(rows) or []
    )
    evaluate.main(["sweep-beta", "--beta", "0,1", "--nominal", "--out", str(tmp_path)])
    assert [row.robots for row in drawn] == ["different", "different"]


def test_a_mean_level_that_is_not_known_well_is_told(monkeypatch, tmp_path, capsys):
    for width, told in ((0.25, False), (0.45, True)):
        row = dataclasses.replace(_row(0.0), mnl_ci95=width)
        monkeypatch.setattr(evaluate_noise, "measure_noise", lambda *_, row=row, **__: [row])
        evaluate.main(["noise", "--surface", "wood", "--beta", "0", "--out", str(tmp_path)])
        assert ("MNL is up to ±0.5 dB; more --trials" in capsys.readouterr().err) == told


def test_floors_that_are_done_outlive_an_interrupt(monkeypatch, tmp_path):
    rows = iter([[_row(0.0)]])

    def measure(*_, **__) -> list[NoiseRow]:
        for row in rows:
            return row
        raise KeyboardInterrupt

    monkeypatch.setattr(evaluate_noise, "measure_noise", measure)
    with pytest.raises(KeyboardInterrupt):
        evaluate.main(["noise", "--beta", "0", "--out", str(tmp_path)])
    assert [row["surface"] for row in _read_back(tmp_path, "noise")] == ["wood"]
    assert json.loads((tmp_path / "noise_about.json").read_text())["stopped"] is True


def test_walls_make_the_levels_come_from_energies(asked, tmp_path):
    words = ["noise", "--surface", "wood", "--out", str(tmp_path)]
    evaluate.main(words)
    evaluate.main([*words, "--room", "ward"])
    evaluate.main([*words, "--room", "60,10"])
    assert [call["from_energies"] for call in asked] == [False, True, True]
    assert [call["room"] for call in asked[:2]] == [OPEN, ROOMS["ward"]]
    assert asked[2]["room"].volume == pytest.approx(60.0)
    assert asked[2]["room"].absorption == 10.0


def test_sound_of_a_room_that_nothing_can_make_is_told_before_anything_is_measured(
    asked, monkeypatch, tmp_path
):
    def fail() -> None:
        raise MuteError("no pyroomacoustics")

    monkeypatch.setattr(sound_options, "check_rooms_heard", fail)
    words = ["--room", "ward", "--out", str(tmp_path), "--beta", "0"]
    for command in (["noise"], ["walk"]):
        with pytest.raises(MuteError, match="no pyroomacoustics"):
            evaluate.main([*command, *words, "--wav", str(tmp_path / "walk.wav")])
    assert asked == []


def test_a_microphone_can_stand_in_the_world(asked, tmp_path):
    evaluate.main(["noise", "--microphone", "world:2,-1.5,1.2", "--out", str(tmp_path)])
    assert asked[0]["microphone"] == Microphone((2.0, -1.5, 1.2), "world")


def test_clipped_samples_are_a_line_on_standard_error(monkeypatch, tmp_path, capsys):
    def measure(*words, **__):
        words[6].note_clipped({0: 12})
        return [_row(0.0)]

    monkeypatch.setattr(evaluate_noise, "measure_noise", measure)
    words = ["--beta", "0", "--wav", "loud.wav", "--out", str(tmp_path)]
    evaluate.main(["noise", "--surface", "wood", *words])
    assert "loud.wav: 12 samples are clipped\n" in capsys.readouterr().err


def test_the_data_outlive_a_figure_that_cannot_be_drawn(asked, monkeypatch, tmp_path):
    def fail(*_):
        raise RuntimeError("no fonts")

    monkeypatch.setattr("mute.evaluation.noise_figures.draw_beta_sweep", fail)
    with pytest.raises(RuntimeError, match="no fonts"):
        evaluate.main(["sweep-beta", "--beta", "0,1", "--out", str(tmp_path)])
    assert len(_read_back(tmp_path, "sweep_beta")) == 2


def test_a_sweep_of_more_betas_than_colours_draws_them_all(monkeypatch, tmp_path):
    figures = []
    monkeypatch.setattr(
        "mute.evaluation.noise_figures.save_figure", lambda figure, _: figures.append(figure) or []
    )
    draw_speed_sweep([_row(0.1 * tenth) for tenth in range(11)], tmp_path)
    assert len(figures[0].axes[0].get_lines()) == 11


def test_a_walk_takes_sources_and_microphone_and_commands_the_course_speed(monkeypatch, tmp_path):
    heard = {}

    def follow(env, controller, course, beta, seed, hold_speed, keep, on_step, **options):
        on_step(1.0)
        heard.update(options, hold_speed=hold_speed)
        raise MuteError("enough")

    monkeypatch.setattr(walk, "follow_course", follow)
    words = ["--sources", "scuffing", "--microphone", "0,2,1.6", "--out", str(tmp_path)]
    with pytest.raises(MuteError, match="enough"):
        evaluate.main(["walk", *words])
    assert heard["sources"] == ("scuffing",)
    assert heard["microphone"] == Microphone((0.0, 2.0, 1.6), "beside")
    assert heard["hold_speed"] is False


# -- bad input -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["noise", "--surface", "wood,ice"], ["--surface", "carpet", "'ice'"]),
        (["noise", "--surface", ""], ["--surface", "none"]),
        (["noise", "--surface", "wood,tile,wood"], ["--surface", "wood again"]),
        (["noise", "--beta", "0,1.2"], ["--beta", "[0, 1]", "1.2"]),
        (["noise", "--beta", "0,x"], ["--beta", "x"]),
        (["noise", "--beta", ""], ["--beta", "none"]),
        (["noise", "--beta", "0.5,0.50"], ["--beta", "0.5 again"]),
        (["noise", "--trials", "0"], ["--trials", "0"]),
        (["noise", "--trials", "2000"], ["--trials", "1024"]),
        (["noise", "--seconds", "nan"], ["--seconds", "nan"]),
        (["noise", "--sources", "fan,bark"], ["--sources", "impacts, body", "'bark'"]),
        (["noise", "--sources", ""], ["--sources", "none"]),
        (["noise", "--sources", "fan,fan"], ["--sources", "fan again"]),
        (["noise", "--microphone", "ceiling"], ["--microphone", "X,Y,Z", "'ceiling'"]),
        (["noise", "--microphone", "world:"], ["world:X,Y,Z", "'world:'"]),
        (["noise", "--microphone", "world:trunk"], ["world:X,Y,Z", "'world:trunk'"]),
        (["noise", "--microphone", "world:0,0,-1"], ["below the ground", "'world:0,0,-1'"]),
        (["noise", "--microphone", "0,1"], ["--microphone", "X,Y,Z", "'0,1'"]),
        (["walk", "--microphone", "0,nan,1"], ["--microphone", "'0,nan,1'"]),
        (["noise", "--microphone", "0,1,-0.2"], ["--microphone", "below the ground"]),
        (["noise", "--microphone", "1e9,0,1"], ["--microphone", "within 100 m"]),
        (["noise", "--room", "cave"], ["--room", "office, corridor, ward", "V,A", "'cave'"]),
        (["walk", "--room", "60"], ["--room", "'60'"]),
        (["walk", "--room", "60,110"], ["--room", "below the 97 m2", "'60,110'"]),
        (["walk", "--room", "1e6,0.1"], ["--room", "reverberation time", "<= 10 s"]),
        (["noise", "--room", "0,10"], ["--room", "volume", ">= 1", "'0,10'"]),
        (["noise", "--room", "60,nan"], ["--room", "absorption area", "'60,nan'"]),
        (["walk", "--trials", "0"], ["--trials", "0"]),
        (["noise", "--wav", "walk.mp3"], ["--wav", "'walk.mp3'"]),
        (["sweep-beta", "--video", "walk.avi"], ["--video", "'walk.avi'"]),
        (["walk", "--video", "walk"], ["--video", "'walk'"]),
        (
            [*_FILMED, "--speed", TENTHS],
            ["--video", "33 films", "at most 32"],
        ),
        (["walk", "--wav", "walk"], ["--wav", "'walk'"]),
        (["sweep-speed", "--speed", "0"], ["--speed", "0"]),
        (["sweep-speed", "--speed", ""], ["--speed", "none"]),
        (["sweep-speed", "--speed", "1,1"], ["--speed", "1.0 again"]),
        (["sweep-beta", "--policy", "absent.pt"], ["absent.pt"]),
        (["loudness"], ["noise", "loudness"]),
        *(
            ([command, "--seed", seed], ["--seed", "2147483647", seed])
            for command in ("noise", "sweep-speed", "sweep-beta", "walk")
            for seed in ("-1", "2147483648")
        ),
    ],
    ids=lambda value: " ".join(value),
)
def test_a_bad_argument_is_refused_in_one_line(arguments, words):
    with pytest.raises(MuteError) as caught:
        evaluate.main(arguments)
    assert "\n" not in str(caught.value)
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize("command", ["noise", "sweep-speed", "sweep-beta", "walk"])
def test_a_directory_that_cannot_be_made_is_told_before_anything_is_measured(
    command, asked, monkeypatch, tmp_path
):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(walk, "follow_course", lambda *_, **__: asked.append({}))
    with pytest.raises(MuteError, match=r"--out .*file/here: cannot be made a directory"):
        evaluate.main([command, "--out", str(tmp_path / "file" / "here")])
    assert asked == []


def test_a_directory_that_cannot_be_written_to_is_told(monkeypatch, tmp_path):
    monkeypatch.setattr("mute.command_lines.arguments.os.access", lambda *_: False)
    with pytest.raises(MuteError, match="cannot be written to"):
        make_directory(tmp_path)


def test_a_policy_that_acts_between_physics_steps_is_told_in_one_line(monkeypatch):
    policy = load_policy(SHIPPED)
    scene = dataclasses.replace(policy.cfg.env.scene, timestep=0.0025)
    env = dataclasses.replace(policy.cfg.env, scene=scene, decimation=5)
    odd = SimpleNamespace(cfg=SimpleNamespace(env=env))
    monkeypatch.setattr(sound_options, "load_policy", lambda _: odd)
    with pytest.raises(MuteError, match=r"odd\.pt cannot be heard: .* multiple of 0\.001 s"):
        sound_options.load_audible_policy(Path("odd.pt"))
