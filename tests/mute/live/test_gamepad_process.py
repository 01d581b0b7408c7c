"""States come over from the process that reads them, which ends with whom it reads for."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import pytest

from mute.live.gamepad import PadState
from mute.live.gamepad_process import GamepadProcess, gamepad_process

_LINE = '{"pad": "Pad", "axes": [0.5, -1.0], "buttons": [0, 7]}'
_STATE = PadState("Pad", (0.5, -1.0), frozenset((0, 7)))


def _program(*lines: str, last: str = "sys.stdin.read()") -> list[str]:
    """Return a command that writes lines and then does something else."""
    return [sys.executable, "-c", f"import sys\nprint({chr(10).join(lines)!r}, flush=True)\n{last}"]


def _read(states: GamepadProcess, count: int) -> list[PadState | str | None]:
    """Return events as they come, for at most 20 s."""
    events: list[PadState | str | None] = []
    deadline = time.monotonic() + 20.0
    while len(events) < count and time.monotonic() < deadline:
        events += states.read()
        time.sleep(0.01)
    return events


def test_what_a_process_writes_is_read_in_order():
    lines = (_LINE, '{"pad": null}', '{"note": "a joystick is let be"}', _LINE)
    with gamepad_process(_program(*lines)) as states:
        assert _read(states, 4) == [_STATE, None, "a joystick is let be", _STATE]
        assert states.read() == []
    assert states.read() == []  # it ended as it was asked to, and no gamepad is lost by that


def test_a_process_that_ends_by_itself_loses_the_gamepad_and_is_told():
    with gamepad_process(_program(_LINE, last="sys.exit(1)")) as states:
        events = _read(states, 3)
    assert events == [_STATE, None, "no gamepad can be read any more: what reads it has ended"]


def test_a_process_that_has_said_why_it_ends_is_told_once():
    with gamepad_process(_program('{"note": "GLFW does not start"}', last="")) as states:
        assert _read(states, 2) == ["GLFW does not start", None]


def test_a_process_that_will_not_end_is_ended():
    begin = time.monotonic()
    program = _program(_LINE, last="import time\ntime.sleep(60)")
    with gamepad_process(program, closing_time=0.2) as states:
        assert _read(states, 1) == [_STATE]
    assert time.monotonic() - begin < 30.0


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there is always a display")
def test_the_reader_itself_says_where_there_is_no_display(monkeypatch, tmp_path):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))  # where a display may be found by itself
    monkeypatch.chdir(tmp_path)
    # A module of the user's own is no matter to it.
    Path("json.py").write_text("raise ImportError\n")
    with gamepad_process() as states:
        assert _read(states, 2) == ["no gamepad can be read: GLFW does not start here", None]
