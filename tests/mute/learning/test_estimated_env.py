"""The estimator in the loop: what it consumes when, and what it publishes."""

from __future__ import annotations

import pytest
import torch
from tensordict import TensorDict

from mute.envs.commands import CommandsCfg
from mute.envs.observations import ObservationsCfg
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.learning.estimated_env import EstimatedEnv, estimate_group, go_group
from mute.networks.estimator import Estimate, Estimator, EstimatorCfg

NUM_ENVS, OBS_DIM, NUM_HEIGHTS = 3, 5, 4
CFG = EstimatorCfg(lstm_hidden=6, latent_dim=2, decoder_hidden=(4,), phase_hidden=(4,))


class _ScriptedEnv:
    """Gives random observations and the dones it is told, and remembers what is done to it."""

    num_envs, num_actions, max_episode_length = NUM_ENVS, 12, 10
    device = torch.device("cpu")
    cfg = QuadrupedEnvCfg()

    def __init__(self, *dones: list[bool]) -> None:
        self.calls: list[tuple[str, torch.Tensor]] = []
        self._dones = iter(dones)
        self._generator = torch.Generator().manual_seed(0)
        self.episode_length_buf = torch.zeros(NUM_ENVS, dtype=torch.long)
        self._observe()

    def get_observations(self) -> TensorDict:
        return self._observations

    def set_estimated_phase(self, phase: torch.Tensor) -> None:
        self.calls.append(("phase", phase.clone()))

    def step(self, actions: torch.Tensor):
        self.calls.append(("step", actions.clone()))
        self._observe()
        dones = torch.tensor(next(self._dones))
        return self._observations, torch.zeros(NUM_ENVS), dones, {"log": {}}

    def state_dict(self):
        return {"observations": self._observations["policy"].clone()}

    def load_state_dict(self, state) -> None:
        self._observations = TensorDict(
            {"policy": state["observations"], "privileged": torch.zeros(NUM_ENVS, 1)},
            batch_size=[NUM_ENVS],
        )

    def _observe(self) -> None:
        policy = torch.randn(NUM_ENVS, OBS_DIM, generator=self._generator)
        groups = {"policy": policy, "privileged": torch.zeros(NUM_ENVS, 1)}
        self._observations = TensorDict(groups, batch_size=[NUM_ENVS])


def _make_env(*dones: list[bool], with_phase: bool = True) -> EstimatedEnv:
    torch.manual_seed(0)
    scripted = _ScriptedEnv(*dones)
    estimator = Estimator(OBS_DIM, NUM_HEIGHTS, CFG)
    return EstimatedEnv(scripted, estimator, "cpu", with_phase)  # pyright: ignore[reportArgumentType]


ACTIONS = torch.zeros(NUM_ENVS, 12)
NONE = [False, False, False]


def test_the_group_is_velocity_normalised_heights_latent_and_phase_in_this_order():
    estimator = Estimator(OBS_DIM, 2, CFG, height_offset=0.30, height_scale=0.1)
    estimate = Estimate(
        base_lin_vel=torch.tensor([[1.0, 2.0, 3.0]]),
        heights=torch.tensor([[0.30, 0.45]]),
        latent_mean=torch.tensor([[-9.0, -9.0]]),
        latent_log_var=torch.tensor([[-9.0, -9.0]]),
        latent=torch.tensor([[5.0, 6.0]]),
        phase=torch.tensor([[0.1, 0.2, 0.3, 0.4]]),
    )
    expected = torch.tensor([[1.0, 2.0, 3.0, 0.0, 1.5, 5.0, 6.0, 0.1, 0.2, 0.3, 0.4]])
    assert torch.allclose(estimate_group(estimate, estimator, with_phase=True), expected)
    assert torch.allclose(estimate_group(estimate, estimator, with_phase=False), expected[:, :7])


def test_the_signal_to_go_is_given_by_every_velocity_command_but_none():
    obs = torch.ones(6, 46)
    obs[:, 42:45] = torch.tensor(
        [[0, 0, 0], [1e-4, 0, 0], [0.02, 0, 0], [0, -0.02, 0], [0, 0, 1.0], [-1.0, 0.5, 0]]
    )
    assert go_group(obs, QuadrupedEnvCfg()).tolist() == [[0.0], [0.0], [1.0], [1.0], [1.0], [1.0]]


