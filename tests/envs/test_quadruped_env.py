"""Tests of the step loop: order, ends of episodes, resets, state."""

from __future__ import annotations

import math

import pytest
import torch

from mute.envs.commands import CommandsCfg
from mute.envs.height_map import HeightMapCfg
from mute.envs.observations import OBSERVATION_WIDTHS, SENSOR_WIDTHS, ObservationsCfg, slices
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.randomization import RandomizationCfg
from mute.envs.rewards import RewardsCfg, reward_term
from mute.envs.scene import FOOT_RADIUS, LEGS, STAND_JOINT_POS
from mute.envs.sensors import sensor_slice

POLICY = slices(OBSERVATION_WIDTHS)
QUIET = {"observations": ObservationsCfg(noise_level=0.0)}
CALM = {
    **QUIET,
    "randomization": RandomizationCfg(enabled=False),
    "initial_joint_noise": 0.0,
    "initial_velocity": 0.0,
}
"""Nothing random but headings and commands."""


def _make_env(num_envs=4, **given):
    return QuadrupedEnv(QuadrupedEnvCfg(num_envs=num_envs, num_threads=1, **given))


def _actions(num_envs, step, size=0.5):
    generator = torch.Generator().manual_seed(step)
    return size * (2.0 * torch.rand(num_envs, 12, generator=generator) - 1.0)


def _roll(env, steps, first=0):
    """Return observations, rewards and dones of every step, one tensor a step."""
    result = []
    for step in range(first, first + steps):
        observations, rewards, dones, extras = env.step(_actions(env.num_envs, step))
        result.append(
            torch.cat(
                (
                    observations["policy"],
                    observations["privileged"],
                    rewards.unsqueeze(1),
                    dones.unsqueeze(1),
                    extras["time_outs"].unsqueeze(1),
                ),
                dim=1,
            )
        )
    return torch.stack(result)


def _roll_angle(angle):
    return torch.tensor([math.cos(angle / 2), math.sin(angle / 2), 0.0, 0.0])


def _hang(env, index, roll=0.0):
    """Lift a robot off the ground, rolled by an angle."""
    env.simulation.qpos[index, 2] = 2.0
    env.simulation.qpos[index, 3:7] = _roll_angle(roll)
    env.simulation.qvel[index] = 0.0


def _stand_still(env, steps=1):
    return _repeat(env, 0.0, steps)


def _repeat(env, action, steps):
    """Return what the last of some steps with the same action gave."""
    actions = torch.full((env.num_envs, 12), action)
    return [env.step(actions) for _ in range(steps)][-1]


# -- what a step returns -----------------------------------------------------------------------


def test_a_step_returns_the_groups_and_shapes_of_a_vec_env():
    env = _make_env(3)
    observations, rewards, dones, extras = _stand_still(env)
    assert observations["policy"].shape == (3, 46)
    assert observations["privileged"].shape == (3, 3 + 35 + 4 + 4 + 7)
    assert rewards.shape == dones.shape == extras["time_outs"].shape == (3,)
    assert dones.dtype == extras["time_outs"].dtype == torch.bool
    assert env.max_episode_length == 1000
    assert env.num_actions == 12


def test_observations_show_the_state_in_the_body_frame():
    env = _make_env(2, **CALM)
    for index in range(2):
        _hang(env, index, roll=0.5)
    env.simulation.qvel[:, 3:6] = torch.tensor([0.4, 0.0, 0.8])
    policy = _stand_still(env)[0]["policy"]
    # Rolled to its right side by 0.5 rad: the ground lies below and to the right, at -y.
    gravity = policy[0, POLICY["projected_gravity"]]
    roll = 0.5 + 0.4 * env.step_dt
    expected = torch.tensor([0.0, -math.sin(roll), -math.cos(roll)])
    torch.testing.assert_close(gravity, expected, atol=0.02, rtol=0.0)
    torch.testing.assert_close(
        policy[0, POLICY["base_ang_vel"]] / 0.25, env.simulation.qvel[0, 3:6]
    )


