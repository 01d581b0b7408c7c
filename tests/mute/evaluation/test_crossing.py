"""How robots get over ground, counted by hand, and what two predictors would have said."""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace
from typing import Any

import pytest
import torch
from learning_helpers import make_runner

from mute.config import to_plain
from mute.controllers.learned import Policy, make_policy
from mute.envs.randomization import full_randomization
from mute.envs.scene import FOOT_RADIUS
from mute.evaluation import crossing
from mute.evaluation.crossing import HeightBaselines, cross, crossing_cfg
from mute.learning.runner import policy_part


@pytest.fixture(scope="module")
def policy() -> Policy:
    """Return a policy that has learnt nothing."""
    runner = make_runner()
    about = {"task": "go1_mute", "iter": 0, "config": to_plain(runner.task_cfg)}
    return make_policy(policy_part(runner.alg.save() | about))


def test_robots_differ_in_everything_on_one_kind_of_ground_at_one_level(policy):
    cfg = crossing_cfg(policy, "blocks", 3, episodes=4, seconds=2.0, seed=9)
    assert (cfg.terrain.kind, cfg.terrain.first_levels) == ("blocks", (3, 3))
    assert not cfg.terrain.curriculum
    assert cfg.randomization == full_randomization(push_interval=0.0)
    assert cfg.observations.noise_level > 0.0
    assert (cfg.num_envs, cfg.seed) == (4, 9)


def _crossed(policy: Policy, monkeypatch: pytest.MonkeyPatch, events: dict[str, Any]) -> Any:
    """Return the figures of five robots whose walk of 10 steps is made up.

    Args:
        policy: What does nothing.
        monkeypatch: Puts the made-up walk in place of a trial.
        events: At which step who falls, and whose simulation turns unstable.
    """
    speeds = torch.tensor([0.5, 0.41, 0.39, 0.5, 0.5])

    def walk(env, controller, command, num_steps, on_step):
        assert command.tolist() == pytest.approx([0.5, 0.0, 0.0, 0.25])
        for step in range(num_steps):
            observations = env.get_observations()
            controller.act(observations)
            # To the left as well, which is not ahead.
            env.heading = torch.tensor([[0.0, 1.0]]).repeat(5, 1)
            env.base_pos = torch.full((5, 3), 0.3)
            env.base_pos[:, 1] += 0.2 * speeds * step / (num_steps - 1)
            env.base_pos[:, 0] -= 0.1 * step
            env.fallen = torch.tensor([events["falls"].get(i) == step for i in range(5)])
            unstable = torch.tensor([events["unstable"].get(i) == step for i in range(5)])
            on_step(observations, env.fallen | unstable)

    monkeypatch.setattr(crossing, "run_trial", walk)
    cfg = crossing_cfg(policy, "blocks", 1, episodes=5, seconds=0.2, seed=0)
    return cross(policy, cfg, speed=0.5, beta=0.25, seconds=0.2)


def test_a_success_is_more_than_80_percent_of_the_way_without_a_fall(policy, monkeypatch):
    row = _crossed(policy, monkeypatch, {"falls": {3: 5}, "unstable": {4: 9}})
    # The first two; the third made 78 %, the fourth fell, and the fifth's physics broke.
    assert row.success == pytest.approx(2 / 5)
    assert row.falls == pytest.approx(1 / 5)
    shares = [1.0, 0.82, 0.78, 4 / 9, 8 / 9]  # until the fall, and until the numbers were bad
    assert row.made == pytest.approx(sum(shares) / 5)
    assert (row.kind, row.level, row.episodes) == ("blocks", 1, 5)
    assert set(row.as_dict()) == {field.name for field in dataclasses.fields(row)}


