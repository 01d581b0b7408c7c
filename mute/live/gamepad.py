"""A gamepad: its left stick drives, its right one turns, buttons do what keys do.

Layout, slack and response are those of the page on the web, in the names of an Xbox controller:
a pulled stick asks for a share of the speeds that are trained, one that is let go leaves the
command to the keys.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from mute.evaluation.session import Session

__all__ = ["GAMEPAD_HELP", "Gamepad", "GamepadSource", "PadState", "Pull", "pull", "without_slack"]

GAMEPAD_HELP = """\
A gamepad, if one is there:
  left stick     walk forward, back, to the left and right
  right stick    turn
  RB, LB         quieter, less quiet (beta +-0.1)
  A, X, Start    stand still or go on, push, start again"""

_SLACK = 0.12
"""Share of its reach within which a stick counts as let go."""

_LEFT_X, _LEFT_Y, _RIGHT_X = 0, 1, 2
"""Axes, as GLFW's standard layout counts them."""

_STOP, _PUSH, _LESS_QUIET, _QUIETER, _RESTART = 0, 2, 4, 5, 7
"""Buttons of that layout: A, X, the left and the right bumper, and Start."""

_PUSH_SPEED = 1.0
"""Change of the trunk's velocity by a push, to one side and the other in turn, m/s."""

_BETA_STEP = 0.1


@dataclass(frozen=True)
class PadState:
    """What a gamepad is asked at one time, in GLFW's standard layout."""

    name: str
    """What it calls itself."""
    axes: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, -1.0, -1.0)
    """From -1 to 1; sticks to the right and down."""
    buttons: frozenset[int] = frozenset()
    """Those that are held."""


class GamepadSource(Protocol):
    """Where states of a gamepad come from."""

    def read(self) -> list[PadState | str | None]:
        """Return what came since the last call, in order.

        States; None where a gamepad that was there is gone; a text to tell the user.
        """
        ...


@dataclass(frozen=True)
class Pull:
    """Where the sticks are pulled, in shares of what is trained, from -1 to 1."""

    forward: float = 0.0
    left: float = 0.0
    turn: float = 0.0


def without_slack(share: float) -> float:
    """Return how far a stick is pulled, without what a hand does not mean.

    Args:
        share: Of its reach, from -1 to 1; a number that is none counts as 0.
    """
    if not math.isfinite(share):
        return 0.0
    beyond = (abs(share) - _SLACK) / (1.0 - _SLACK)
    return math.copysign(min(beyond, 1.0), share) if beyond > 0.0 else 0.0


def pull(axes: tuple[float, ...]) -> Pull:
    """Return where sticks are pulled.

    Args:
        axes: Of a `PadState`; those that are missing count as let go.
    """

    def along(axis: int) -> float:
        # Sticks count to the right and down, robots forward and to the left; and no -0.0.
        return -without_slack(axes[axis]) or 0.0 if axis < len(axes) else 0.0

    return Pull(forward=along(_LEFT_Y), left=along(_LEFT_X), turn=along(_RIGHT_X))


class Gamepad:
    """Steers a walk by what a gamepad is asked."""

    def __init__(self, source: GamepadSource, tell: Callable[[str], None]) -> None:
        """Begin without a gamepad.

        Args:
            source: Where its states come from.
            tell: Is told in a line that a gamepad comes or goes.
        """
        self._source = source
        self._tell = tell
        self._state: PadState | None = None
        self._pull = Pull()
        self._is_stopped = False
        self._pushes = 0

    def steer(self, session: Session) -> None:
        """Do what was asked since the last call; call it once a control step."""
        for event in self._source.read():
            if isinstance(event, str):
                self._tell(event)
            elif event is None:
                self._lose(session)
            else:
                self._follow(session, event)
        if self._pull != Pull() and not self._is_stopped:
            self._drive(session, self._pull)

    def _follow(self, session: Session, now: PadState) -> None:
        if self._state is None or self._state.name != now.name:
            self._tell(f"the gamepad {now.name} drives")
        held = self._state.buttons if self._state is not None else frozenset()
        self._state = now
        before, self._pull = self._pull, pull(now.axes)
        if self._is_stopped:
            # Sticks that were held when it was stopped drive again once they were let go.
            self._is_stopped = self._pull != Pull()
        elif self._pull != before:
            self._drive(session, self._pull)
        for button in sorted(now.buttons - held):
            self._press(session, button)

    def _lose(self, session: Session) -> None:
        if self._state is None:
            return
        self._drive(session, Pull())
        self._tell(f"the gamepad {self._state.name} is gone: the robot stands; keys go on")
        self._state, self._pull, self._is_stopped = None, Pull(), False

    @staticmethod
    def _drive(session: Session, asked: Pull) -> None:
        """Ask for shares of the speeds that are trained."""
        trained = session.env.cfg.commands
        command = session.command.with_parts(
            vx=_part(asked.forward, trained.lin_vel_x),
            vy=_part(asked.left, trained.lin_vel_y),
            wz=_part(asked.turn, trained.ang_vel_z),
        )
        if command != session.command:
            session.set_command(command)

    def _press(self, session: Session, button: int) -> None:
        if button == _STOP:
            session.stop_or_go()
            self._is_stopped = session.command.stands and self._pull != Pull()
        elif button == _PUSH:
            side = -1.0 if self._pushes % 2 else 1.0
            self._pushes += 1
            session.push(0.0, side * _PUSH_SPEED)
        elif button == _RESTART:
            session.restart()
        elif button in (_LESS_QUIET, _QUIETER):
            step = _BETA_STEP if button == _QUIETER else -_BETA_STEP
            session.set_command(session.command.changed(beta=step))


def _part(share: float, trained: tuple[float, float]) -> float:
    """Return a share of what is trained one way or the other, in steps of 0.01."""
    return round(abs(share) * trained[0 if share < 0.0 else 1], 2)
