"""Levels go up and down by how far robots get along their commands."""

from __future__ import annotations

import pytest
import torch

from mute.envs.commands import CommandsCfg
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.randomization import RandomizationCfg
from mute.envs.rewards import RewardsCfg, reward_term
from mute.envs.terrain import BoxGround, TerrainCfg, kind_of_robot
from mute.envs.terrain.commands import suit_commands
from mute.envs.terrain.levels import Travelled, next_levels


def _next(
    level: int,
    away: float,
    made: float,
    asked: float,
    fallen: bool = False,
    unit: float = 0.5,
    share: float = 0.0,
) -> int:
    travelled = Travelled(1, torch.device("cpu"))
    travelled.away, travelled.made, travelled.asked = (
        torch.tensor([value]) for value in (away, made, asked)
    )
    after = next_levels(
        torch.tensor([level]), travelled, torch.tensor([fallen]), 4.0, share, torch.tensor([unit])
    )
    return int(after)


@pytest.mark.parametrize(
    ("level", "away", "made", "asked", "fallen", "after"),
    [
        (2, 5.0, 5.0, 8.0, False, 3),  # crossed
        (2, 5.0, 5.0, 8.0, True, 2),  # crossed, and fell: far enough not to go down
        (2, 1.0, 7.0, 8.0, False, 2),  # went in circles
        (2, 3.0, 3.0, 8.0, False, 1),  # less than half
        (2, 3.0, 3.0, 5.0, False, 2),  # not far, as it was not asked to go
        (2, 1.0, 1.0, 1.0, True, 1),  # did all that it was asked for until it fell
        (0, 0.0, 0.0, 8.0, True, 0),
        (1, 2.0, -2.0, 3.0, False, 0),
    ],
)
def test_a_robot_goes_up_where_it_crossed_and_down_where_it_fell_or_made_less_than_half(
    level, away, made, asked, fallen, after
):
    assert _next(level, away, made, asked, fallen) == after


@pytest.mark.parametrize(("made", "after"), [(5.9, 2), (6.1, 3)])
def test_who_is_slow_does_not_go_up_where_a_share_of_the_way_is_asked_for(made, after):
    assert _next(2, 5.0, made, 8.0, share=0.75) == after


@pytest.mark.parametrize(("unit", "after"), [(0.0, 0), (0.39, 1), (0.99, 4)])
def test_who_has_solved_them_all_goes_anywhere(unit, after):
    assert _next(4, 5.0, 5.0, 8.0, unit=unit) == after
    assert _next(4, 3.0, 3.0, 4.0, unit=unit) == 4


def test_what_counts_is_the_way_along_the_command():
    travelled = Travelled(4, torch.device("cpu"))
    command = torch.tensor([[1.0, 0.0, 0.0, 0.0], [0.3, 0.4, 0.0, 0.0], [0.0] * 4, [-1.0, 0, 0, 0]])
    velocity = torch.tensor([[0.5, 0.7, 0.0], [0.6, 0.8, 0.0], [0.4, 0.0, 0.0], [0.2, 0.0, 0.0]])
    nowhere = torch.zeros(4, 2)
    for _ in range(10):
        travelled.update(nowhere, command, velocity, 0.02)
    torch.testing.assert_close(travelled.made, torch.tensor([0.1, 0.2, 0.0, -0.04]))
    torch.testing.assert_close(travelled.asked, torch.tensor([0.2, 0.1, 0.0, 0.2]))
    travelled.reset(torch.tensor([True, False, False, False]), nowhere)
    assert float(travelled.made[0]) == 0.0
    assert float(travelled.asked[1]) > 0.0


def test_how_far_a_robot_is_away_is_from_where_its_episode_began():
    travelled = Travelled(2, torch.device("cpu"))
    there = torch.tensor([[1.0, 1.0], [2.0, 0.0]])
    travelled.reset(torch.tensor([True, False]), there)
    travelled.update(there + torch.tensor([3.0, 4.0]), torch.zeros(2, 4), torch.zeros(2, 3), 0.02)
    torch.testing.assert_close(travelled.away, torch.tensor([5.0, 41.0**0.5 * 1.0]))
    other = Travelled(2, torch.device("cpu"))
    other.load_state_dict(travelled.state_dict())
    other.update(there, torch.zeros(2, 4), torch.zeros(2, 3), 0.02)
    torch.testing.assert_close(other.away, torch.tensor([0.0, 2.0]))


def test_levels_of_an_environment_follow_each_robot_as_its_episode_ends():
    cfg = QuadrupedEnvCfg(
        num_envs=4,
        num_threads=1,
        terrain=TerrainCfg(kind="stairs", first_levels=(2, 2)),
        randomization=RandomizationCfg(enabled=False),
    )
    env = QuadrupedEnv(cfg)
    env.reset()
    ground = env.ground
    assert isinstance(ground, BoxGround)
    assert ground.level.tolist() == [2] * 4
    env.set_command(torch.zeros(4))
    env.step(torch.zeros(4, 12))
    # One got away, one hardly walked, one was hardly asked to, and one is on its back by now.
    env.travelled.start[0, 0] -= 5.0
    env.travelled.made, env.travelled.asked = torch.tensor([[5.0, 1, 1, 2], [8.0, 8, 1, 2]])
    env.simulation.qpos[3, 3:7] = torch.tensor([0.0, 1.0, 0.0, 0.0])
    env.episode_length_buf[:3] = env.max_episode_length - 1
    _, _, dones, _ = env.step(torch.zeros(4, 12))
    assert bool(dones.all())
    assert ground.level.tolist() == [3, 1, 2, 1]
    assert not env.travelled.away.any()


