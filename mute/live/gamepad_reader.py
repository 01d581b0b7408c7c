"""Reads the first gamepad by GLFW and writes its states as lines of JSON: a process of its own.

GLFW reads gamepads in a process's main thread alone, between its events. MuJoCo's window has GLFW
in a thread of its own, which handles gamepads that come and go at any time: to read one from
another thread could find its memory freed. So `gamepad_process` starts this file, which ends when
its standard input does. It imports nothing of MUTE's, and so starts at once.

Lines are `{"pad": NAME, "axes": [...], "buttons": [...]}` for a state that has changed, with the
buttons that are held in GLFW's standard layout, `{"pad": null}` for a gamepad that is gone, and
`{"note": TEXT}` for what the user is to know.
"""

from __future__ import annotations

import importlib
import json
import os
import signal
import sys
import threading
from collections.abc import Callable
from typing import Any

__all__ = ["Reader", "main"]

_PERIOD = 0.01
"""Time between two looks, s."""

_MAPPINGS = "SDL_GAMECONTROLLERCONFIG"
"""Environment variable with further mappings, as games know it."""


class Reader:
    """Finds what has changed since it last looked."""

    def __init__(self, glfw: Any) -> None:  # noqa: ANN401
        """Begin without a gamepad.

        Args:
            glfw: The library, which is initialised.
        """
        self._glfw = glfw
        self._pad: int | None = None
        self._last: dict[str, object] | None = None
        self._unknown: set[int] = set()

    def look(self) -> list[dict[str, object]]:
        """Return what is to be written, in order."""
        self._glfw.poll_events()
        written: list[dict[str, object]] = []
        state = None if self._pad is None else self._state(self._pad)
        if self._pad is not None and state is None:
            written.append({"pad": None})
            self._pad, self._last = None, None
        if self._pad is None:
            written += self._notes()
            self._pad = next(filter(self._glfw.joystick_is_gamepad, self._joysticks()), None)
            state = None if self._pad is None else self._state(self._pad)
        if state is not None and state != self._last:
            written.append(state)
            self._last = state
        return written

    def _joysticks(self) -> list[int]:
        glfw = self._glfw
        ids = range(glfw.JOYSTICK_1, glfw.JOYSTICK_LAST + 1)
        return [index for index in ids if glfw.joystick_present(index)]

    def _notes(self) -> list[dict[str, object]]:
        """Return a note on each new joystick whose layout is not known."""
        present = set(self._joysticks())
        unknown = {index for index in present if not self._glfw.joystick_is_gamepad(index)}
        new = sorted(unknown - self._unknown)
        self._unknown = unknown
        return [
            {
                "note": f"the joystick {_text(self._glfw.get_joystick_name(index))} is let be: its "
                f"layout is not known; {_MAPPINGS} takes it in SDL's form"
            }
            for index in new
        ]

    def _state(self, index: int) -> dict[str, object] | None:
        state = self._glfw.get_gamepad_state(index)
        if state is None:
            return None
        held = [button for button, pressed in enumerate(state.buttons) if pressed]
        axes = [round(float(axis), 4) for axis in state.axes]
        name = _text(self._glfw.get_gamepad_name(index))
        return {"pad": name, "axes": axes, "buttons": held}


def _text(name: bytes | str | None) -> str:
    """Return a name, printable and not too long."""
    text = name.decode(errors="replace") if isinstance(name, bytes) else name or "without a name"
    return "".join(mark for mark in text if mark.isprintable())[:60]


def main(
    glfw: Any,  # noqa: ANN401
    write: Callable[[str], object],
    ended: threading.Event,
) -> None:
    """Read until it is ended.

    Args:
        glfw: The library.
        write: Takes lines.
        ended: Is set to end it.
    """

    def tell(what: dict[str, object]) -> None:
        write(json.dumps(what) + "\n")

    if not glfw.init():
        tell({"note": "no gamepad can be read: GLFW does not start here"})
        return
    try:
        mappings = os.environ.get(_MAPPINGS)
        if mappings:
            glfw.update_gamepad_mappings(os.fsencode(mappings))
        reader = Reader(glfw)
        while not ended.wait(_PERIOD):
            for what in reader.look():
                tell(what)
    finally:
        glfw.terminate()


def _read_for_another_process() -> None:
    """Write to standard output until standard input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # is for who started this, and ends it in turn
    ended = threading.Event()

    def wait() -> None:
        sys.stdin.read()
        ended.set()

    threading.Thread(target=wait, daemon=True).start()

    def write(line: str) -> None:
        try:
            sys.stdout.write(line)
            sys.stdout.flush()
        except OSError:  # nobody reads any more
            ended.set()

    library: Any = importlib.import_module("glfw")
    library.ERROR_REPORTING = "ignore"  # a line of its own for each state that is not there
    main(library, write, ended)


if __name__ == "__main__":
    _read_for_another_process()
