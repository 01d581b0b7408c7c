"""A page to watch and steer a walk in, from any browser, at the speed of real time.

For machines without a display: viser serves the page, mjviser draws the robot in it. Needs the
extra `web` (`pip install 'mute[web]'`).
"""

from __future__ import annotations

import contextlib
import io
import math
import queue
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import viser
from mjviser import ViserMujocoScene
from viser import uplot

from mute.controllers import Controller
from mute.controllers.command import Command
from mute.envs.picture import Picture
from mute.evaluation.session import Session
from mute.live.pace import wait_until
from mute.rendering.height_dots import HeightDots
from mute.support.errors import MuteError

__all__ = ["Panel", "page_server", "show_page"]

_PICTURES_PER_SECOND = 30.0
_TRACE_SECONDS = 20.0
_TRACE_RATE = 5.0
"""Points of the level's trace a second."""
_SLIDERS = {
    "beta": ("quiet factor beta", 0.0, 1.0, 0.05),
    "vx": ("forward (m/s)", -1.0, 1.0, 0.05),
    "vy": ("to the left (m/s)", -0.5, 0.5, 0.05),
    "wz": ("turn to the left (rad/s)", -1.0, 1.0, 0.05),
}
"""Label, lowest and highest value, and step of each part of a command."""
_PUSH = 0.5
"""Change of the trunk's velocity by a push, m/s."""

Choice = Callable[[], Controller]
"""Makes a controller of the session's robots; raises `MuteError` where it does not fit them."""


@contextlib.contextmanager
def page_server(host: str, port: int) -> Iterator[viser.ViserServer]:
    """Yield a server that serves a page.

    Args:
        host: Address to listen at; 127.0.0.1 is seen by this machine alone.
        port: Port to listen at; where it is taken, the next free one.

    Raises:
        MuteError: If it cannot listen there.
    """
    try:
        with contextlib.redirect_stdout(io.StringIO()):  # viser prints a banner
            server = viser.ViserServer(host=host, port=port, label="MUTE", verbose=False)
    except (OSError, RuntimeError) as error:
        raise MuteError(f"no page at {host}:{port}: {error}") from error
    try:
        yield server
    finally:
        with contextlib.redirect_stdout(io.StringIO()):
            server.stop()


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
        self.choice = gui.add_dropdown("walks", names, initial_value=names[0])
        """Chooses what drives the robots."""
        self.sliders = {
            name: gui.add_slider(label, low, high, step, _held(session.command, name))
            for name, (label, low, high, step) in _SLIDERS.items()
        }
        """Set the parts of the command, by name."""
        self.buttons = {
            "stand": gui.add_button("stand / go on"),
            "push": gui.add_button("push"),
            "restart": gui.add_button("start again"),
        }
        """Do what they say, by name."""
        self.note = gui.add_markdown("")
        """Says what went wrong, if anything did."""
        self.figures = gui.add_markdown("")
        """Shows the figures."""
        self._trace: deque[tuple[float, float]] = deque(maxlen=round(_TRACE_SECONDS * _TRACE_RATE))
        self._plot = self._add_plot(gui) if session.listener is not None else None
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
        if self._plot is None or listener is None:
            return
        level = listener.level()
        if math.isfinite(level):
            self._trace.append((self._session.seconds, level))
        if len(self._trace) > 1:
            seconds, levels = np.array(self._trace).T
            self._plot.data = (seconds, levels)

    def _connect(self) -> None:
        for name, slider in self.sliders.items():
            slider.on_update(lambda _, name=name: self._ask(lambda: self._set(name)))
        actions = {"stand": self._stand_or_go, "push": self._push, "restart": self._restart}
        for name, action in actions.items():
            self.buttons[name].on_click(lambda _, action=action: self._ask(action))
        self.choice.on_update(lambda _: self._ask(self._choose))

    def _ask(self, action: Callable[[], None]) -> None:
        self._asked.put(action)

    def _set(self, name: str) -> None:
        command, value = self._session.command, float(self.sliders[name].value)
        if value != _held(command, name):
            self._session.set_command(command.changed(**{name: value - getattr(command, name)}))

    def _stand_or_go(self) -> None:
        self._session.stop_or_go()
        for name, slider in self.sliders.items():
            slider.value = _held(self._session.command, name)

    def _push(self) -> None:
        angle = 2.0 * math.pi * np.random.default_rng().random()
        self._session.push(_PUSH * math.cos(angle), _PUSH * math.sin(angle))

    def _restart(self) -> None:
        self._trace.clear()
        self._session.restart()

    def _choose(self) -> None:
        """Let something else drive, with no past; the robots go on as they stand."""
        name = self.choice.value
        try:
            controller = self._choices[name]()
        except MuteError as error:
            self.note.content = f"**{name}**: {error}"
            return
        self.note.content = ""
        self._session.drive_with(controller)

    @staticmethod
    def _add_plot(gui: viser.GuiApi) -> Any:  # noqa: ANN401
        start = np.array([0.0, 1.0])
        return gui.add_uplot(
            data=(start, np.array([55.0, 55.0])),
            series=(
                uplot.Series(label="s"),
                uplot.Series(label="dBA, modelled", stroke="#1f6f8b", width=2),
            ),
            scales={
                "x": uplot.Scale(time=False, auto=True),
                "y": uplot.Scale(auto=False, range=(50.0, 90.0)),
            },
            legend=uplot.Legend(show=False),
            title="level (dBA), modelled",
            aspect=1.6,
        )