def test_commands_hold_longer_where_ground_has_levels_if_they_are_told_to():
    cfg = QuadrupedEnvCfg(
        num_envs=6,
        terrain=TerrainCfg(kind="indoor", command_time=0.1),
        commands=CommandsCfg(resampling_time=0.04, standing_fraction=0.0),
        randomization=RandomizationCfg(enabled=False),
    )
    env = QuadrupedEnv(cfg)
    flat = torch.tensor([name == "flat" for name in kind_of_robot(cfg.terrain, 6)])
    assert 0 < int(flat.sum()) < 6
    changed = []
    for _ in range(5):
        before = env.commands.command[:, :3].clone()
        env.step(torch.zeros(6, 12))
        changed.append((env.commands.command[:, :3] != before).all(dim=1))
    for robot in range(6):
        at = [step + 1 for step, robots in enumerate(changed) if robots[robot]]
        assert at == ([2, 4] if flat[robot] else [5])


def test_who_walks_beside_stairs_has_crossed_none():
    travelled = Travelled(2, torch.device("cpu"))
    travelled.across = torch.tensor([True, False])
    beside = torch.tensor([[0.5, 4.0], [0.5, 4.0]])
    travelled.update(beside, torch.zeros(2, 4), torch.zeros(2, 3), 0.02)
    torch.testing.assert_close(travelled.away, torch.tensor([0.5, beside[1].norm().item()]))


def test_ground_that_is_crossed_along_x_is_that_which_robots_begin_along():
    env = QuadrupedEnv(
        QuadrupedEnvCfg(num_envs=30, num_threads=1, terrain=TerrainCfg(kind="rough"))
    )
    assert isinstance(env.ground, BoxGround)
    along = {"slopes", "stairs", "stairs_down"}
    for robot, across in enumerate(env.ground.across.tolist()):
        assert across == (env.ground.kinds[int(env.ground.kind[robot])] in along)
    assert torch.equal(env.travelled.across, env.ground.across)


def test_commands_turn_less_where_ground_is_crossed_along_x_if_they_are_told_to():
    def drawn(share: float) -> torch.Tensor:
        cfg = QuadrupedEnvCfg(
            num_envs=60,
            num_threads=1,
            terrain=TerrainCfg(kind="rough", turning_share=share),
            commands=CommandsCfg(resampling_time=0.02, standing_fraction=0.0),
        )
        env = QuadrupedEnv(cfg)
        env.step(torch.zeros(60, 12))
        assert isinstance(env.ground, BoxGround)
        return torch.cat((env.commands.command, env.ground.across[:, None]), dim=1)

    all_of_it, less = drawn(1.0), drawn(0.25)
    straight = all_of_it[:, 4] > 0.0
    assert 0 < int(straight.sum()) < 60
    torch.testing.assert_close(less[straight, 2], 0.25 * all_of_it[straight, 2])
    assert torch.equal(less[~straight], all_of_it[~straight])
    assert torch.equal(less[:, :2], all_of_it[:, :2])


def test_some_commands_lead_ahead_where_ground_is_crossed_along_x_if_they_are_told_to():
    velocity = torch.tensor([[-0.5, 0.2, 0.4]]).repeat(4, 1)
    across = torch.tensor([True, True, True, False])
    draw = torch.tensor([[0.4, 0.0], [0.4, 0.5], [0.6, 0.5], [0.4, 0.5]])
    cfg = TerrainCfg(ahead_share=0.5, turning_share=0.25)
    suited = suit_commands(velocity, across, cfg, 2.0, draw)
    # Ahead at 0.3 and at 0.65 of the largest speed; one of the others; on other ground.
    expected = [[0.6, 0.0, 0.0], [1.3, 0.0, 0.0], [-0.5, 0.2, 0.1], [-0.5, 0.2, 0.4]]
    torch.testing.assert_close(suited, torch.tensor(expected))


def test_commands_ahead_grow_with_the_ranges():
    cfg = QuadrupedEnvCfg(
        num_envs=40,
        num_threads=1,
        terrain=TerrainCfg(kind="stairs", ahead_share=1.0),
        commands=CommandsCfg(initial_share=0.5, ramp=(0.0, 1e6)),
    )
    ahead = QuadrupedEnv(cfg).commands.command[:, 0]
    assert 0.15 <= float(ahead.min()) < 0.2 and 0.45 < float(ahead.max()) <= 0.5


def test_stairs_and_blocks_are_paid_less_for_silence_if_they_are_told_to():
    def paid(share: float) -> tuple[torch.Tensor, list[str]]:
        cfg = QuadrupedEnvCfg(
            num_envs=30,
            num_threads=1,
            terrain=TerrainCfg(kind="indoor", quiet_share=share),
            rewards=RewardsCfg(terms={"near": reward_term("near_ground_drop", -1.0)}),
        )
        env = QuadrupedEnv(cfg)
        assert isinstance(env.ground, BoxGround)
        env.set_command(torch.tensor((0.5, 0.0, 0.0, 1.0)))
        _, reward, _, _ = env.step(torch.full((30, 12), 0.5))
        return reward, [env.ground.kinds[kind] for kind in env.ground.kind.tolist()]

    (all_of_it, kinds), (less, _) = paid(1.0), paid(0.25)
    assert bool((all_of_it < 0.0).all())
    shares = torch.tensor([1.0 if kind in ("flat", "rooms") else 0.25 for kind in kinds])
    assert 0 < int((shares == 1.0).sum()) < 30
    torch.testing.assert_close(less, shares * all_of_it)
