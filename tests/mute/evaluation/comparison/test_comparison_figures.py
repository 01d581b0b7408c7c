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


def test_methods_quiet_terms_and_ablations_at_three_quiet_factors_are_all_told_apart(
    drawn, tmp_path
):
    names = ["MPC", "DreamWaQ"]
    names += [f"{name}, beta {beta}" for name in "ABCDEFGHIJK" for beta in (0, 0.5, 1)]
    rows = [make_row(name, 60.0, command=speed) for name in names for speed in (0.5, 0.8)]
    figures.draw_levels(rows, tmp_path)
    lines = [line for line in drawn["speed"].axes[0].lines if len(line.get_xdata()) > 0]
    assert [line.get_label() for line in lines] == names
    assert len({(line.get_color(), line.get_linestyle()) for line in lines}) == len(names) == 35
    for figure in (drawn["speed"], drawn["front"]):
        (legend,) = figure.legends
        assert [text.get_text() for text in legend.get_texts()] == names
        figure.draw_without_rendering()
        assert figure.axes[0].get_window_extent().x1 <= legend.get_window_extent().x0
    assert drawn["sources"].get_figwidth() == pytest.approx(0.4 * len(names))


def test_few_labels_have_their_legend_within_the_axes(drawn, tmp_path):
    figures.draw_levels([make_row("MPC", 60.0), make_row("DreamWaQ", 61.0)], tmp_path)
    assert drawn["speed"].legends == []
    assert drawn["speed"].axes[0].get_legend() is not None
