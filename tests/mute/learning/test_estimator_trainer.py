"""The estimator's losses against hand calculation, its labels against closed forms."""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Iterable

import pytest
import torch
from learning_helpers import make_cfg
from rsl_rl.storage import RolloutStorage
from tensordict import TensorDict

from mute.config import EstimationCfg
from mute.learning import estimator_trainer as estimation
from mute.learning.estimator_trainer import EstimatorTrainer, Labels, estimator_losses
from mute.learning.runner import MuteRunner
from mute.networks.estimator import Estimate, Estimator, EstimatorCfg
from mute.tasks import make_task

OBS_DIM, NUM_HEIGHTS, NUM_ENVS, NUM_STEPS = 2, 3, 3, 20
PRIVILEGED = {"base_lin_vel": slice(0, 3), "heights": slice(3, 6), "contact": slice(6, 10)}
NETWORK = EstimatorCfg(lstm_hidden=5, latent_dim=2, decoder_hidden=(4,), phase_hidden=(4,))
HEIGHT_SCALE = 0.1
# Swing and stance of each foot in steps, and where in its stride it starts.
SWING = torch.tensor([3, 4, 5, 6])
STANCE = torch.tensor([4, 3, 6, 5])
OFFSET = torch.tensor([0, 2, 5, 9])


# -- losses --------------------------------------------------------------------------------------


def _make_case() -> tuple[Estimate, torch.Tensor, Labels]:
    """Return two steps of one environment: every error below is a round number."""
    estimate = Estimate(
        base_lin_vel=torch.tensor([[[1.0, 0.0, 0.0]], [[0.0, 0.0, 3.0]]]),
        heights=torch.tensor([[[0.30, 0.30]], [[0.30, 0.50]]]),
        latent_mean=torch.tensor([[[1.0, 0.0]], [[0.0, 2.0]]]),
        latent_log_var=torch.tensor([[[0.0, math.log(2.0)]], [[0.0, 0.0]]]),
        latent=torch.zeros(2, 1, 2),
        phase=torch.tensor([[[0.5, 0.5, 0.5, 0.5]], [[1.0, 0.0, 1.0, 0.0]]]),
    )
    labels = Labels(
        base_lin_vel=torch.zeros(2, 1, 3),
        heights=torch.full((2, 1, 2), 0.30),
        phase=torch.tensor([[[0.0, 0.5, 0.5, 0.7]], [[0.5, 1.0, 0.0, 0.0]]]),
        phase_closed=torch.tensor([[[True, True, False, False]], [[True, False, False, True]]]),
        next_obs=torch.tensor([[[1.0, 2.0]], [[9.0, 9.0]]]),
        next_valid=torch.tensor([[True], [False]]),
    )
    return estimate, torch.tensor([[[1.0, 4.0]], [[0.0, 0.0]]]), labels


CFG = EstimationCfg(network=NETWORK, lambda_fwd=3.0, lambda_phase=5.0, lambda_kl=0.1)
# v: (1 + 9) / 6; h: 0.04 / 4 in m^2, over 0.1^2.
L_EST = 10.0 / 6.0 + 1.0
# KL of the first step: (1/2)(1) + (1/2)(2 - 1 - ln 2); of the second (1/2)(4); mean of the two,
# though no next observation follows the second: of an LSTM, all steps count.
KL = (0.5 + 0.5 * (1.0 - math.log(2.0)) + 2.0) / 2.0
# o_{t+1}: only the first step counts, (0 + 4) / 2.
L_FWD = 2.0 + 0.1 * KL
# phase: closed errors are 0.5, 0, 0.5, 0.
L_PHASE = 0.5 / 4.0


def test_each_loss_is_its_hand_computed_value():
    losses = estimator_losses(*_make_case(), CFG, HEIGHT_SCALE)
    assert float(losses.estimation) == pytest.approx(L_EST, rel=1e-5)
    assert float(losses.forward) == pytest.approx(L_FWD, rel=1e-5)
    assert float(losses.phase) == pytest.approx(L_PHASE, rel=1e-5)