@pytest.mark.parametrize(("kind", "success"), [("stairs", 0.5), ("uneven", 1.0)])
def test_who_turns_aside_on_stairs_has_climbed_none(policy, monkeypatch, kind, success):
    # Both make 95 % of the way along where they began, 45 degrees beside x; one turned from x by 30
    # degrees more, and got but two thirds of the way along x.
    turned = math.radians(30.0)
    ahead = 0.95 * 0.1 * torch.tensor([1.0, 1.0 / math.cos(turned)])
    angle = torch.tensor([0.25 * math.pi, 0.25 * math.pi + turned])

    def walk(env, controller, command, num_steps, on_step):
        for step in range(num_steps):
            observations = env.get_observations()
            controller.act(observations)
            env.heading = torch.full((2, 2), 0.5**0.5)
            way = ahead * step / (num_steps - 1)
            env.base_pos = torch.stack((way * angle.cos(), way * angle.sin(), 0 * way), dim=1)
            on_step(observations, torch.zeros(2, dtype=torch.bool))

    monkeypatch.setattr(crossing, "run_trial", walk)
    cfg = crossing_cfg(policy, kind, 1, episodes=2, seconds=0.2, seed=0)
    row = cross(policy, cfg, speed=0.5, beta=0.0, seconds=0.2)
    assert row.made == pytest.approx(0.95)
    assert row.success == success


def _standing(heights: list[list[float]], feet: list[float], down: list[bool]) -> Any:
    """Return an environment of a robot at 0.3 m, with these heights of the ground below it."""
    ground = torch.tensor(heights)
    foot_pos = torch.zeros(len(heights), 4, 3)
    foot_pos[:, :, 2] = torch.tensor(feet) + FOOT_RADIUS
    return SimpleNamespace(
        grid=torch.zeros(ground.shape[1], 2),
        base_pos=torch.tensor([[0.0, 0.0, 0.3]] * len(heights)),
        heading=None,
        ground=SimpleNamespace(height_map=lambda *_: 0.3 - ground),
        foot_pos=foot_pos,
        footfalls=SimpleNamespace(contact=torch.tensor([down] * len(heights))),
    )


def test_the_level_map_lies_at_the_mean_height_of_the_feet_that_stand():
    env = _standing([[0.0, 0.1, 0.0]], feet=[0.1, 0.0, 0.5, 0.5], down=[True, True, False, False])
    meter = HeightBaselines(env)
    meter.update(torch.ones(len(env.base_pos), dtype=torch.bool))
    # Level at 0.05: each point is 5 cm off.
    assert meter.errors()[0] == pytest.approx(0.05, abs=1e-6)


def test_of_a_robot_in_the_air_all_feet_tell_the_level():
    env = _standing([[0.0, 0.0]], feet=[0.1, 0.1, 0.3, 0.3], down=[False] * 4)
    meter = HeightBaselines(env)
    meter.update(torch.ones(len(env.base_pos), dtype=torch.bool))
    assert meter.errors()[0] == pytest.approx(0.2, abs=1e-6)


def test_the_mean_map_errs_by_what_heights_vary_about_their_means():
    # The first point is 2 cm off its mean in all, the second never.
    env = _standing([[0.02, 0.1], [0.06, 0.1]], feet=[0.0] * 4, down=[True] * 4)
    meter = HeightBaselines(env)
    meter.update(torch.ones(len(env.base_pos), dtype=torch.bool))
    meter.update(torch.ones(len(env.base_pos), dtype=torch.bool))
    assert meter.errors()[1] == pytest.approx((0.02**2 / 2) ** 0.5, abs=1e-6)


def test_what_is_not_counted_changes_no_error():
    env = _standing([[0.02, 0.1], [0.9, 0.5]], feet=[0.0] * 4, down=[True] * 4)
    meter = HeightBaselines(env)
    meter.update(torch.tensor([True, False]))
    assert meter.errors()[0] == pytest.approx(((0.02**2 + 0.1**2) / 2) ** 0.5, abs=1e-6)
    assert meter.errors()[1] == pytest.approx(0.0, abs=1e-6)
