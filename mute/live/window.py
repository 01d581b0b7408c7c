"""A window to watch and steer a walk in, at the speed of real time.

The window is MuJoCo's own viewer. Whether one can open is `backend`'s to tell, what its keys do is
`keys`'.
"""

from __future__ import annotations

import contextlib
import queue
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import mujoco
import mujoco.viewer

from mute.envs.picture import Picture
from mute.evaluation.session import Session
from mute.live.gamepad import Gamepad
from mute.live.keys import press
from mute.live.pace import wait_until
from mute.rendering.height_dots import HeightDots
from mute.support.errors import MuteError

__all__ = ["watch"]

_CLOSING_TIME = 5.0
"""Longest time that a window may take to close, s."""


def watch(
    session: Session,
    num_steps: int | None,
    captions: Callable[[], dict[str, str]],
    dots: HeightDots | None = None,
    gamepad: Gamepad | None = None,
) -> None:
    """Walk in a window until it is closed or the time is over.

    Args:
        session: The walk; robot 0 is shown.
        num_steps: Control steps to walk; None for as long as the window is open.
        captions: Gives the figures to show in the window, by name; asked once a second.
        dots: Heights to draw as dots.
        gamepad: Steers beside the keys.

    Raises:
        MuteError: If this Python cannot open windows (on macOS, that is mjpython's alone).
    """
    env, keys = session.env, queue.SimpleQueue[int]()
    picture = Picture(env)
    picture.show(0)
    per_second = round(1.0 / env.step_dt)
    due, walked = time.perf_counter(), 0
    with _open(picture.model, picture.data, keys.put) as viewer:
        viewer.cam.type = mujoco.mjtCamera.mjCAMERA_TRACKING
        viewer.cam.trackbodyid = picture.model.body("trunk").id
        viewer.cam.azimuth, viewer.cam.elevation, viewer.cam.distance = 125.0, -14.0, 1.5
        while viewer.is_running() and (num_steps is None or walked < num_steps):
            while not keys.empty():
                press(session, keys.get())
            if gamepad is not None:
                gamepad.steer(session)
            session.step()
            walked += 1
            with viewer.lock():
                picture.show(0)
                if dots is not None:
                    viewer.user_scn.ngeom = 0
                    dots.add_to(viewer.user_scn)
            if session.steps % per_second == 0:
                shown = captions()
                viewer.set_texts((None, None, "\n".join(shown), "\n".join(shown.values())))
            viewer.sync()
            due = wait_until(due + env.step_dt)


@contextlib.contextmanager
def _open(
    model: mujoco.MjModel, data: mujoco.MjData, on_key: Callable[[int], None]
) -> Iterator[Any]:
    """Yield an open window, and leave nothing of it behind."""
    others = set(threading.enumerate())
    try:
        viewer = mujoco.viewer.launch_passive(
            model, data, key_callback=on_key, show_left_ui=False, show_right_ui=False
        )
    except RuntimeError as error:
        raise MuteError(f"no window: {error}") from error
    threads = set(threading.enumerate()) - others
    try:
        yield viewer
    finally:
        viewer.close()
        # The thread that draws still cleans up; the process must not end under it.
        for thread in threads:
            thread.join(_CLOSING_TIME)
