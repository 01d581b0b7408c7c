"""What the keys of the window do to a walk."""

from __future__ import annotations

from mute.evaluation.session import Session

__all__ = ["KEYS_HELP", "press"]

KEYS_HELP = """\
Keys in the window:
  up, down       faster, slower (vx +-0.1 m/s)
  left, right    turn left, right (wz +-0.1 rad/s)
  Q, E           step left, right (vy +-0.1 m/s)
  B, V           quieter, less quiet (beta +-0.1)
  space          stand still, and go on as before
  R              start again"""

# Codes are GLFW's. The viewer has a use for every letter; these ones' change nothing to be seen.
_STEPS: dict[int, dict[str, float]] = {
    265: {"vx": 0.1},
    264: {"vx": -0.1},
    263: {"wz": 0.1},
    262: {"wz": -0.1},
    ord("Q"): {"vy": 0.1},
    ord("E"): {"vy": -0.1},
    ord("B"): {"beta": 0.1},
    ord("V"): {"beta": -0.1},
}
_STAND, _RESTART = ord(" "), ord("R")


def press(session: Session, key: int) -> None:
    """Do what a key asks for; unknown keys do nothing.

    Args:
        session: The walk to steer.
        key: GLFW's code of the key.
    """
    if key in _STEPS:
        session.set_command(session.command.changed(**_STEPS[key]))
    elif key == _STAND:
        session.stop_or_go()
    elif key == _RESTART:
        session.restart()
