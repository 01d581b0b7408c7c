"""A page to watch and steer a walk in, from any browser, at the speed of real time.

For machines without a display: viser serves the page, mjviser draws the robot in it. Needs the
extra `web` (`pip install 'mute[web]'`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

import viser

from mute.evaluation.session import Session
from mute.live.pace import wait_until
from mute.live.page_scene import PageScene
from mute.live.panel import TRACE_RATE, Choice, Panel
from mute.rendering.height_dots import HeightDots

__all__ = ["show_page"]

_PICTURES_PER_SECOND = 30.0


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
    scene = PageScene(server, session, dots)
    panel = Panel(server, session, choices)
    step_dt = session.env.step_dt
    per_second = round(1.0 / step_dt)
    per_picture = max(1, round(1.0 / (_PICTURES_PER_SECOND * step_dt)))
    per_point = max(1, round(1.0 / (TRACE_RATE * step_dt)))
    due, walked = time.perf_counter(), 0
    while num_steps is None or walked < num_steps:
        panel.obey()
        session.step()
        walked += 1
        if session.steps % per_picture == 0:
            scene.update()
        if session.steps % per_point == 0:
            panel.trace()
        if session.steps % per_second == 0:
            panel.show(captions())
        due = wait_until(due + step_dt)
