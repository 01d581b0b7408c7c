"""What a gamepad does is read from GLFW, and written where it changes."""

from __future__ import annotations

import json
import threading
from dataclasses import dataclass, field

import pytest

from mute.live.gamepad_reader import Reader, main


@dataclass
class _State:
    """A state as GLFW's binding gives it."""

    axes: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0, 0.0, -1.0, -1.0])
    buttons: list[int] = field(default_factory=lambda: [0] * 15)


class _Glfw:
    """What is used of GLFW, with joysticks that can be plugged in and out."""

    JOYSTICK_1, JOYSTICK_LAST = 0, 15

    def __init__(self, starts: bool = True) -> None:
        self.starts = starts
        self.pads: dict[int, _State] = {}
        self.unknown: dict[int, bytes] = {}
        self.calls: list[str] = []
        self.mappings: list[bytes] = []

    def init(self) -> bool:
        self.calls.append("init")
        return self.starts

    def terminate(self) -> None:
        self.calls.append("terminate")

    def poll_events(self) -> None:
        self.calls.append("poll")

    def update_gamepad_mappings(self, text: bytes) -> None:
        self.mappings.append(text)

    def joystick_present(self, index: int) -> int:
        return int(index in self.pads or index in self.unknown)

    def joystick_is_gamepad(self, index: int) -> int:
        return int(index in self.pads)

    def get_joystick_name(self, index: int) -> bytes | None:
        return self.unknown.get(index)

    def get_gamepad_name(self, index: int) -> bytes:
        return b"Pad %d" % index

    def get_gamepad_state(self, index: int) -> _State | None:
        return self.pads.get(index)


def _pad(name: str, axes: list[float] | None = None, buttons: list[int] | None = None) -> dict:
    return {"pad": name, "axes": axes or _State().axes, "buttons": buttons or []}


def test_a_state_is_written_where_it_changes():
    glfw = _Glfw()
    reader = Reader(glfw)
    assert reader.look() == []
    glfw.pads[3] = _State()
    assert reader.look() == [_pad("Pad 3")]
    assert reader.look() == []
    glfw.pads[3].axes[1] = -0.123456
    glfw.pads[3].buttons[5] = 1
    glfw.pads[3].buttons[14] = 1
    axes = [0.0, -0.1235, 0.0, 0.0, -1.0, -1.0]
    assert reader.look() == [_pad("Pad 3", axes, [5, 14])]
    assert glfw.calls == ["poll"] * 4  # without which nothing is plugged in or out


def test_the_first_gamepad_counts_until_it_is_gone_and_then_the_next():
    glfw = _Glfw()
    reader = Reader(glfw)
    glfw.pads[1] = _State()
    reader.look()
    glfw.pads[0] = _State()
    assert reader.look() == []
    del glfw.pads[1]
    assert reader.look() == [{"pad": None}, _pad("Pad 0")]
    del glfw.pads[0]
    assert reader.look() == [{"pad": None}]
    assert reader.look() == []


def test_a_joystick_whose_layout_is_not_known_is_told_once():
    glfw = _Glfw()
    reader = Reader(glfw)
    glfw.unknown[0] = "Räder\n".encode()
    (note,) = reader.look()
    assert str(note["note"]).startswith("the joystick Räder is let be: its layout is not known")
    assert reader.look() == []
    glfw.unknown.clear()
    reader.look()
    glfw.unknown[0] = b"\xff" * 200
    (note,) = reader.look()
    assert len(str(note["note"])) < 200


def _run(glfw: _Glfw, until: int = 3) -> list[dict]:
    """Run the program until it has written some lines."""
    lines: list[dict] = []
    ended = threading.Event()

    def write(line: str) -> None:
        assert line.endswith("\n")
        lines.append(json.loads(line))
        state = glfw.pads.get(0)
        if len(lines) == until or state is None:
            ended.set()
        else:
            state.buttons[len(lines)] = 1

    main(glfw, write, ended)
    return lines


def test_the_program_writes_until_it_is_ended(monkeypatch):
    monkeypatch.setenv("SDL_GAMECONTROLLERCONFIG", "0300,Pad,a:b0,platform:Linux,")
    glfw = _Glfw()
    glfw.pads[0] = _State()
    lines = _run(glfw)
    assert [line["buttons"] for line in lines] == [[], [1], [1, 2]]
    assert glfw.calls[0] == "init"
    assert glfw.calls[-1] == "terminate"
    assert glfw.mappings == [b"0300,Pad,a:b0,platform:Linux,"]


def test_the_program_says_where_glfw_does_not_start():
    glfw = _Glfw(starts=False)
    (line,) = _run(glfw)
    assert line == {"note": "no gamepad can be read: GLFW does not start here"}
    assert glfw.calls == ["init"]


def test_glfw_is_left_though_a_look_fails():
    glfw = _Glfw()
    glfw.pads[0] = _State(axes=["x"])  # type: ignore[list-item]
    with pytest.raises(ValueError, match="could not convert"):
        main(glfw, print, threading.Event())
    assert glfw.calls[-1] == "terminate"
