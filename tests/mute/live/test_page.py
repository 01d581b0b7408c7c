"""The page of a walk: its controls steer, its figures are of one driver and one command."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest
import torch
from standing import Standing

pytest.importorskip("viser", reason="needs mute[web]")
pytest.importorskip("mjviser", reason="needs mute[web]")

import mjviser
import mujoco
import viser

from mute.acoustics.audible_env import audible_cfg
from mute.acoustics.live_listener import LiveListener
from mute.controllers.command import COMMAND_LIMITS, Command
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.terrain import BoxGround, TerrainCfg
from mute.evaluation.session import Session
from mute.evaluation.trials import evaluation_cfg
from mute.live.page import show_page
from mute.live.page_scene import PageScene
from mute.live.page_server import page_server
from mute.live.panel import Choice, Panel
from mute.rendering.height_dots import HeightDots


@pytest.fixture
def server() -> Iterator[viser.ViserServer]:
    with page_server("127.0.0.1", 18080) as server:
        yield server


def _make_session(terrain: str = "flat", heard: bool = False) -> Session:
    cfg = evaluation_cfg(
        QuadrupedEnvCfg(num_threads=1), 1, seconds=60.0, seed=0, terrain=TerrainCfg(terrain)
    )
    env = QuadrupedEnv(audible_cfg(cfg, None) if heard else cfg)
    listener = LiveListener(env, "wood", 0.1) if heard else None
    return Session(env, Standing(1), Command(0.5, 0.0, 0.0, 0.5), 0.1, listener)


def _make_panel(server: viser.ViserServer, session: Session) -> Panel:
    return Panel(server, session, {"standing": Choice(session.controller)})


def _click(button: viser.GuiButtonHandle) -> None:
    button.value = True


# -- controls ------------------------------------------------------------------------------------


def test_each_slider_steers_its_part_of_the_command_once_the_walk_obeys(server):
    session = _make_session()
    panel = _make_panel(server, session)
    wanted = {"beta": 0.9, "vx": -1.5, "vy": 0.75, "wz": 2.0}
    for name, value in wanted.items():
        panel.sliders[name].value = value
    assert session.command == Command(0.5, 0.0, 0.0, 0.5)  # not in the thread of the page
    panel.obey()
    assert session.command == Command(**wanted)
    torch.testing.assert_close(session.env.commands.command[0], Command(**wanted).tensor())


def test_sliders_reach_all_that_can_be_asked_for(server):
    panel = _make_panel(server, _make_session())
    reach = {name: (slider.min, slider.max) for name, slider in panel.sliders.items()}
    assert reach == COMMAND_LIMITS


def test_a_command_between_the_steps_of_the_sliders_stays_when_another_part_changes(server):
    session = _make_session()
    session.set_command(Command(0.333, 0.0, 0.0, 0.5))
    panel = _make_panel(server, session)
    panel.sliders["beta"].value = 0.6
    panel.obey()
    assert session.command == Command(0.333, 0.0, 0.0, 0.6)


def test_stop_asks_to_stand_and_go_on_for_what_was_before(server):
    session = _make_session()
    panel = _make_panel(server, session)
    _click(panel.buttons["stop"])
    panel.obey()
    assert session.command == Command(0.0, 0.0, 0.0, 0.5)
    assert panel.sliders["vx"].value == 0.0
    _click(panel.buttons["stop"])
    panel.obey()
    assert session.command == Command(0.5, 0.0, 0.0, 0.5)
    assert panel.sliders["vx"].value == 0.5


def test_a_push_pushes_by_half_a_metre_a_second(server):
    session = _make_session()
    panel = _make_panel(server, session)
    before = session.env.simulation.qvel[0, :2].clone()
    _click(panel.buttons["push"])
    panel.obey()
    assert float((session.env.simulation.qvel[0, :2] - before).norm()) == pytest.approx(0.5)


def test_start_again_begins_anew_and_what_drives_forgets(server):
    session = _make_session()
    controller = session.controller
    assert isinstance(controller, Standing)
    panel = _make_panel(server, session)
    session.step()
    controller.resets.clear()
    _click(panel.buttons["restart"])
    panel.obey()
    assert session.steps == 0
    assert controller.resets == [None]


@pytest.mark.parametrize(("sent", "asked"), [(math.nan, 0.5), (math.inf, 0.5), (1e9, 2.0)])
def test_what_no_slider_can_say_is_not_asked_for(server, sent, asked):
    session = _make_session()
    panel = _make_panel(server, session)
    panel.sliders["vx"].value = sent
    panel.obey()
    assert session.command.vx == asked


def test_a_driver_that_is_not_there_is_not_chosen(server):
    session = _make_session()
    before = session.controller
    panel = _make_panel(server, session)
    panel.choice.value = "nobody"
    panel.obey()
    assert session.controller is before


def test_what_drives_is_chosen_without_a_past_and_has_figures_of_its_own(server):
    session, other = _make_session(), Standing(1)
    first = session.controller
    panel = Panel(server, session, {"one": Choice(first), "two": Choice(other)})
    for _ in range(20):
        session.step()
    assert session.gait().speed == session.gait().speed  # a number
    panel.choice.value = "two"
    panel.obey()
    assert session.controller is other
    assert other.resets == [None]
    assert session.gait().speed != session.gait().speed  # none yet
    panel.choice.value = "one"
    panel.obey()
    assert session.controller is first


def test_beta_can_be_moved_only_where_it_changes_the_walk(server):
    session = _make_session()
    choices = {
        "quiet": Choice(session.controller),
        "loud": Choice(Standing(1), quiet_factor=False),
    }
    panel = Panel(server, session, choices)
    assert not panel.sliders["beta"].disabled
    panel.choice.value = "loud"
    panel.obey()
    assert panel.sliders["beta"].disabled
    panel.choice.value = "quiet"
    panel.obey()
    assert not panel.sliders["beta"].disabled


# -- the walk in the page ------------------------------------------------------------------------


@pytest.mark.parametrize("terrain", ["flat", "stairs"])
def test_a_walk_in_a_page_goes_on_to_its_end(server, terrain):
    session = _make_session(terrain, heard=terrain == "flat")
    shown: list[dict[str, str]] = []

    def captions() -> dict[str, str]:
        shown.append({"speed": "0.5 m/s"})
        return shown[-1]

    dots = None if terrain == "flat" else HeightDots(session.env, session.controller)
    show_page(server, session, 60, captions, {"standing": Choice(session.controller)}, dots)
    assert session.steps == 60
    assert len(shown) == 1


def test_a_page_shows_the_figures_and_the_trace_of_the_level(server):
    session = _make_session(heard=True)
    panel = _make_panel(server, session)
    panel.show({"speed": "0.5 m/s", "strides": "2"})
    assert panel.figures.content == "- speed: **0.5 m/s**\n- strides: **2**"
    assert session.listener is not None
    assert panel.plot is not None
    with session.listener:
        for _ in range(25):
            session.step()
            panel.trace()
    seconds, levels = panel.plot.data
    assert len(seconds) == len(levels) > 1
    assert seconds[-1] == pytest.approx(0.5)
    assert all(30.0 < level < 110.0 for level in levels)


def test_the_robot_is_drawn_where_it_is(server, monkeypatch):
    drawn: list[float] = []
    update = mjviser.ViserMujocoScene.update_from_mjdata

    def noted(scene: mjviser.ViserMujocoScene, data: mujoco.MjData) -> None:
        drawn.append(float(data.qpos[0]))
        update(scene, data)

    monkeypatch.setattr(mjviser.ViserMujocoScene, "update_from_mjdata", noted)
    session = _make_session()
    scene = PageScene(server, session, None)
    session.env.simulation.qpos[0, 0] += 3.0
    scene.update()
    assert drawn[-1] - drawn[0] == pytest.approx(3.0)


def test_the_ground_follows_the_robot_as_boxes_that_are_moved_not_made_anew(server, monkeypatch):
    added: list[viser.BatchedMeshHandle] = []
    add = server.scene.add_batched_meshes_simple

    def noted(*args, **options) -> viser.BatchedMeshHandle:
        added.append(add(*args, **options))
        return added[-1]

    monkeypatch.setattr(server.scene, "add_batched_meshes_simple", noted)
    session = _make_session("stairs")
    scene = PageScene(server, session)
    (ground,) = (handle for handle in added if handle.name.endswith("/ground"))
    before = ground.batched_positions.copy()
    assert isinstance(session.env.ground, BoxGround)
    laid, _ = session.env.ground.drawn(0, session.env.simulation.qpos[0, :2])
    assert ground.batched_scales is not None
    tops = before[: laid.pos.shape[1], 2] + ground.batched_scales[: laid.pos.shape[1], 2]
    torch.testing.assert_close(
        torch.tensor(tops), (laid.pos + laid.half)[0, :, 2].float(), atol=1e-5, rtol=0.0
    )
    session.env.simulation.qpos[0, 0] += 12.0
    scene.update()
    assert abs(ground.batched_positions - before).max() > 0.1
    assert len([handle for handle in added if handle.name.endswith("/ground")]) == 1


def test_dots_have_places_and_colours():
    session = _make_session("stairs")
    places, colours = HeightDots(session.env, session.controller).points()
    assert places.shape == colours.shape == (len(session.env.grid), 3)
    below = session.env.ground.height_map(
        session.env.grid, session.env.base_pos, session.env.heading
    )[0]
    height = float(session.env.base_pos[0, 2])
    torch.testing.assert_close(torch.tensor(places[:, 2]).float(), height - below)