def test_the_total_is_the_papers_weighted_sum():
    losses = estimator_losses(*_make_case(), CFG, HEIGHT_SCALE)
    assert float(losses.total) == pytest.approx(L_EST + 3.0 * L_FWD + 5.0 * L_PHASE, rel=1e-5)


def test_the_errors_shown_are_in_physical_units():
    losses = estimator_losses(*_make_case(), CFG, HEIGHT_SCALE)
    assert float(losses.velocity_rmse) == pytest.approx(math.sqrt(10.0 / 6.0), rel=1e-5)
    assert float(losses.height_rmse) == pytest.approx(0.1, rel=1e-5)
    assert float(losses.phase_mae) == pytest.approx(0.25, rel=1e-5)


def test_the_kl_is_summed_over_the_latent_and_averaged_over_the_batch():
    estimate, decoded, labels = _make_case()
    wide = estimate._replace(latent_mean=torch.ones(2, 1, 8), latent_log_var=torch.zeros(2, 1, 8))
    labels.next_valid = torch.zeros(2, 1, dtype=torch.bool)
    losses = estimator_losses(wide, decoded, labels, CFG, HEIGHT_SCALE)
    assert float(losses.forward) == pytest.approx(0.1 * 8 * 0.5, rel=1e-5)


HISTORY = dataclasses.replace(CFG, network=dataclasses.replace(NETWORK, encoder="history"))
# Of a window of observations the KL counts where the next one does: at the first step alone.
KL_OF_HISTORY = 0.5 + 0.5 * (1.0 - math.log(2.0))


def test_the_kl_of_a_window_of_observations_is_masked_at_the_ends_of_episodes():
    estimate, decoded, labels = _make_case()
    losses = estimator_losses(estimate, decoded, labels, HISTORY, HEIGHT_SCALE)
    assert float(losses.forward) == pytest.approx(2.0 + 0.1 * KL_OF_HISTORY, rel=1e-5)
    wild = estimate.latent_mean.clone()
    wild[1] = 1.0e3
    other = estimate._replace(latent_mean=wild.requires_grad_())
    losses_too = estimator_losses(other, decoded, labels, HISTORY, HEIGHT_SCALE)
    assert losses_too.total.item() == losses.total.item()
    losses_too.total.backward()
    assert wild.grad is not None
    assert torch.equal(wild.grad[1], torch.zeros_like(wild.grad[1]))
    assert torch.all(wild.grad[0, 0, 0] > 0.0)


def test_with_no_next_observation_at_all_the_kl_of_a_window_is_zero_and_not_nan():
    estimate, decoded, labels = _make_case()
    labels.next_valid = torch.zeros_like(labels.next_valid)
    losses = estimator_losses(estimate, decoded, labels, HISTORY, HEIGHT_SCALE)
    assert losses.forward.item() == 0.0


@pytest.mark.parametrize(("task", "masked"), [("go1_dreamwaq", True), ("go1_mute", False)])
def test_dreamwaqs_kl_is_masked_and_mutes_is_over_all_steps(task, masked):
    cfg = dataclasses.replace(make_task(task).agent.estimation, lambda_kl=0.1)
    expected = 2.0 + 0.1 * (KL_OF_HISTORY if masked else KL)
    losses = estimator_losses(*_make_case(), cfg, HEIGHT_SCALE)
    assert float(losses.forward) == pytest.approx(expected, rel=1e-5)


def test_a_next_observation_of_another_episode_does_not_count():
    estimate, decoded, labels = _make_case()
    before = float(estimator_losses(estimate, decoded, labels, CFG, HEIGHT_SCALE).forward)
    labels.next_obs[1] = 1.0e6
    assert float(estimator_losses(estimate, decoded, labels, CFG, HEIGHT_SCALE).forward) == before


