"""Modules of a user's are imported by name, and say in one line what is wrong with them."""

from __future__ import annotations

import sys

import pytest

from mute.support.errors import MuteError
from mute.support.plugins import PLUGINS, load_plugin, load_plugins


@pytest.fixture(autouse=True)
def _folder(tmp_path, monkeypatch):
    """Work in an empty folder, and forget what is imported from it."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    before = set(sys.modules)
    yield tmp_path
    for name in set(sys.modules) - before:
        del sys.modules[name]


def test_all_modules_that_the_environment_names_are_imported(tmp_path, monkeypatch):
    for name in ("mute_one", "mute_two", "mute_three"):
        (tmp_path / f"{name}.py").write_text("")
    monkeypatch.setenv(PLUGINS, "mute_one, mute_two")
    load_plugins()
    assert {"mute_one", "mute_two"} <= set(sys.modules)
    assert "mute_three" not in sys.modules


def test_without_the_variable_nothing_is_imported(monkeypatch):
    monkeypatch.delenv(PLUGINS, raising=False)
    path = list(sys.path)
    load_plugins()
    assert sys.path == path


def test_a_module_of_the_folder_hides_none_that_is_installed(tmp_path):
    (tmp_path / "mute_plugin.py").write_text("import colorsys\nFOUND = colorsys.__file__\n")
    (tmp_path / "colorsys.py").write_text("raise RuntimeError\n")
    sys.modules.pop("colorsys", None)
    load_plugin("mute_plugin", "--task")
    assert str(tmp_path) not in sys.modules["mute_plugin"].FOUND


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("mute_missing", None, ["--task", "no module 'mute_missing'"]),
        ("mute_missing.tasks", None, ["--task", "no module 'mute_missing.tasks'"]),
        ("mute_bad", "\n1 / 0\n", ["'mute_bad'", "division by zero", "mute_bad.py:2"]),
        ("mute_bad", "import mute_gone\n", ["'mute_bad'", "mute_gone", "mute_bad.py:1"]),
        ("mute_bad", "raise ValueError('the floor is taken')\n", ["the floor is taken", ":1"]),
        ("mute_bad", "import = 3\n", ["'mute_bad'", "invalid syntax"]),
        ("../tasks", None, ["modules such as my_tasks", "'../tasks'"]),
        ("", None, ["modules such as my_tasks", "''"]),
    ],
)
def test_a_module_that_cannot_be_imported_is_told_in_one_line(name, content, words, tmp_path):
    if content is not None:
        (tmp_path / f"{name}.py").write_text(content)
    with pytest.raises(MuteError) as caught:
        load_plugin(name, "--task")
    message = str(caught.value)
    assert "\n" not in message
    assert all(word in message for word in words), message
