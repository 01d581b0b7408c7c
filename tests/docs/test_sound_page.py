"""The table of floors on the page is that of the floors."""

from __future__ import annotations

import re

import pytest
from places import REPOSITORY

from mute.acoustics.floors import FLOORS

_ROW = re.compile(r"^\| ([a-z]+) \| [^|]* " + r"\| (\d[\d.e-]*) " * 6 + r"\|$", re.MULTILINE)
_PAGE = (REPOSITORY / "docs" / "sound.md").read_text()
_ROWS = {name: [*map(float, figures)] for name, *figures in _ROW.findall(_PAGE)}


def test_every_floor_is_in_the_table():
    assert _ROWS.keys() == FLOORS.keys()


@pytest.mark.parametrize("name", FLOORS)
def test_a_floor_has_the_figures_that_the_table_tells(name):
    floor = FLOORS[name]
    plate, blow = floor.plate, floor.contact.blow(0.5, 0.45)
    figures = [
        plate.surface_mass,
        plate.critical_frequency,
        plate.mobility,
        float(plate.total_loss(500.0)),
        1e3 * float(blow.duration),
        floor.friction,
    ]
    assert _ROWS[name] == pytest.approx(figures, rel=0.03)