def test_the_true_velocity_is_turned_into_the_body_frame():
    env = _make_env(1, **CALM)
    _hang(env, 0)
    # Turned to the left by 90 degrees and moving along the world's y, it moves forward.
    half = math.sqrt(0.5)
    env.simulation.qpos[0, 3:7] = torch.tensor([half, 0.0, 0.0, half])
    env.simulation.qvel[0, 1] = 0.7
    privileged = _stand_still(env)[0]["privileged"]
    velocity = privileged[0, env.privileged_slices["base_lin_vel"]]
    falling = -9.81 * env.step_dt
    torch.testing.assert_close(velocity, torch.tensor([0.7, 0.0, falling]), atol=0.01, rtol=0.0)


def test_the_critic_sees_heights_contacts_and_physics():
    height_map = HeightMapCfg(offset=0.25, scale=0.5)
    env = _make_env(2, initial_velocity=0.0, height_map=height_map)
    _hang(env, 1)
    privileged = _stand_still(env, 10)[0]["privileged"]
    columns = env.privileged_slices
    heights = privileged[:, columns["heights"]]
    expected = (env.simulation.qpos[:, 2:3] - 0.25) / 0.5
    torch.testing.assert_close(heights, expected.expand(2, 35))
    assert (privileged[0, columns["contact"]] == 1.0).all()
    assert (privileged[1, columns["contact"]] == 0.0).all()
    assert torch.equal(privileged[:, columns["physics"]], env.physics)


def test_the_last_action_is_observed_after_clipping():
    env = _make_env(2, action_clip=0.3, **QUIET)
    actions = torch.full((2, 12), 0.1)
    actions[:, 3], actions[:, 4] = 5.0, -5.0
    observed = env.step(actions)[0]["policy"][:, POLICY["last_action"]]
    torch.testing.assert_close(observed, actions.clamp(-0.3, 0.3))


def test_an_action_is_an_offset_to_the_stance():
    env = _make_env(2, action_scale=0.5, **CALM)
    env.step(torch.full((2, 12), 0.2))
    expected = torch.tensor(STAND_JOINT_POS) + 0.1
    torch.testing.assert_close(env.simulation.ctrl, expected.expand(2, 12))


def _alike_but(**ranges):
    """Return robots that differ in the given ranges alone."""
    nothing = {"friction_factor": (1, 1), "added_mass": (0, 0), "com_offset": (0, 0)}
    nothing |= {"gain_scale": (1, 1), "friction_loss": (0, 0)}
    return CALM | {"randomization": RandomizationCfg(**nothing, **ranges, push_interval=0.0)}


def test_an_encoders_offset_is_in_what_the_policy_sees_and_in_what_the_motor_holds():
    env = _make_env(3, **_alike_but(encoder_offset=(-0.1, 0.1)))
    offset = env.encoder_offset
    assert offset.unique().numel() == 36
    observed = _repeat(env, 0.4, 3)[0]["policy"][:, POLICY["joint_pos"]]
    scale = env.cfg.observations.scales.get("joint_pos", 1.0)
    torch.testing.assert_close(observed, scale * (env.joint_pos + offset))
    # By its encoder a joint is where it is asked to be when it stands this much beside it.
    set_point = env.stand + 0.4 * env.cfg.action_scale - offset
    torch.testing.assert_close(env.simulation.ctrl, set_point)


def test_a_tilted_sensor_sees_gravity_and_turning_from_its_own_frame():
    tilt = 0.2
    env = _make_env(3, **_alike_but(imu_tilt=(tilt, tilt)))
    env.simulation.qvel[:, 3:6] = torch.tensor([0.5, -1.0, 2.0])
    env._read_state()
    env._observe()
    seen = env.get_observations()["policy"]
    scales = env.cfg.observations.scales
    # Turned by the vector r = (tilt, tilt, tilt), by Rodrigues' formula.
    axis, angle = torch.full((3,), 3**-0.5), 3**0.5 * tilt
    for name, true in (
        ("base_ang_vel", env.base_ang_vel),
        ("projected_gravity", env.projected_gravity),
    ):
        along = (true @ axis)[:, None] * axis
        turned = math.cos(angle) * true + (1.0 - math.cos(angle)) * along
        turned += math.sin(angle) * torch.linalg.cross(axis.expand_as(true), true)
        torch.testing.assert_close(seen[:, POLICY[name]], scales.get(name, 1.0) * turned)
    # What is rewarded, and what the critic is told, is what the robot does.
    torch.testing.assert_close(env.projected_gravity, torch.tensor([[0.0, 0.0, -1.0]]).expand(3, 3))


