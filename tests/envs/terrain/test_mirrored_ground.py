"""A mirrored robot on mirrored ground that acts mirrored moves as the mirror image does."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from tensordict import TensorDict

from mute.config import TaskCfg
from mute.envs.observations import ObservationsCfg
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.randomization import RandomizationCfg
from mute.envs.terrain import GROUNDS, KINDS, BoxGround, TerrainCfg
from mute.envs.terrain.draws import KEYS
from mute.envs.terrain.kinds import Kind
from mute.envs.terrain.layout import Layout
from mute.learning.estimated_env import make_estimator
from mute.learning.symmetry import FEET, JOINTS, POLAR, groups, heights
from mute.tasks import DEFAULT_TASK, make_task

_ACROSS = torch.tensor([1.0, -1.0])


class _Mirrored(Kind):
    """The mirror image of a kind of ground, at the vertical plane through the x axis."""

    def __init__(self, kind: Kind) -> None:
        self._kind = kind
        self.boxes, self.wide_boxes = kind.boxes, kind.wide_boxes
        self.max_heading = kind.max_heading

    def height(self, xy: torch.Tensor, level: torch.Tensor, key: torch.Tensor) -> torch.Tensor:
        return self._kind.height(xy * _ACROSS, level, key)

    def lay(
        self, xy: torch.Tensor, level: torch.Tensor, key: torch.Tensor, wide: bool = False
    ) -> Layout:
        pos, half, pitch = self._kind.lay(xy * _ACROSS, level, key, wide)
        return Layout(pos * torch.tensor([1.0, -1.0, 1.0]), half, pitch)

    def base(self, level: torch.Tensor) -> torch.Tensor:
        return self._kind.base(level)


def _pair(kind: str, monkeypatch: pytest.MonkeyPatch) -> QuadrupedEnv:
    """Return two robots in mirrored poses, the first on a kind of ground, higher on one side.

    The second one is on that which is called `mirrored`.
    """
    monkeypatch.setitem(GROUNDS, "both", {kind: 0.5, "mirrored": 0.5})
    rewards = replace(
        make_task(DEFAULT_TASK).env.rewards,
        phase_source="true",
        guide_ramp=(1.0, 2.0),
        lift_ramp=(0.0, 0.0),
        quiet_ramp=(0.0, 0.0),
    )
    env = QuadrupedEnv(
        QuadrupedEnvCfg(
            num_envs=2,
            num_threads=1,
            rewards=rewards,
            terrain=TerrainCfg(kind="both"),
            observations=ObservationsCfg(noise_level=0.0),
            randomization=RandomizationCfg(enabled=False),
        )
    )
    env.autoreset = False
    _mirror_masses(env)
    ground, simulation, both = env.ground, env.simulation, torch.ones(2, dtype=torch.bool)
    assert isinstance(ground, BoxGround)
    assert [ground.kinds[index] for index in ground.kind.tolist()] == [kind, "mirrored"]
    pose = torch.from_numpy(env.model.key("stand").qpos).float()
    # Nearly along the y axis: one side is further along x than the other.
    pose[:7] = torch.tensor([1.65, 0.37, pose[2], math.cos(0.7), 0.0, 0.0, math.sin(0.7)])
    pose[7:] += 0.1 * torch.randn(12, generator=torch.Generator().manual_seed(1))
    speed = torch.tensor([0.2, 0.1, 0.0, 0.3, 0.2, -0.3])
    simulation.qpos[:] = torch.stack((pose, _mirrored(pose)))
    simulation.qvel[:, :6] = torch.stack((speed, torch.cat((POLAR(speed[:3]), -POLAR(speed[3:])))))
    simulation.qvel[:, 6:] = 0.0
    simulation.forward()
    ground.level[:] = 2
    keys = torch.arange(KEYS)
    under = KINDS[kind].height(
        env.foot_pos[:1, :, :2].expand(KEYS, -1, -1), ground.level[0].expand(KEYS), keys
    )
    ground.key[:] = keys[((under - FEET(under)) > 0.02).any(dim=1)][0]
    ground.lay(simulation.qpos[:, :2], both)
    env._lift_to_ground(both)
    env.footfalls.reset(both, env._sensors.foot_contact)
    env.followed.reset(both)
    env._read_state()
    env.set_command(torch.tensor([[0.5, 0.2, -0.7, 0.3], [0.5, -0.2, 0.7, 0.3]]))
    return env


def _mirror_masses(env: QuadrupedEnv) -> None:
    """Make the second robot's masses the mirror image of the first one's, which are lopsided."""
    simulation, model = env.simulation, env.model
    names = [model.body(index).name for index in range(model.nbody)]
    sides = {f"{end}{side}": f"{end}{other}" for end in "FR" for side, other in ("LR", "RL")}
    other = [names.index(sides.get(name[:2], name[:2]) + name[2:]) for name in names]
    for name in ("body_mass", "body_inertia", "body_ipos", "body_iquat"):
        field = simulation.field(name)
        field[1] = field[0, other]
    simulation.field("body_ipos")[1] = POLAR(simulation.field("body_ipos")[1])
    turn = simulation.field("body_iquat")[1]
    turn[:, 1:] = -POLAR(turn[:, 1:])
    simulation.set_const()


def _mirrored(pose: torch.Tensor) -> torch.Tensor:
    """Return the mirror image of places, turns and joints, at the plane y = 0. Shape: (19,)."""
    return torch.cat((POLAR(pose[:3]), pose[3:4], -POLAR(pose[4:7]), JOINTS(pose[7:])))


def _walk(env: QuadrupedEnv) -> tuple[TensorDict, torch.Tensor]:
    """Let the second robot act as the first one's mirror image.

    Returns:
        What both see in the end, and their rewards. Shape: (steps, 2).
    """
    generator = torch.Generator().manual_seed(0)
    rewards, contacts = [], 0.0
    for _ in range(20):
        action = torch.randn(1, 12, generator=generator)
        rewards.append(env.step(torch.cat((action, JOINTS(action))))[1])
        contacts += float(env._sensors.foot_contact.sum())
    assert contacts > 40.0
    return env.get_observations(), torch.stack(rewards)


@pytest.mark.parametrize("kind", [name for name in KINDS if name != "flat"])
def test_a_mirrored_robot_on_mirrored_ground_moves_sees_and_earns_as_its_mirror_image(
    kind, monkeypatch
):
    monkeypatch.setitem(KINDS, "mirrored", _Mirrored(KINDS[kind]))
    env = _pair(kind, monkeypatch)
    task = TaskCfg(env=QuadrupedEnvCfg(height_map=env.cfg.height_map))
    images = groups(env, make_estimator(task), with_phase=True)
    start = env.simulation.qpos.clone()
    robot, other = env.ground.height_map(env.grid, env.base_pos, env.heading)
    torch.testing.assert_close(heights(env.grid)(robot), other)
    assert float((robot - other).abs().max()) > 0.02
    seen, rewards = _walk(env)
    robot, other = env.simulation.qpos
    assert float((robot - start[0]).abs().max()) > 0.1
    torch.testing.assert_close(_mirrored(robot), other, atol=1e-4, rtol=0.0)
    for name in ("policy", "privileged"):
        robot, other = seen[name]
        torch.testing.assert_close(images[name](robot), other, atol=1e-3, rtol=0.0)
    torch.testing.assert_close(rewards[:, 0], rewards[:, 1], atol=1e-3, rtol=0.0)


@pytest.mark.parametrize("kind", ["uneven", "blocks"])
def test_on_the_same_ground_a_mirrored_robot_is_no_mirror_image(kind, monkeypatch):
    monkeypatch.setitem(KINDS, "mirrored", KINDS[kind])
    env = _pair(kind, monkeypatch)
    _walk(env)
    robot, other = env.simulation.qpos
    assert float((_mirrored(robot) - other).abs().max()) > 0.05
