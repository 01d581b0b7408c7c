"""The page of a walk: it is served, its controls steer, and what goes wrong is told in it."""

from __future__ import annotations

import urllib.request
from collections.abc import Iterator

import pytest
import torch
import viser
from standing import Standing

from mute.controllers import Controller
from mute.controllers.command import Command
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.terrain import TerrainCfg
from mute.evaluation.session import Session
from mute.evaluation.trials import evaluation_cfg
from mute.live.page import Panel, page_server, show_page
from mute.rendering.height_dots import HeightDots
from mute.support.errors import MuteError


@pytest.fixture
def server() -> Iterator[viser.ViserServer]:
    with page_server("127.0.0.1", 18080) as server:
        yield server


def _make_session(terrain: str = "flat") -> Session:
    cfg = evaluation_cfg(
        QuadrupedEnvCfg(num_threads=1), 1, seconds=60.0, seed=0, terrain=TerrainCfg(terrain)
    )
    return Session(QuadrupedEnv(cfg), Standing(1), Command(0.5, 0.0, 0.0, 0.5))


def _refuse() -> Controller:
    raise MuteError("it was made for robots with env.action_scale 0.5, these have 0.25")


def test_a_page_is_served_where_it_says(server):
    address = f"http://127.0.0.1:{server.get_port()}"
    with urllib.request.urlopen(address, timeout=20.0) as answer:
        assert answer.status == 200
        assert b"<html" in answer.read().lower()


def test_a_second_page_takes_the_next_port(server):
    with page_server("127.0.0.1", server.get_port()) as other:
        assert other.get_port() != server.get_port()


def test_a_place_that_cannot_be_listened_at_is_told():
    with (
        pytest.raises(MuteError, match=r"no page at 192\.0\.2\.1:18090"),
        page_server("192.0.2.1", 18090),
    ):
        pass


def test_sliders_and_buttons_steer_the_walk_once_it_asks(server):
    session = _make_session()
    panel = Panel(server, session, {"standing": lambda: session.controller})
    panel.sliders["beta"].value = 0.9
    panel._ask(lambda: panel._set("beta"))
    assert session.command.beta == 0.5  # not in the thread of the page
    panel.obey()
    assert session.command.beta == pytest.approx(0.9)
    panel._ask(panel._stand_or_go)
    panel.obey()
    assert session.command.stands
    assert panel.sliders["vx"].value == 0.0
    before = session.env.simulation.qvel[0, :2].clone()
    panel._ask(panel._push)
    panel.obey()
    assert float((session.env.simulation.qvel[0, :2] - before).norm()) == pytest.approx(0.5)
    session.step()
    panel._ask(panel._restart)
    panel.obey()
    assert session.steps == 0


def test_what_drives_is_chosen_and_what_does_not_fit_is_told(server):
    session, other = _make_session(), Standing(1)
    first = session.controller
    panel = Panel(server, session, {"one": lambda: first, "two": lambda: other, "no": _refuse})
    panel.choice.value = "two"
    panel._choose()
    assert session.controller is other
    panel.choice.value = "no"
    panel._choose()
    assert session.controller is other
    assert "these have 0.25" in panel.note.content
    panel.choice.value = "one"
    panel._choose()
    assert session.controller is first
    assert panel.note.content == ""


@pytest.mark.parametrize("terrain", ["flat", "stairs"])
def test_a_walk_in_a_page_goes_on_to_its_end(server, terrain):
    session = _make_session(terrain)
    shown: list[dict[str, str]] = []

    def captions() -> dict[str, str]:
        shown.append({"speed": "0.5 m/s"})
        return shown[-1]

    dots = None if terrain == "flat" else HeightDots(session.env, session.controller)
    show_page(server, session, 60, captions, {"standing": lambda: session.controller}, dots)
    assert session.steps == 60
    assert len(shown) == 1


def test_dots_have_places_and_colours():
    session = _make_session("stairs")
    places, colours = HeightDots(session.env, session.controller).points()
    assert places.shape == colours.shape == (len(session.env.grid), 3)
    below = session.env.ground.height_map(
        session.env.grid, session.env.base_pos, session.env.heading
    )[0]
    height = float(session.env.base_pos[0, 2])
    torch.testing.assert_close(torch.tensor(places[:, 2]).float(), height - below)