def test_the_signal_to_go_knows_of_the_deadband_and_of_the_scale_of_commands():
    scales = ObservationsCfg().scales | {"command": 2.0}
    cfg = QuadrupedEnvCfg(
        commands=CommandsCfg(deadband=0.06), observations=ObservationsCfg(scales=scales)
    )
    obs = torch.ones(3, 46)
    obs[:, 42:45] = 2.0 * torch.tensor([[0.05, 0.0, 0.0], [0.06, 0.0, 0.0], [0.0, -0.05, 0.05]])
    assert go_group(obs, cfg).tolist() == [[0.0], [1.0], [1.0]]


@pytest.mark.parametrize(("with_phase", "width"), [(True, 3 + 4 + 2 + 4), (False, 3 + 4 + 2)])
def test_the_phase_can_be_left_out_of_what_the_actor_sees(with_phase, width):
    env = _make_env(NONE, with_phase=with_phase)
    assert env.get_observations()["estimate"].shape == (NUM_ENVS, width)
    observations, *_ = env.step(ACTIONS)
    assert observations["estimate"].shape == (NUM_ENVS, width)


def test_the_phase_estimated_from_an_observation_is_handed_over_before_the_step_it_rewards():
    env = _make_env(NONE, NONE)
    handed = []
    for _ in range(2):
        handed.append(env.estimate.phase.clone())
        env.step(ACTIONS)
    calls = env.env.calls  # pyright: ignore[reportAttributeAccessIssue]
    assert [name for name, _ in calls] == ["phase", "step", "phase", "step"]
    assert torch.equal(calls[0][1], handed[0])
    assert torch.equal(calls[2][1], handed[1])
    assert not torch.equal(handed[0], handed[1])


@torch.no_grad()
def test_the_state_is_carried_on_except_where_an_episode_ended():
    env = _make_env(NONE, [False, True, False])
    env.step(ACTIONS)
    before = env.state
    observations, *_ = env.step(ACTIONS)
    carried, _ = env.estimator.step(observations["policy"], before)
    anew, _ = env.estimator.step(observations["policy"], env.estimator.initial_state(NUM_ENVS))
    assert torch.equal(env.estimate.base_lin_vel[[0, 2]], carried.base_lin_vel[[0, 2]])
    assert torch.equal(env.estimate.base_lin_vel[1], anew.base_lin_vel[1])
    assert not torch.equal(carried.base_lin_vel[1], anew.base_lin_vel[1])
    assert all(not bool(part[1].any()) for part in env.state_before)


def test_what_was_published_and_the_states_before_are_never_written_again():
    env = _make_env(NONE, [True, False, False], NONE)
    kept, copies = [], []
    for _ in range(3):
        observations, *_ = env.step(ACTIONS)
        now = [observations[key] for key in ("policy", "estimate")] + [
            *env.state,
            *env.state_before,
        ]
        kept.append(now)
        copies.append([tensor.clone() for tensor in now])
    for now, copy in zip(kept, copies, strict=True):
        assert all(map(torch.equal, now, copy))
    pointers = {now[1].data_ptr() for now in kept}
    assert len(pointers) == 3


def test_asking_for_observations_changes_nothing():
    env = _make_env()
    state, observations = env.state, env.get_observations()
    values = observations["estimate"].clone()
    again = env.get_observations()
    assert torch.equal(again["estimate"], values)
    assert all(one is other for one, other in zip(env.state, state, strict=True))


def test_refreshing_estimates_the_held_observation_with_the_new_weights():
    env = _make_env(NONE)
    observations, *_ = env.step(ACTIONS)
    stale = observations["estimate"].clone()
    with torch.no_grad():
        env.estimator.base_lin_vel_head.bias.add_(1.0)
        env.estimator.lstm.bias_hh.add_(0.5)
    env.refresh()
    with torch.no_grad():
        expected, state = env.estimator.step(observations["policy"], env.state_before)
    assert not torch.equal(observations["estimate"], stale)
    assert torch.equal(
        observations["estimate"], estimate_group(expected, env.estimator, with_phase=True)
    )
    assert all(map(torch.equal, env.state, state))


def test_estimates_carry_no_gradient():
    env = _make_env(NONE)
    observations, *_ = env.step(ACTIONS)
    assert not observations["estimate"].requires_grad
    assert not env.estimate.phase.requires_grad


def test_a_saved_state_continues_with_the_same_estimates():
    one, other = _make_env([False, True, False], NONE), _make_env(NONE)
    one.step(ACTIONS)
    other.load_state_dict(one.state_dict())
    assert torch.equal(one.get_observations()["estimate"], other.get_observations()["estimate"])
    assert all(map(torch.equal, one.state, other.state))