def test_an_open_phase_does_not_count():
    estimate, decoded, labels = _make_case()
    before = float(estimator_losses(estimate, decoded, labels, CFG, HEIGHT_SCALE).phase)
    labels.phase[0, 0, 2] = 1.0e6
    assert float(estimator_losses(estimate, decoded, labels, CFG, HEIGHT_SCALE).phase) == before


def test_with_everything_masked_losses_and_gradients_are_zero_and_not_nan():
    estimate, decoded, labels = _make_case()
    phase, decoded = estimate.phase.requires_grad_(), decoded.requires_grad_()
    labels.phase_closed = torch.zeros_like(labels.phase_closed)
    labels.next_valid = torch.zeros_like(labels.next_valid)
    losses = estimator_losses(estimate._replace(phase=phase), decoded, labels, CFG, HEIGHT_SCALE)
    losses.total.backward()
    assert losses.phase.item() == 0.0
    assert losses.phase_mae.item() == 0.0
    assert losses.forward.item() == pytest.approx(0.1 * KL, rel=1e-5)
    for tensor in (phase, decoded):
        assert tensor.grad is not None
        assert torch.equal(tensor.grad, torch.zeros_like(tensor))


# -- labels --------------------------------------------------------------------------------------


def _contact(time: torch.Tensor) -> torch.Tensor:
    """Return the contacts of a steady walk. Time (T,), result (T, 4)."""
    return (time[:, None] + OFFSET) % (SWING + STANCE) >= SWING


def _closed_form_phase(time: torch.Tensor) -> torch.Tensor:
    position = (time[:, None] + OFFSET) % (SWING + STANCE)
    return torch.where(position < SWING, position / SWING, 1.0 - (position - SWING) / STANCE)


def _obs(time: int, env_id: int) -> torch.Tensor:
    return torch.tensor([float(time), float(env_id)])


def _make_rollout(index: int, ends: set[tuple[int, int]]) -> RolloutStorage:
    """Return the rollout number `index` of a steady walk; `ends` holds (global step, env)."""
    privileged = torch.zeros(NUM_STEPS, NUM_ENVS, 10)
    policy = torch.zeros(NUM_STEPS, NUM_ENVS, OBS_DIM)
    time = index * NUM_STEPS + torch.arange(NUM_STEPS)
    privileged[:, :, PRIVILEGED["contact"]] = _contact(time)[:, None].float()
    privileged[:, :, 0] = torch.arange(NUM_ENVS)  # tells environments apart after shuffling
    privileged[:, :, 1] = time[:, None]
    privileged[:, :, PRIVILEGED["heights"]] = 2.0
    example = TensorDict({"policy": policy[0], "privileged": privileged[0]}, batch_size=[NUM_ENVS])
    storage = RolloutStorage("rl", NUM_ENVS, NUM_STEPS, example, [12])
    for step in range(NUM_STEPS):
        for env_id in range(NUM_ENVS):
            policy[step, env_id] = _obs(int(time[step]), env_id)
            storage.dones[step, env_id] = (int(time[step]), env_id) in ends
    storage.observations["policy"].copy_(policy)
    storage.observations["privileged"].copy_(privileged)
    return storage


def _make_trainer(learning_rate: float = 1.0e-3, robots_share: float = 1.0) -> EstimatorTrainer:
    torch.manual_seed(0)
    estimator = Estimator(
        OBS_DIM, NUM_HEIGHTS, NETWORK, height_offset=0.5, height_scale=HEIGHT_SCALE
    )
    cfg = EstimationCfg(
        network=NETWORK,
        num_mini_batches=1,
        learning_rate=learning_rate,
        robots_share=robots_share,
    )
    return EstimatorTrainer(estimator, cfg, PRIVILEGED, min_steps=2, max_steps=50)


def _watch_labels(monkeypatch) -> list[Labels]:
    """Return a list that grows by the labels of each step of the optimiser."""
    seen: list[Labels] = []
    losses = estimation.estimator_losses

    def spy(estimate, decoded, labels, *rest):
        seen.append(labels)
        return losses(estimate, decoded, labels, *rest)

    monkeypatch.setattr(estimation, "estimator_losses", spy)
    return seen