def test_an_action_of_a_late_robot_comes_a_control_step_later():
    env, prompt = (_make_env(2, **_alike_but(action_delay=(delay, delay))) for delay in (0.02, 0.0))
    first, second = (
        [
            (each.step(torch.full((2, 12), size)), each.simulation.actuator_force.clone())[1]
            for size in (0.0, 1.0, 1.0)
        ]
        for each in (env, prompt)
    )
    torch.testing.assert_close(first[0], second[0])
    torch.testing.assert_close(first[1], second[0], atol=1.0, rtol=0.0)
    assert ((second[1] - second[0]).abs().amax(dim=1) > 3.0).all()
    assert ((first[2] - first[1]).abs().amax(dim=1) > 3.0).all()


def test_noise_reaches_the_policy_and_stays_within_its_amplitude():
    clean, noisy = _make_env(4, **QUIET), _make_env(4)
    difference = (noisy.get_observations()["policy"] - clean.get_observations()["policy"]).abs()
    assert (difference[:, POLICY["joint_vel"]] > 0.0).any()
    assert (difference[:, POLICY["joint_vel"]] <= 1.5 * 0.05 + 1e-6).all()
    assert (difference[:, POLICY["command"]] == 0.0).all()
    assert torch.equal(
        noisy.get_observations()["privileged"], clean.get_observations()["privileged"]
    )


def test_observations_that_were_kept_do_not_change():
    env = _make_env(2)
    kept = [env.get_observations()]
    kept += [env.step(_actions(2, step))[0] for step in range(2)]
    copies = [each.clone() for each in kept]
    _roll(env, 3)
    for observations, copy in zip(kept, copies, strict=True):
        for name in ("policy", "privileged"):
            assert torch.equal(observations[name], copy[name])


def test_every_step_has_a_log_of_its_own():
    env = _make_env(2)
    first, second = _stand_still(env)[3]["log"], _stand_still(env)[3]["log"]
    assert first is not second
    weighted = set(env.cfg.rewards.terms)
    assert {key for key in first if key.startswith("Reward/")} == {f"Reward/{n}" for n in weighted}
    assert all(value.ndim == 0 and value.isfinite() for value in first.values())


def test_getting_observations_has_no_side_effects():
    env, twin = _make_env(3), _make_env(3)
    for _ in range(3):
        again = env.get_observations()
        assert torch.equal(again["policy"], twin.get_observations()["policy"])
    assert torch.equal(_roll(env, 3), _roll(twin, 3))


# -- determinism and state ---------------------------------------------------------------------


def test_the_same_seed_gives_the_same_rollout_bit_for_bit():
    given = {"episode_length": 0.3, "seed": 3}
    rollout = _roll(_make_env(4, **given), 40)
    assert rollout[:, :, -2].any(), "no episode has ended"
    assert torch.equal(rollout, _roll(_make_env(4, **given), 40))


def test_another_seed_gives_another_rollout():
    assert not torch.equal(_roll(_make_env(2, seed=3), 2), _roll(_make_env(2, seed=4), 2))


def test_a_loaded_state_continues_bit_for_bit():
    given = {"episode_length": 0.3, "commands": CommandsCfg(resampling_time=0.1)}
    env = _make_env(4, seed=1, **given)
    _roll(env, 10)
    state = env.state_dict()
    expected = _roll(env, 20, first=10)
    # Another seed: the state carries the draws and the physics with it.
    twin = _make_env(4, seed=2, **given)
    _roll(twin, 3)
    twin.load_state_dict(state)
    assert torch.equal(_roll(twin, 20, first=10), expected)
    assert twin.step_count == env.step_count == 30


def test_loaded_observations_are_those_that_were_saved():
    env = _make_env(2)
    _roll(env, 3)
    state, expected = env.state_dict(), env.get_observations()
    twin = _make_env(2, seed=9)
    twin.load_state_dict(state)
    for name in ("policy", "privileged"):
        assert torch.equal(twin.get_observations()[name], expected[name])


def test_a_state_of_another_number_of_robots_is_refused():
    with pytest.raises(ValueError, match="num_envs"):
        _make_env(3).load_state_dict(_make_env(2).state_dict())


# -- ends of episodes and resets ---------------------------------------------------------------


