"""The controls of a page, and the figures in it."""

from __future__ import annotations

import math
import queue
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import viser
from viser import uplot

from mute.controllers import Controller
from mute.controllers.command import COMMAND_LIMITS
from mute.evaluation.session import Session

__all__ = ["TRACE_RATE", "Choice", "Panel"]

TRACE_RATE = 5.0
"""Points of the level's trace a second."""
_TRACE_SECONDS = 20.0
_LEVELS = (30.0, 100.0)
"""Lowest and highest level of the trace, dBA."""
_SLIDERS = {
    "beta": "quiet factor β",
    "vx": "forward (m/s)",
    "vy": "to the left (m/s)",
    "wz": "turn left (rad/s)",
}
"""What each part of a command is called."""
_STEP = 0.05
"""Of a slider."""
_PUSH = 0.5
"""Change of the trunk's velocity by a push, m/s."""


@dataclass(frozen=True)
class Choice:
    """What may drive the robots of a walk."""

    controller: Controller
    """Drives as many."""
    quiet_factor: bool = True
    """Whether beta changes how it walks."""


class Panel:
    """The controls of the page, and the figures in it.

    The page's threads only put what is asked for in a queue; `obey` does it in the thread that
    walks.
    """

    def __init__(
        self, server: viser.ViserServer, session: Session, choices: Mapping[str, Choice]
    ) -> None:
        """Put the controls into a page.

        Args:
            server: Serves the page.
            session: The walk to steer.
            choices: What may drive the robots, by name; the first one does.
        """
        self._session = session
        self._choices = choices
        self._asked = queue.SimpleQueue[Callable[[], None]]()
        gui = server.gui
        names = list(choices)
        self._driver = names[0]
        self.choice = gui.add_dropdown("walks", names, initial_value=names[0])
        """Chooses what drives the robots."""
        self.sliders = {
            name: gui.add_slider(
                label, *COMMAND_LIMITS[name], _STEP, float(getattr(session.command, name))
            )
            for name, label in _SLIDERS.items()
        }
        """Set the parts of the command, by name."""
        self.buttons = {
            "stop": gui.add_button("stop / go on"),
            "push": gui.add_button("push"),
            "restart": gui.add_button("start again"),
        }
        """Do what they say, by name."""
        self.figures = gui.add_markdown("")
        """Shows the figures."""
        self._trace: deque[tuple[float, float]] = deque(maxlen=round(_TRACE_SECONDS * TRACE_RATE))
        self.plot = self._add_plot(gui) if session.listener is not None else None
        """Shows the level's trace; None where nothing is heard."""
        self._tell_whether_beta_counts()
        self._connect()

    def obey(self) -> None:
        """Do all that was asked for since this was last called."""
        while not self._asked.empty():
            self._asked.get()()

    def show(self, captions: Mapping[str, str]) -> None:
        """Show figures, by name."""
        self.figures.content = "\n".join(f"- {name}: **{text}**" for name, text in captions.items())

    def trace(self) -> None:
        """Add the level of now to its trace."""
        listener = self._session.listener
        if self.plot is None or listener is None:
            return
        level = listener.level()
        if math.isfinite(level):
            self._trace.append((self._session.seconds, level))
        if len(self._trace) > 1:
            seconds, levels = np.array(self._trace).T
            self.plot.data = (seconds, levels)

    def _connect(self) -> None:
        for slider in self.sliders.values():
            slider.on_update(lambda _: self._asked.put(self._steer))
        actions = {"stop": self._stop_or_go, "push": self._push, "restart": self._restart}
        for name, action in actions.items():
            self.buttons[name].on_click(lambda _, action=action: self._asked.put(action))
        self.choice.on_update(lambda _: self._asked.put(self._choose))

    def _steer(self) -> None:
        """Ask for what the sliders say; several that moved at once are one new command.

        What comes from a browser may be anything: numbers that are none are left alone, and none
        goes further than a slider.
        """
        asked = {name: float(slider.value) for name, slider in self.sliders.items()}
        numbers = {name: value for name, value in asked.items() if math.isfinite(value)}
        command = self._session.command.with_parts(**numbers)
        if command != self._session.command:
            self._session.set_command(command)

    def _stop_or_go(self) -> None:
        self._session.stop_or_go()
        for name, slider in self.sliders.items():
            slider.value = float(getattr(self._session.command, name))

    def _push(self) -> None:
        angle = 2.0 * math.pi * np.random.default_rng().random()
        self._session.push(_PUSH * math.cos(angle), _PUSH * math.sin(angle))

    def _restart(self) -> None:
        self._trace.clear()
        self._session.restart()

    def _choose(self) -> None:
        """Let something else drive, with no past; the robots go on as they stand."""
        if self.choice.value != self._driver and self.choice.value in self._choices:
            self._driver = self.choice.value
            self._session.drive_with(self._choices[self._driver].controller)
            self._tell_whether_beta_counts()

    def _tell_whether_beta_counts(self) -> None:
        """Let the slider of beta be moved where that changes the walk."""
        self.sliders["beta"].disabled = not self._choices[self._driver].quiet_factor

    @staticmethod
    def _add_plot(gui: viser.GuiApi) -> Any:  # noqa: ANN401
        start = np.array([0.0, 1.0])
        return gui.add_uplot(
            data=(start, np.full(2, np.nan)),
            series=(
                uplot.Series(label="s"),
                uplot.Series(label="dBA, modelled", stroke="#1f6f8b", width=2),
            ),
            scales={
                "x": uplot.Scale(time=False, auto=True),
                "y": uplot.Scale(auto=False, range=_LEVELS),
            },
            legend=uplot.Legend(show=False),
            title="level (dBA, Fast), modelled",
            aspect=1.6,
        )