def _labels_after(monkeypatch, rollouts: int, ends: Iterable[tuple[int, int]] = ()) -> Labels:
    """Return what the last of some updates learnt from, environments in order."""
    seen = _watch_labels(monkeypatch)
    trainer = _make_trainer()
    for index in range(rollouts):
        trainer.update(_make_rollout(index, set(ends)), trainer.estimator.initial_state(NUM_ENVS))
    return seen[-1].select(seen[-1].base_lin_vel[0, :, 0].argsort())


def test_the_first_rollout_only_waits_for_its_labels():
    trainer = _make_trainer()
    before = [parameter.clone() for parameter in trainer.estimator.parameters()]
    state = trainer.estimator.initial_state(NUM_ENVS)
    assert trainer.update(_make_rollout(0, set()), state) == {}
    assert all(map(torch.equal, before, trainer.estimator.parameters()))


def test_labels_are_those_of_the_rollout_before(monkeypatch):
    labels = _labels_after(monkeypatch, rollouts=3)
    time = torch.arange(NUM_STEPS, 2.0 * NUM_STEPS)
    assert torch.equal(labels.base_lin_vel[:, 1, 1], time)
    assert torch.allclose(labels.heights, torch.tensor(0.5 + 2.0 * HEIGHT_SCALE))


def test_between_two_others_every_phase_of_a_walk_is_known_and_in_closed_form(monkeypatch):
    labels = _labels_after(monkeypatch, rollouts=3)
    expected = _closed_form_phase(torch.arange(NUM_STEPS, 2 * NUM_STEPS))
    assert bool(labels.phase_closed.all())
    for env_id in range(NUM_ENVS):
        assert torch.allclose(labels.phase[:, env_id], expected, atol=1e-6)


def test_the_very_first_segments_have_no_phase(monkeypatch):
    labels = _labels_after(monkeypatch, rollouts=2)
    # Foot 0 swings from -0 on: that is no event; it lands at step 3, and from there all is known.
    assert labels.phase_closed[:, 0, 0].tolist() == [False] * 3 + [True] * (NUM_STEPS - 3)


def test_at_an_episodes_end_the_phase_is_open_on_both_sides(monkeypatch):
    # Foot 0 swings at 21 to 23 and 28 to 30 (7 a stride); the episode ends with step 25, in stance.
    labels = _labels_after(monkeypatch, rollouts=3, ends={(25, 1)})
    open_steps = (~labels.phase_closed[:, 1, 0]).nonzero().flatten() + NUM_STEPS
    assert open_steps.tolist() == [24, 25, 26, 27]
    assert bool(labels.phase_closed[:, [0, 2]].all())


def test_the_next_observation_crosses_the_boundary_of_rollouts(monkeypatch):
    labels = _labels_after(monkeypatch, rollouts=3)
    expected = [[_obs(t + 1, n).tolist() for n in range(NUM_ENVS)] for t in range(20, 40)]
    assert labels.next_obs.tolist() == expected
    assert bool(labels.next_valid.all())


def test_the_next_observation_is_masked_where_the_episode_ended(monkeypatch):
    ends = {(25, 1), (39, 2)}  # inside the rollout, and with its last step
    labels = _labels_after(monkeypatch, rollouts=3, ends=ends)
    masked = (~labels.next_valid).nonzero()
    assert masked.tolist() == [[5, 1], [19, 2]]


# -- learning ------------------------------------------------------------------------------------