def test_time_is_over_for_all_that_still_walk():
    env = _make_env(3, episode_length=0.1)
    for _ in range(4):
        _, _, dones, extras = _stand_still(env)
        assert not dones.any()
    _, _, dones, extras = _stand_still(env)
    assert dones.all()
    assert extras["time_outs"].all()
    assert (env.episode_length_buf == 0).all()


def test_a_robot_that_falls_in_its_last_step_is_not_timed_out():
    env = _make_env(3, episode_length=0.1)
    _stand_still(env, 4)
    _hang(env, 1, roll=1.5)
    _, _, dones, extras = _stand_still(env)
    assert dones.tolist() == [True, True, True]
    assert extras["time_outs"].tolist() == [True, False, True]
    assert extras["log"]["Episode/fall_rate"].item() == pytest.approx(1 / 3)


def test_too_large_a_tilt_ends_the_episode_even_in_the_air():
    env = _make_env(3, max_tilt=1.0)
    for index, roll in enumerate((0.9, 1.1, -1.1)):
        _hang(env, index, roll)
    _, _, dones, extras = _stand_still(env)
    assert dones.tolist() == [False, True, True]
    assert not extras["time_outs"].any()


def test_a_trunk_on_the_ground_ends_the_episode_though_it_is_level():
    env = _make_env(2, **CALM)
    folded = torch.tensor([0.0, 1.3, -2.7] * 4)
    env.simulation.qpos[1, 2] = 0.05
    env.simulation.qpos[1, 3:7] = _roll_angle(0.0)
    env.simulation.qpos[1, 7:] = folded
    _, _, dones, extras = env.step((folded - env.stand).repeat(2, 1) / env.cfg.action_scale)
    assert dones.tolist() == [False, True]
    assert not extras["time_outs"].any()
    assert env.unstable_count == 0


def test_the_reset_of_a_robot_touches_no_other():
    env, twin = _make_env(4, **QUIET), _make_env(4, **QUIET)
    _hang(env, 1, roll=2.0)
    rollout, expected = _roll(env, 8), _roll(twin, 8)
    assert rollout[0, 1, -2] == 1.0
    others = [0, 2, 3]
    assert torch.equal(rollout[:, others], expected[:, others])


def test_a_robot_begins_with_its_lowest_foot_on_the_ground():
    env = _make_env(8, initial_joint_noise=0.2)
    feet = sensor_slice(env.model, f"{LEGS[0]}_foot_pos", len(LEGS))
    clearance = env.simulation.sensordata[:, feet].view(8, 4, 3)[:, :, 2] - FOOT_RADIUS
    torch.testing.assert_close(clearance.amin(dim=1), torch.zeros(8), atol=1e-5, rtol=0.0)
    assert clearance.amax(dim=1).min() > 1e-3


def test_a_new_episode_begins_without_past_actions():
    env = _make_env(2, episode_length=0.1, **QUIET)
    observations, _, dones, _ = _repeat(env, 0.3, steps=5)
    assert dones.all()
    assert (observations["policy"][:, POLICY["last_action"]] == 0.0).all()
    assert (env.last_action == 0.0).all()
    assert (env.action_before_last == 0.0).all()


def test_a_reset_of_some_robots_begins_their_episodes_alone():
    env = _make_env(3, **QUIET)
    _stand_still(env, 4)
    before = env.simulation.qpos.clone()
    observations = env.reset(torch.tensor([False, True, False]))
    assert env.episode_length_buf.tolist() == [4, 0, 4]
    assert torch.equal(env.simulation.qpos[::2], before[::2])
    assert (env.simulation.qpos[1, :2] == 0.0).all()
    assert observations is env.get_observations()


def test_a_reset_begins_all_episodes():
    env = _make_env(3)
    _stand_still(env, 4)
    env.reset()
    assert (env.episode_length_buf == 0).all()


def test_without_autoreset_a_step_returns_the_last_observation():
    env = _make_env(2, episode_length=0.1, **QUIET)
    env.autoreset = False
    observations, _, dones, extras = _repeat(env, 0.3, steps=5)
    assert dones.all()
    assert extras["time_outs"].all()
    expected = torch.full((2, 12), 0.3)
    assert torch.equal(observations["policy"][:, POLICY["last_action"]], expected)
    assert (env.episode_length_buf == 5).all()


