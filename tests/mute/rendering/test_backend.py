"""What can render here is found before it is needed, or told in one line."""

from __future__ import annotations

import os
import sys

import pytest

from mute.rendering import backend
from mute.support.errors import MuteError


def _only(*working: str):
    return lambda code, environ: environ.get("MUJOCO_GL") in working


def test_egl_is_tried_before_osmesa(monkeypatch):
    monkeypatch.setattr(backend, "_succeeds", _only("egl", "osmesa"))
    assert backend.find_backend({}) == "egl"
    monkeypatch.setattr(backend, "_succeeds", _only("osmesa"))
    assert backend.find_backend({}) == "osmesa"


def test_the_users_choice_goes_first(monkeypatch):
    monkeypatch.setattr(backend, "_succeeds", _only("egl", "osmesa"))
    assert backend.find_backend({"MUJOCO_GL": "osmesa"}) == "osmesa"


def test_where_nothing_renders_the_packages_to_install_are_named(monkeypatch):
    monkeypatch.setattr(backend, "_succeeds", _only())
    with pytest.raises(MuteError, match="apt install libegl1 libgl1-mesa-dri, or libosmesa6"):
        backend.find_backend({})


def test_a_choice_that_does_not_work_is_told_by_its_name():
    with pytest.raises(MuteError, match="MUJOCO_GL=crayons does not render"):
        backend.find_backend({**os.environ, "MUJOCO_GL": "crayons"})


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere nothing is chosen")
def test_only_a_video_makes_a_choice(monkeypatch):
    monkeypatch.setattr(backend, "_succeeds", _only("osmesa"))
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    backend.configure_rendering(["--beta", "0.5"])
    assert "MUJOCO_GL" not in os.environ
    monkeypatch.setenv("MUJOCO_GL", "")  # restored after the test
    backend.configure_rendering(["--video=walk.mp4"])
    assert os.environ["MUJOCO_GL"] == "osmesa"


@pytest.mark.parametrize(
    ("environ", "platform", "expected"),
    [
        ({}, "linux", False),
        ({"DISPLAY": ":0"}, "linux", True),
        ({"WAYLAND_DISPLAY": "wayland-0"}, "linux", True),
        ({}, "darwin", True),
    ],
)
def test_a_display_is_known_by_its_variables(environ, platform, expected):
    assert backend.has_display(environ, platform) is expected


def test_a_display_that_is_named_and_gone_opens_no_window():
    gone = {**os.environ, "DISPLAY": ":987"}
    gone.pop("WAYLAND_DISPLAY", None)
    assert backend.why_no_window(gone, "linux") == "no window with OpenGL opens on this display"


def test_plain_python_on_macos_is_told_of_mjpython():
    assert "mjpython" in (backend.why_no_window({}, "darwin") or "")