def test_the_unrolled_state_is_the_past_rollouts_and_zeroed_where_episodes_begin(monkeypatch):
    trainer = _make_trainer()
    calls = []
    unroll = trainer.estimator.unroll

    def spy(obs, state, starts, sample):
        calls.append((state[0][:, 0].tolist(), starts.clone(), sample))
        return unroll(obs, state, starts, sample=sample)

    monkeypatch.setattr(trainer.estimator, "unroll", spy)
    monkeypatch.setattr(torch, "randperm", lambda n, device=None: torch.arange(n))
    ends = {(19, 0), (25, 1), (39, 2)}
    for index in range(3):
        hidden = torch.full((NUM_ENVS, 5), float(index))
        trainer.update(_make_rollout(index, ends), (hidden, hidden))
    first, second = calls
    assert (first[0], second[0]) == ([0.0] * NUM_ENVS, [1.0] * NUM_ENVS)
    assert bool(first[1][0].all())
    assert second[1].nonzero().tolist() == [[0, 0], [6, 1]]
    assert second[2] is True


def test_each_update_learns_from_a_share_of_the_robots_drawn_anew(monkeypatch):
    trainer = _make_trainer(robots_share=2 / 3)
    seen = _watch_labels(monkeypatch)
    state = trainer.estimator.initial_state(NUM_ENVS)
    for index in range(20):
        trainer.update(_make_rollout(index, set()), state)
    drawn = {tuple(sorted(labels.base_lin_vel[0, :, 0].int().tolist())) for labels in seen}
    assert drawn == {(0, 1), (0, 2), (1, 2)}


@pytest.mark.parametrize(
    ("robots", "parts", "sizes"), [(5, 4, [2, 1, 1, 1]), (7, 3, [3, 2, 2]), (8, 2, [4, 4])]
)
def test_robots_are_split_into_as_many_mini_batches_as_asked_for(monkeypatch, robots, parts, sizes):
    cfg = make_cfg(iterations=2, num_envs=robots)
    cfg.agent.estimation.num_mini_batches = parts
    seen = _watch_labels(monkeypatch)
    MuteRunner("go1_mute", cfg, None).train()  # the first rollout only waits
    assert [labels.base_lin_vel.shape[1] for labels in seen] == sizes


def test_what_is_learnt_from_does_not_change_with_the_storage():
    trainer, storage = _make_trainer(), _make_rollout(0, set())
    trainer.update(storage, trainer.estimator.initial_state(NUM_ENVS))
    remembered = {k: v.clone() for k, v in trainer.state_dict()["past"].items()}
    storage.observations["policy"].fill_(7.0)
    storage.observations["privileged"].fill_(7.0)
    storage.dones.fill_(1)
    for name, value in trainer.state_dict()["past"].items():
        assert torch.equal(value, remembered[name]), name


def test_repeated_updates_bring_the_loss_down():
    trainer = _make_trainer(learning_rate=0.05)
    totals = []
    for _ in range(60):
        state = trainer.estimator.initial_state(NUM_ENVS)
        losses = trainer.update(_make_rollout(0, set()), state)
        totals.append(losses.get("estimator_estimation", math.inf))
    assert totals[-1] < 0.5 * totals[1]


def test_every_loss_and_error_is_reported_by_name():
    trainer = _make_trainer()
    state = trainer.estimator.initial_state(NUM_ENVS)
    trainer.update(_make_rollout(0, set()), state)
    losses = trainer.update(_make_rollout(1, set()), state)
    assert set(losses) == {
        f"estimator_{name}"
        for name in (
            "total",
            "estimation",
            "forward",
            "phase",
            "velocity_rmse",
            "height_rmse",
            "phase_mae",
            "phase_closed",
        )
    }
    assert all(math.isfinite(value) for value in losses.values())


def test_a_trainer_goes_on_bit_for_bit_from_its_state():
    one, other = _make_trainer(), _make_trainer()
    state = one.estimator.initial_state(NUM_ENVS)
    for index in range(3):
        one.update(_make_rollout(index, {(25, 1)}), state)
    other.estimator.load_state_dict(one.estimator.state_dict())
    other.load_state_dict(copy.deepcopy(one.state_dict()))
    for trainer in (one, other):
        torch.manual_seed(1)
        for index in range(3, 5):
            trainer.update(_make_rollout(index, set()), state)
    assert all(map(torch.equal, one.estimator.parameters(), other.estimator.parameters()))
