"""Every option of every command that takes numbers refuses those that are none, in one line."""

from __future__ import annotations

import importlib
import re
import typing
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path

import numpy as np
import pytest
from scipy.io import wavfile

from mute.support.errors import MuteError

_COMMANDS = {
    "play": ("play", "PlayArgs"),
    "evaluate gait": ("evaluate_gait", "GaitArgs"),
    "evaluate progress": ("evaluate_gait", "ProgressArgs"),
    "evaluate noise": ("evaluate_noise", "NoiseArgs"),
    "evaluate sweep-speed": ("evaluate_noise", "SweepSpeedArgs"),
    "evaluate sweep-beta": ("evaluate_noise", "SweepBetaArgs"),
    "evaluate walk": ("evaluate_walk", "WalkArgs"),
    "evaluate terrain": ("evaluate_terrain", "TerrainArgs"),
    "evaluate paper": ("evaluate_paper", "PaperArgs"),
    "evaluate reliability": ("evaluate_reliability", "ReliabilityArgs"),
    "benchmark": ("benchmark", "BenchmarkArgs"),
    "meter": ("meter", "MeterArgs"),
    "calibrate": ("calibrate", "CalibrationArgs"),
    "train": ("train", "TrainArgs"),
    "export": ("export", "ExportArgs"),
    "release": ("release", "ReleaseArgs"),
    "card": ("card", "CardArgs"),
    "web": ("web", "WebArgs"),
}
"""Commands, and where their arguments are."""

_ROOM = "mute.command_lines"


def _number_types(hint: object) -> set[type]:
    """Return which of int and float an annotation holds."""
    if hint in (int, float):
        return {typing.cast(type, hint)}
    return {kind for part in typing.get_args(hint) for kind in _number_types(part)}


def _numbers(command: str) -> Iterator[tuple[str, type]]:
    """Yield the options of a command that take numbers, with the numbers' type."""
    module, name = _COMMANDS[command]
    args_type = getattr(importlib.import_module(f"{_ROOM}.{module}"), name)
    hints = typing.get_type_hints(args_type, include_extras=True)
    for field in fields(args_type):
        if is_dataclass(hints[field.name]):
            continue  # the configuration of a training, see `test_config`
        hint = hints[field.name]
        # An option that is no name of Python's, as --from, is called by what annotates the field.
        names = (getattr(note, "name", None) for note in getattr(hint, "__metadata__", ()))
        option = next(filter(None, names), field.name.replace("_", "-"))
        for kind in _number_types(hint):
            yield option, kind


def _cases() -> Iterator[tuple[str, str, str]]:
    bad = {float: ("nan", "inf", "-inf", "1e+300"), int: ("nan", "inf", "-1", "9" * 40)}
    for command in _COMMANDS:
        for option, kind in _numbers(command):
            for value in bad[kind]:
                yield command, option, value


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("sound") / "tone.wav"
    tone = 0.1 * np.sin(2.0 * np.pi * 1000.0 * np.arange(48000) / 48000.0)
    wavfile.write(path, 48000, tone.astype(np.float32))
    return path


def _needed(command: str, option: str, recording: Path) -> list[str]:
    """Return what a command needs beside the option."""
    if command == "evaluate progress":
        return ["--run", str(recording.parent)]
    if command != "meter":
        return []
    words = [str(recording)]
    if option.startswith("calibration"):
        words += ["--calibration-file", str(recording)]
    if option.startswith("calibration") and option != "calibration-db":
        words += ["--calibration-db", "94"]
    return words


@pytest.mark.parametrize(("command", "option", "value"), list(_cases()))
def test_no_option_takes_a_number_that_is_none_or_beyond_all_use(
    command, option, value, recording, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    program, *sub = command.split()
    argv = [*sub, *_needed(command, option, recording), f"--{option}", value]
    main = importlib.import_module(f"{_ROOM}.{program}").main
    with pytest.raises(MuteError) as caught:
        main(argv)
    message = str(caught.value)
    assert option in message.replace("_", "-"), message
    assert value in message, message
    assert "\n" not in message
    assert list(tmp_path.iterdir()) == []


def test_every_command_is_walked():
    folder = Path(importlib.import_module(_ROOM).__path__[0])
    with_arguments = {
        path.stem
        for path in folder.glob("*.py")
        if not path.stem.endswith("_options")  # what commands share, and so are walked with
        and re.search(r"^class \w*Args\b", path.read_text(), re.MULTILINE)
    }
    assert with_arguments == {module for module, _ in _COMMANDS.values()}


def test_the_commands_have_as_many_options_with_numbers_as_they_seem_to():
    counts = {command: len(list(_numbers(command))) for command in _COMMANDS}
    assert counts["play"] == 9
    assert counts["evaluate sweep-speed"] == 5
    assert counts["benchmark"] == 7
