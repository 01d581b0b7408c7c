"""What can be chosen in the page of `play.py --viewer web`, and what fits which robots."""

from __future__ import annotations

import dataclasses
import subprocess
import sys

import pytest
from dreamwaq_helpers import write_dreamwaq_policy
from places import REPOSITORY

from mute.command_lines import play, play_choices
from mute.command_lines.play_choices import misfit
from mute.controllers.learned import LearnedController
from mute.controllers.mpc.controller import MpcController
from mute.support.errors import MuteError
from mute.tasks import make_task


def test_policies_and_the_planner_can_be_chosen_by_name(tmp_path):
    dreamwaq = write_dreamwaq_policy(tmp_path / "dreamwaq.pt")
    args = play.PlayArgs(viewer="web", policies=(dreamwaq,))
    session = play._make_session(args, endless=False)
    choices = play_choices.page_choices(args, args.policies, session)
    assert list(choices) == ["go1_mute", "dreamwaq", "mpc"]
    assert choices["go1_mute"]() is session.controller
    for name, kind in (("dreamwaq", LearnedController), ("mpc", MpcController)):
        controller = choices[name]()
        assert isinstance(controller, kind)
        session.drive_with(controller)
        session.step()


def test_a_policy_of_other_robots_is_refused_by_what_differs():
    ours = make_task("go1_mute").env
    assert misfit(make_task("go1_dreamwaq").env, ours) is None
    stiff = dataclasses.replace(ours, scene=dataclasses.replace(ours.scene, stiffness=28.0))
    assert misfit(stiff, ours) == (
        "it was made for robots with env.scene.stiffness 28.0, these have 20.0"
    )
    # Ten steps of 2 ms are a control step as four of 5 ms are.
    fine = dataclasses.replace(
        ours, decimation=10, scene=dataclasses.replace(ours.scene, timestep=0.002)
    )
    assert misfit(fine, ours) is None
    slow = dataclasses.replace(ours, decimation=8)
    assert "a control step (s) 0.04" in str(misfit(slow, ours))


def test_without_what_serves_it_the_page_is_refused_in_one_line(monkeypatch):
    monkeypatch.setattr(play_choices.importlib.util, "find_spec", lambda _: None)
    with pytest.raises(MuteError, match=r"--viewer web needs viser and mjviser: pip install"):
        play_choices.check_page()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--policies", "a.pt"], "--policies are for --viewer web alone"),
        (["--viewer", "web", "--port", "0"], "--port must be"),
        (["--viewer", "web", "--video", "a.mp4"], "not with --viewer web"),
    ],
)
def test_bad_options_are_named(options, message):
    with pytest.raises(MuteError, match=message):
        play.main(options)


def test_the_page_really_runs_and_ends_cleanly():
    command = [sys.executable, "play.py", "--viewer", "web", "--port", "18100", "--seconds", "1.5"]
    done = subprocess.run(
        command, cwd=REPOSITORY, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "watch and steer at http://127.0.0.1:181" in done.stdout
    assert "did as asked" in done.stdout
