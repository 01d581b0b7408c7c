"""What the figures of the comparison show, and how."""

from __future__ import annotations

import pytest
from comparison_rows import make_row

from mute.evaluation.comparison import figures


@pytest.fixture
def drawn(monkeypatch) -> dict[str, figures.Figure]:
    """Take the place of the files; return the figures by their names."""
    found: dict[str, figures.Figure] = {}

    def save(figure, path):
        found[path.name] = figure
        return [path]

    monkeypatch.setattr(figures, "save_figure", save)
    return found


def test_where_many_fall_a_point_is_hollow_and_bounds_no_front(drawn, tmp_path):
    rows = [
        make_row("MPC", 60.0, command=0.5, fall_rate=0.06),
        make_row("MPC", 70.0, command=0.4, fall_rate=0.05),
        make_row("MUTE, beta 0", 65.0, command=0.4),
    ]
    figures.draw_levels(rows, tmp_path)
    axes = drawn["front"].axes[0]
    (line,) = axes.lines
    assert [list(map(float, data)) for data in line.get_data()] == [[0.4], [65.0]]
    assert "hollow: more than 5 % of the robots fell" in axes.get_title()
    mpc = axes.collections[0]
    assert [len(colour) and colour[3] for colour in mpc.get_facecolors()] == [0.0, 1.0]
    hollow = drawn["speed"].axes[0].lines[1]
    assert [list(map(float, data)) for data in hollow.get_data()] == [[0.5], [60.0]]
    assert hollow.get_markerfacecolor() == "white"
    figures.draw_levels(rows[1:], tmp_path)
    assert "hollow" not in drawn["front"].axes[0].get_title()