# -- what must not poison a batch --------------------------------------------------------------


def test_an_action_that_is_no_number_counts_as_zero():
    env, twin = _make_env(2), _make_env(2)
    actions = torch.zeros(2, 12)
    actions[0, 3] = math.nan
    observations, rewards, _, _ = env.step(actions)
    expected, expected_rewards, _, _ = twin.step(torch.zeros(2, 12))
    assert torch.equal(observations["policy"], expected["policy"])
    assert torch.equal(rewards, expected_rewards)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_robots_with_an_action_that_is_no_number_are_counted_in_each_step(value):
    env = _make_env(3)
    actions = torch.zeros(3, 12)
    actions[0, 3] = actions[2, 0] = actions[2, 7] = value
    assert env.step(actions)[3]["log"]["Episode/invalid_actions"].item() == 2.0
    assert env.invalid_action.tolist() == [True, False, True]
    assert _stand_still(env)[3]["log"]["Episode/invalid_actions"].item() == 0.0
    assert not env.invalid_action.any()


def test_an_infinite_action_is_clipped():
    env = _make_env(2, action_clip=1.0, **QUIET)
    observations, rewards, _, _ = env.step(torch.full((2, 12), -math.inf))
    assert (observations["policy"][:, POLICY["last_action"]] == -1.0).all()
    assert rewards.isfinite().all()