def show_page(
    server: viser.ViserServer,
    session: Session,
    num_steps: int | None,
    captions: Callable[[], dict[str, str]],
    choices: Mapping[str, Choice],
    dots: HeightDots | None = None,
) -> None:
    """Walk in a page until the time is over, or an interrupt comes.

    Args:
        server: Serves the page.
        session: The walk; robot 0 is shown.
        num_steps: Control steps to walk; None for no end.
        captions: Gives the figures to show, by name; asked once a second.
        choices: What may drive the robots, by name; the first one does.
        dots: Heights to draw as dots.
    """
    env = session.env
    picture = Picture(env)
    picture.show(0)
    scene = ViserMujocoScene(server, picture.model, 1)
    server.initial_camera.position, server.initial_camera.look_at = (1.1, -1.4, 0.6), (0, 0, 0)
    panel = Panel(server, session, choices)
    cloud = _Dots(server, session, dots) if dots is not None else None
    per_second = round(1.0 / env.step_dt)
    per_picture = max(1, round(1.0 / (_PICTURES_PER_SECOND * env.step_dt)))
    per_point = max(1, round(1.0 / (_TRACE_RATE * env.step_dt)))
    due = time.perf_counter()
    while num_steps is None or session.steps < num_steps:
        panel.obey()
        session.step()
        if session.steps % per_picture == 0:
            if picture.show(0):
                scene.rebuild_visual_handles()  # the ground was laid anew
            with server.atomic():
                scene.update_from_mjdata(picture.data)
                if cloud is not None:
                    cloud.update(picture.data.qpos[:3])
        if session.steps % per_point == 0:
            panel.trace()
        if session.steps % per_second == 0:
            panel.show(captions())
        due = wait_until(due + env.step_dt)


class _Dots:
    """Dots at the true and the estimated heights; the scene stands where the robot is."""

    def __init__(self, server: viser.ViserServer, session: Session, dots: HeightDots) -> None:
        self._server, self._session, self._dots = server, session, dots

    def update(self, trunk: np.ndarray) -> None:
        """Draw the dots around the trunk, whose position is given, m. Shape: (3,)."""
        self._dots.controller = self._session.controller
        places, colours = self._dots.points()
        self._server.scene.add_point_cloud(
            "/heights", (places - trunk).astype(np.float32), colours, point_size=0.02
        )


def _held(command: Command, name: str) -> float:
    """Return a part of a command as its slider can hold it."""
    _, low, high, _ = _SLIDERS[name]
    return min(max(getattr(command, name), low), high)
