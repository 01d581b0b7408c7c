"""What the pages point at is there: links, files, modules; and the front page stays a page."""

from __future__ import annotations

import ast
import importlib
import re
from pathlib import Path

import pytest
from PIL import Image
from places import REPOSITORY

_PAGES = sorted([*REPOSITORY.glob("*.md"), *(REPOSITORY / "docs").glob("*.md")])
_ROOTS = (
    "train.py",
    "play.py",
    "evaluate.py",
    "mute",
    "envs",
    "networks",
    "benchmarks",
    "examples",
)
_SOURCES = sorted(
    path
    for root in _ROOTS
    for path in ([REPOSITORY / root] if root.endswith(".py") else (REPOSITORY / root).rglob("*.py"))
)


def _ids(paths: list[Path]) -> list[str]:
    return [str(path.relative_to(REPOSITORY)) for path in paths]


def _anchors(page: Path) -> set[str]:
    """Return the anchors that a page's headings have on GitHub."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\s-]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", _PAGES, ids=_ids(_PAGES))
def test_every_link_of_a_page_leads_somewhere(page):
    links = re.findall(r"\]\(([^)\s]+)\)", page.read_text())
    for link in links:
        if re.match(r"https?://", link):
            continue
        target, _, anchor = link.partition("#")
        path = (page.parent / target).resolve() if target else page
        assert path.is_file() or (path.is_dir() and not anchor), f"{link} of {page.name}"
        if anchor:
            assert anchor in _anchors(path), f"{link} of {page.name}"


@pytest.mark.parametrize("page", _PAGES, ids=_ids(_PAGES))
def test_every_file_that_a_page_names_is_there(page):
    for name in re.findall(
        r"`([\w./-]+(?:\.(?:py|md|json|yaml|toml|xml|pt)|/))`", page.read_text()
    ):
        if name.startswith(("runs/", "model_", "config.yaml", "gait.json", "my_")):
            continue  # what a command makes, or a user
        places = (REPOSITORY / name, page.parent / name, *_within_rooms(name))
        assert any(place.exists() for place in places), f"{name} of {page.name}"


def _within_rooms(name: str) -> list[Path]:
    """Return where a file may be that a page names by its last part, as `recorder.py`."""
    rooms = () if "/" in name.rstrip("/") else ("mute", "resources", "docs")
    return [path for room in rooms for path in (REPOSITORY / room).rglob(name)]


def _is_there(dotted: str) -> bool:
    """Tell whether a dotted name is a module, or something in one."""
    parts = dotted.split(".")
    for count in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:count]))
        except ModuleNotFoundError as error:
            if error.name and not dotted.startswith(error.name):
                raise  # it is there, and lacks something itself
            continue
        for part in parts[count:]:
            if not hasattr(found, part):
                return False
            found = getattr(found, part)
        return True
    return False


def _modules_named(text: str) -> set[str]:
    ours = r"(?<![\w/.])(?:mute|benchmarks)(?:\.[A-Za-z_]\w*)+"
    return {name for code in re.findall(r"`([^`]+)`", text) for name in re.findall(ours, code)}


@pytest.mark.parametrize("page", _PAGES, ids=_ids(_PAGES))
def test_every_module_that_a_page_names_is_there(page):
    assert [name for name in _modules_named(page.read_text()) if not _is_there(name)] == []


def test_every_module_that_a_docstring_names_is_there():
    missing = {}
    for path in _SOURCES:
        strings = (
            node.value
            for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, ast.Constant) and isinstance(node.value, str)
        )
        named = {name for text in strings for name in _modules_named(text)}
        if gone := sorted(name for name in named if not _is_there(name)):
            missing[str(path.relative_to(REPOSITORY))] = gone
    assert missing == {}


def test_the_front_page_is_short():
    text = (REPOSITORY / "README.md").read_text()
    assert len(text.splitlines()) <= 120
    assert len(text.split()) < 750  # bars of tables and dashes included


def test_the_picture_on_the_front_page_moves_and_is_light():
    path = REPOSITORY / "docs" / "side_by_side.webp"
    assert path.stat().st_size < 2_000_000
    with Image.open(path) as film:
        assert film.format == "WEBP"
        assert getattr(film, "n_frames", 1) >= 100