@pytest.mark.parametrize(("name", "value"), [("qvel", 1e6), ("qvel", math.nan), ("qpos", math.nan)])
def test_an_unstable_simulation_ends_its_episode_and_spoils_nothing(
    name, value, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its log of warnings into the working directory
    env, twin = _make_env(3, **QUIET), _make_env(3, **QUIET)
    _roll(env, 2)
    _roll(twin, 2)
    getattr(env.simulation, name)[1, 2] = value
    _, rewards, dones, extras = env.step(_actions(3, 2))
    assert dones.tolist() == [False, True, False]
    # Its value goes on from the last observation, as where the time is over: it is no fall.
    assert extras["time_outs"].tolist() == [False, True, False]
    assert rewards[1] == 0.0
    assert env.unstable_count == 1
    assert not env.fallen.any()
    assert extras["log"]["Episode/unstable"] == 1.0
    assert extras["log"]["Episode/fall_rate"] == 0.0
    # Neither is what the feet did meanwhile, at thousands of m/s, in the averages.
    assert all(value.abs() < 1e3 for value in extras["log"].values())
    _roll(twin, 1, first=2)
    rollout, expected = _roll(env, 5, first=3), _roll(twin, 5, first=3)
    assert rollout.isfinite().all()
    assert torch.equal(rollout[:, ::2], expected[:, ::2])


def test_the_observation_after_instability_is_that_of_a_new_episode(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    env = _make_env(2, **QUIET)
    env.simulation.qpos[0, 0] = math.nan
    observations, _, _, _ = _stand_still(env)
    assert observations["policy"].isfinite().all()
    assert observations["privileged"].isfinite().all()
    assert env.episode_length_buf.tolist() == [0, 1]


# -- commands, pushes, curriculum, phase -------------------------------------------------------


def test_a_command_that_is_set_is_observed_at_once():
    env = _make_env(2)
    env.set_command(torch.tensor([0.4, -0.2, 0.1, 0.9]))
    observed = env.get_observations()["policy"][:, POLICY["command"]]
    torch.testing.assert_close(observed, torch.tensor([[0.4, -0.2, 0.1, 0.9]]).expand(2, 4))


def test_velocities_are_drawn_anew_within_an_episode_and_beta_is_not():
    env = _make_env(4, commands=CommandsCfg(resampling_time=0.06, standing_fraction=0.0))
    before = env.commands.command.clone()
    _stand_still(env, 2)
    assert torch.equal(env.commands.command, before)
    _stand_still(env)
    assert (env.commands.command[:, :3] != before[:, :3]).all()
    assert torch.equal(env.commands.command[:, 3], before[:, 3])


def test_a_push_changes_the_velocity_at_its_interval_only():
    pushes = RandomizationCfg(push_interval=0.06, push_velocity=0.5)
    env, twin = (
        _make_env(2, randomization=cfg, **QUIET)
        for cfg in (pushes, RandomizationCfg(push_interval=0.0))
    )
    for step in range(3):
        assert torch.equal(env.simulation.qvel, twin.simulation.qvel)
        env.step(_actions(2, step))
        twin.step(_actions(2, step))
    push = env.simulation.qvel - twin.simulation.qvel
    assert (push[:, :2] != 0.0).all()
    assert (push[:, :2].abs() <= 0.5 + 1e-6).all()
    assert (push[:, 2:] == 0.0).all()


def test_intervals_below_a_control_step_act_in_every_step():
    env = _make_env(
        2,
        randomization=RandomizationCfg(push_interval=0.001),
        commands=CommandsCfg(resampling_time=0.001, standing_fraction=0.0),
    )
    before = env.commands.command.clone()
    _stand_still(env)
    assert (env.commands.command[:, :3] != before[:, :3]).all()


def test_quiet_grows_with_the_simulated_time():
    env = _make_env(1, rewards=RewardsCfg(quiet_ramp=(0.04, 0.12)))
    quiet = [env.curriculum.quiet]
    for _ in range(7):
        log = _stand_still(env)[3]["log"]
        quiet.append(env.curriculum.quiet)
        assert log["Curriculum/quiet"].item() == pytest.approx(env.curriculum.quiet)
    assert quiet == pytest.approx([0.0, 0.0, 0.0, 0.25, 0.5, 0.75, 1.0, 1.0])


def test_without_a_ramp_quiet_is_full_from_the_start():
    assert _make_env(1).curriculum.quiet == 1.0


def test_the_guide_leaves_the_reward_with_the_simulated_time():
    terms = {"diagonal_support": reward_term("diagonal_support", 1.0)}
    rewards = RewardsCfg(terms=terms, guide_ramp=(0.04, 0.12))
    env = _make_env(1, rewards=rewards, **CALM)
    env.set_command(torch.tensor([0.5, 0.0, 0.0, 0.0]))
    hips_out = torch.zeros(1, 12)
    hips_out[0, [1, 2, 10, 11]] = torch.tensor([4.0, -4.0, 4.0, -4.0])  # FR and RL drawn up
    guide, shares = [env.curriculum.guide], []
    for _ in range(7):
        log = env.step(hips_out)[3]["log"]
        guide.append(env.curriculum.guide)
        shares.append(log["Reward/diagonal_support"].item())
        assert log["Curriculum/guide"].item() == pytest.approx(env.curriculum.guide)
    assert guide == pytest.approx([1.0, 1.0, 1.0, 0.75, 0.5, 0.25, 0.0, 0.0])
    assert shares[3] > 0.1
    assert shares[-1] == 0.0


def test_steps_are_paid_for_by_the_time_since_the_foot_landed_last():
    terms = {"stepping": reward_term("stepping", 2.0, period=0.5, target=0.02)}
    env = _make_env(2, rewards=RewardsCfg(terms=terms), **CALM)
    env.set_command(torch.tensor([0.5, 0.0, 0.0, 0.0]))
    lift = torch.zeros(2, 12)
    lift[:, [1, 2, 10, 11]] = torch.tensor([4.0, -4.0, 4.0, -4.0])  # FR and RL drawn up
    stand = torch.zeros_like(lift)
    # Up for four steps of ten.
    paid = [env.step(lift if step % 10 >= 6 else stand)[1] for step in range(40)]
    # The two feet of each robot land every 0.2 s, in one step of ten.
    steps = torch.stack(paid[20:])
    assert (steps > 0.0).sum(dim=0).tolist() == [2, 2]
    torch.testing.assert_close(steps.sum(dim=0), torch.full((2,), 2 * 2 * 0.2 * 2.0 * env.step_dt))


@pytest.mark.parametrize("time", [0.0, 0.1])
def test_the_velocity_error_is_averaged_over_the_time_that_is_asked_for(time):
    env = _make_env(2, rewards=RewardsCfg(following_time=time), **CALM)
    env.set_command(torch.tensor([0.5, -0.2, 0.3, 1.0]))
    share = 1.0 - math.exp(-env.step_dt / time) if time else 1.0
    expected = torch.zeros(2, 3)
    for step in range(12):
        if step == 8:
            env.reset(torch.tensor([False, True]))
            env.set_command(torch.tensor([0.5, -0.2, 0.3, 1.0]))
            expected[1] = 0.0
        env.step(torch.zeros(2, 12))
        velocity = torch.cat((env.base_lin_vel[:, :2], env.base_ang_vel[:, 2:]), dim=1)
        expected += share * (torch.tensor([0.5, -0.2, 0.3]) - velocity - expected)
        torch.testing.assert_close(env.followed.error, expected)
    assert float(env.followed.error.abs().max()) > 0.1


def test_the_drift_of_the_heading_is_averaged_over_two_seconds():
    env = _make_env(2, **CALM)
    env.set_command(torch.tensor([0.0, 0.0, 0.5, 0.0]))
    drift = torch.zeros(2)
    for step in range(10):
        if step == 6:
            env.reset(torch.tensor([True, False]))
            env.set_command(torch.tensor([0.0, 0.0, 0.5, 0.0]))
            drift[0] = 0.0
        env.step(torch.zeros(2, 12))
        drift += (1.0 - math.exp(-env.step_dt / 2.0)) * (0.5 - env.base_ang_vel[:, 2] - drift)
        torch.testing.assert_close(env.followed.drift, drift)
    kept = env.followed.state_dict()
    env.followed.reset(torch.ones(2, dtype=torch.bool))
    env.followed.load_state_dict(kept)
    torch.testing.assert_close(env.followed.drift, drift)


def test_what_is_followed_goes_from_command_to_command_with_the_acceleration_that_is_asked_for():
    env = _make_env(2, rewards=RewardsCfg(following_acceleration=5.0), **CALM)
    commands = torch.tensor([[0.25, -0.3, 0.0, 0.0], [-0.05, 0.0, 0.1, 0.0]])
    seen = []
    for command in commands:
        env.set_command(command)
        for _ in range(4):
            env.step(torch.zeros(2, 12))
            velocity = torch.cat((env.base_lin_vel[:, :2], env.base_ang_vel[:, 2:]), dim=1)
            torch.testing.assert_close(env.followed.error, env.followed.reference - velocity)
            seen.append(env.followed.reference[0])
    expected = [
        *([0.1, -0.1, 0.0], [0.2, -0.2, 0.0], [0.25, -0.3, 0.0], [0.25, -0.3, 0.0]),
        *([0.15, -0.2, 0.1], [0.05, -0.1, 0.1], [-0.05, 0.0, 0.1], [-0.05, 0.0, 0.1]),
    ]
    torch.testing.assert_close(torch.stack(seen), torch.tensor(expected))
    env.reset(torch.tensor([True, False]))
    assert env.followed.reference[0].abs().max() == 0.0
    torch.testing.assert_close(env.followed.reference[1], commands[1, :3])


def test_without_a_ramp_there_is_no_guide():
    assert _make_env(1).curriculum.guide == 0.0


@pytest.mark.parametrize(("source", "differs"), [("estimated", True), ("true", False)])
def test_the_phase_that_was_handed_over_shapes_the_reward_where_it_is_asked_for(source, differs):
    rewards = []
    for phase in (0.0, 1.0):
        env = _make_env(2, rewards=RewardsCfg(phase_source=source))
        env.set_command(torch.tensor([0.0, 0.0, 0.0, 1.0]))
        _hang(env, 0)
        _hang(env, 1)
        env.set_estimated_phase(torch.full((2, 4), phase))
        rewards.append(_stand_still(env, 2)[1])
    # The feet fall: the further the estimated phase, the dearer.
    assert bool((rewards[1] < rewards[0]).all()) is differs


def test_the_true_phase_that_a_step_is_rewarded_by_is_that_of_the_observation_acted_on():
    only_drop = {"foot_drop_velocity": reward_term("foot_drop_velocity", -0.5)}
    rewards = RewardsCfg(terms=only_drop, phase_source="true")
    env = _make_env(2, rewards=rewards, episode_length=0.24, **QUIET)
    moved = 0
    for step in range(20):  # across the end of an episode
        before = env.get_observations()["privileged"][:, env.privileged_slices["phase"]]
        beta = env.commands.beta.clone()
        reward, dones = env.step(_actions(2, step, size=3.0))[1:3]
        feet = env.footfalls
        expected = -0.5 * env.step_dt * beta * (before.exp() * feet.drop_sq).sum(dim=1)
        # Of an episode that has just ended, the feet's speeds are forgotten already.
        torch.testing.assert_close(reward[~dones], expected[~dones])
        moved += int(((feet.phase != before) & (feet.drop_sq > 1e-4))[~dones].sum())
    assert moved > 20  # the phase of the next observation would have given another reward


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("num_envs", 0),
        ("decimation", 0),
        ("episode_length", 0.0),
        ("episode_length", math.inf),
        ("initial_joint_noise", math.nan),
        ("initial_velocity", -0.1),
        ("action_scale", -0.25),
        ("action_clip", 0.0),
        ("max_tilt", math.nan),
    ],
)
def test_a_bad_field_is_refused_by_name(field, value):
    with pytest.raises(ValueError, match=f"env.{field}"):
        QuadrupedEnvCfg(**{field: value})


