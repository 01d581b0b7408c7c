"""What can render on this machine: off-screen OpenGL for videos, a display for a window.

MuJoCo reads `MUJOCO_GL` once, as it is imported, and a library that is missing or broken can end
the process. So everything is tried in a child process first, and this module imports neither
mujoco nor torch. Rendering itself is left to `video` and `window`.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping, Sequence

from mute.support.errors import MuteError

__all__ = ["configure_rendering", "find_backend", "has_display", "why_no_window"]

_TRY_OFFSCREEN = """
import os, mujoco
context = mujoco.GLContext(16, 16)
context.make_current()
mujoco.MjrContext(mujoco.MjModel.from_xml_string("<mujoco/>"), 100)
os._exit(0)
"""
_TRY_WINDOW = """
import os, glfw
glfw.init() or os._exit(1)
glfw.window_hint(glfw.VISIBLE, glfw.FALSE)
os._exit(0 if glfw.create_window(64, 64, "", None, None) else 1)
"""
_TIMEOUT = 60.0
"""Longest time that a trial may take, s; a broken driver can hang."""

_INSTALL = "on Debian: apt install libegl1 libgl1-mesa-dri, or libosmesa6"


def configure_rendering(argv: Sequence[str]) -> None:
    """Set `MUJOCO_GL` for what the command line asks; call it before mujoco is imported.

    For a video it is what renders. Else nothing is rendered off-screen, and a value that MuJoCo
    does not know, or whose libraries are missing, must not end its import.

    Raises:
        MuteError: If nothing on this machine renders off-screen; says what to install.
    """
    wants_video = any(word == "--video" or word.startswith("--video=") for word in argv)
    given = os.environ.get("MUJOCO_GL", "")
    # Elsewhere than on Linux, MuJoCo has one way to render, and it needs no choice.
    if wants_video and (given or sys.platform == "linux"):
        os.environ["MUJOCO_GL"] = find_backend(os.environ)
    elif given:
        os.environ["MUJOCO_GL"] = "disable"


def find_backend(environ: Mapping[str, str]) -> str:
    """Return the value of `MUJOCO_GL` that renders off-screen here; the user's own goes first.

    Raises:
        MuteError: If there is none, or if the user's own does not work.
    """
    given = environ.get("MUJOCO_GL", "")
    if given:
        if _succeeds(_TRY_OFFSCREEN, {**environ, "MUJOCO_GL": given}):
            return given
        raise MuteError(
            f"--video: MUJOCO_GL={given} does not render off-screen here; unset it to let another "
            f"be found, or install what it needs ({_INSTALL})"
        )
    candidates = ["egl", "osmesa"] + ["glfw"] * has_display(environ, sys.platform)
    for backend in candidates:
        if _succeeds(_TRY_OFFSCREEN, {**environ, "MUJOCO_GL": backend}):
            return backend
    raise MuteError(
        f"--video needs EGL or OSMesa to render off-screen, and neither works; {_INSTALL}"
    )


def has_display(environ: Mapping[str, str], platform: str) -> bool:
    """Tell whether a window could have somewhere to appear."""
    if platform != "linux":
        return True
    return bool(environ.get("DISPLAY") or environ.get("WAYLAND_DISPLAY"))


def why_no_window(environ: Mapping[str, str], platform: str) -> str | None:
    """Return what keeps a window from opening, None if nothing does."""
    if not has_display(environ, platform):
        return "there is no display, DISPLAY is not set"
    if platform == "darwin" and "MJPYTHON_BIN" not in environ:
        return "on macOS a window needs mjpython, which comes with mujoco, in place of python"
    # A display may be named and be gone; MuJoCo would wait for its window for ever.
    if not _succeeds(_TRY_WINDOW, environ):
        return "no window with OpenGL opens on this display"
    return None


def _succeeds(code: str, environ: Mapping[str, str]) -> bool:
    """Run Python code in a child process and tell whether it ended well."""
    try:
        trial = subprocess.run(
            [sys.executable, "-c", code],
            env=dict(environ),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=_TIMEOUT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return False
    return trial.returncode == 0