def test_an_action_for_each_physics_step_is_taken_in_it():
    one, each = _make_env(2, **CALM), _make_env(2, **CALM)
    for step in range(5):
        action = _actions(2, step)
        one.step(action)
        each.step(action[:, None].expand(-1, one.cfg.decimation, -1))
    assert torch.equal(one.simulation.qpos, each.simulation.qpos)
    actions = torch.stack([_actions(2, step) for step in range(4)], dim=1)
    each.step(actions)
    one.step(actions[:, -1])
    assert not torch.equal(one.simulation.qpos, each.simulation.qpos)
    assert torch.equal(each.action, actions[:, -1])
    columns = POLICY["last_action"]
    assert torch.equal(each.get_observations()["policy"][:, columns], actions[:, -1])


def test_sensors_read_weight_and_contact_at_rest_and_a_push_as_acceleration():
    cfg = ObservationsCfg(noise_level=0.0, sensors=True)
    env = _make_env(2, **(CALM | {"observations": cfg}))
    columns = slices(SENSOR_WIDTHS)

    def sensed(name):
        return env.get_observations()["sensors"][:, columns[name]]

    _stand_still(env, 100)
    gravity = env.projected_gravity
    torch.testing.assert_close(sensed("specific_force"), -9.81 * gravity, rtol=0.0, atol=0.05)
    assert torch.equal(sensed("foot_contact"), torch.ones(2, 4))
    assert "sensors" not in _make_env(2, **CALM).get_observations()
    env.simulation.qvel[:, 2] += 3.0
    _stand_still(env)
    assert (sensed("foot_contact") < 1.0).any()
    _stand_still(env, 5)  # flies
    assert torch.equal(sensed("foot_contact"), torch.zeros(2, 4))
    assert float(sensed("specific_force").norm(dim=1).max()) < 1.0


def test_a_tilted_sensor_reads_gravity_alike_as_acceleration_and_as_its_direction():
    robots = RandomizationCfg(imu_tilt=(0.1, 0.1), push_interval=0.0)
    observations = ObservationsCfg(noise_level=0.0, sensors=True)
    env = _make_env(2, **(CALM | {"observations": observations, "randomization": robots}))
    _stand_still(env, 100)
    seen = env.get_observations()
    gravity = seen["policy"][:, POLICY["projected_gravity"]]
    force = seen["sensors"][:, slices(SENSOR_WIDTHS)["specific_force"]]
    torch.testing.assert_close(force, -9.81 * gravity, rtol=0.0, atol=0.05)
    assert float((gravity - env.projected_gravity).abs().max()) > 0.05


def test_what_sensors_read_survives_a_state_and_begins_anew_with_an_episode():
    cfg = ObservationsCfg(noise_level=0.0, sensors=True)
    env, twin = (_make_env(2, seed=seed, **QUIET | {"observations": cfg}) for seed in (1, 2))
    _roll(env, 7)
    twin.load_state_dict(env.state_dict())
    command = torch.tensor([0.3, 0.0, 0.0, 0.0])
    for each in (env, twin):
        each.set_command(command)  # makes the observations anew
    read = env.get_observations()["sensors"]
    assert torch.equal(twin.get_observations()["sensors"], read)
    env.reset(torch.tensor([True, False]))
    fresh = env.get_observations()["sensors"]
    assert float(fresh[0, :3].norm()) == pytest.approx(9.81, abs=1e-3)
    assert torch.equal(fresh[1], read[1])
