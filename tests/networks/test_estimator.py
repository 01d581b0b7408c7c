"""Tests of the estimator's network on tiny sizes."""

from __future__ import annotations

import math

import pytest
import torch
from quick_products import use_bfloat16

from mute.networks import Estimator, EstimatorCfg

OBS_DIM, NUM_HEIGHTS, NUM_ENVS, NUM_STEPS = 5, 6, 3, 7


def _make_estimator(seed=0):
    torch.manual_seed(seed)
    cfg = EstimatorCfg(lstm_hidden=8, latent_dim=4, decoder_hidden=(8,), phase_hidden=(8,))
    return Estimator(OBS_DIM, NUM_HEIGHTS, cfg, height_offset=0.25, height_scale=0.5)


def _made(module: torch.nn.Module | None) -> torch.nn.Module:
    """Return a head that an estimator need not have."""
    assert module is not None
    return module


def _make_sequence(seed=1):
    generator = torch.Generator().manual_seed(seed)
    obs = torch.randn((NUM_STEPS, NUM_ENVS, OBS_DIM), generator=generator)
    hidden, cell = torch.randn((2, NUM_ENVS, 8), generator=generator)
    return obs, (hidden, cell), torch.zeros((NUM_STEPS, NUM_ENVS), dtype=torch.bool)


def test_one_step_of_a_tiny_network_is_the_hand_computed_one():
    estimator = Estimator(1, 1, EstimatorCfg(lstm_hidden=1, latent_dim=1), num_feet=1)
    with torch.no_grad():
        estimator.lstm.weight_ih.copy_(torch.tensor([[0.1], [0.2], [0.3], [0.4]]))
        estimator.lstm.weight_hh.copy_(torch.tensor([[0.5], [0.6], [0.7], [0.8]]))
        estimator.lstm.bias_ih.copy_(torch.tensor([0.01, 0.02, 0.03, 0.04]))
        estimator.lstm.bias_hh.copy_(torch.tensor([0.1, 0.2, 0.3, 0.4]))
    state = (torch.tensor([[0.5]]), torch.tensor([[-1.0]]))
    _, (hidden, cell) = estimator.step(torch.tensor([[2.0]]), state)

    def sigmoid(x):
        return 1 / (1 + math.exp(-x))

    # Gates i, f, g, o: weight_ih * 2 + weight_hh * 0.5 + both biases.
    expected_cell = sigmoid(0.92) * -1.0 + sigmoid(0.56) * math.tanh(1.28)
    assert cell.item() == pytest.approx(expected_cell, abs=1e-6)
    assert hidden.item() == pytest.approx(sigmoid(1.64) * math.tanh(expected_cell), abs=1e-6)


def test_an_estimate_is_what_each_head_says_of_the_hidden_state():
    estimator = _make_estimator()
    with torch.no_grad():
        estimator.latent_log_var_head.bias.copy_(torch.tensor([-30.0, 0.0, 0.1, 30.0]))
    obs, state, _ = _make_sequence()
    estimate, (hidden, _) = estimator.step(obs[0], state)
    heights, velocity = _made(estimator.heights_head)(hidden), estimator.base_lin_vel_head(hidden)
    mean = estimator.latent_mean_head(hidden)
    phase = _made(estimator.phase_network)(torch.cat((heights, velocity, mean), dim=-1)).sigmoid()
    close = torch.testing.assert_close
    close(estimate.base_lin_vel, velocity)
    close(estimate.heights, 0.25 + 0.5 * heights)
    close(estimate.latent_mean, mean)
    close(estimate.latent, mean)
    close(estimate.latent_log_var, estimator.latent_log_var_head(hidden).clamp(-10.0, 5.0))
    assert estimate.latent_log_var[:, 0].tolist() == [-10.0] * NUM_ENVS
    assert estimate.latent_log_var[:, 3].tolist() == [5.0] * NUM_ENVS
    close(estimate.phase, phase)


def _check_that_unrolling_is_stepping() -> None:
    estimator = _make_estimator()
    obs, state, starts = _make_sequence()
    unrolled, last = estimator.unroll(obs, state, starts)
    for t in range(NUM_STEPS):
        estimate, state = estimator.step(obs[t], state)
        for stepped, sequence in zip(estimate, unrolled, strict=True):
            torch.testing.assert_close(stepped, sequence[t], atol=1e-6, rtol=0)
    torch.testing.assert_close(state, last, atol=1e-6, rtol=0)


def test_unrolling_a_sequence_agrees_with_stepping_through_it():
    _check_that_unrolling_is_stepping()


def test_an_environment_that_starts_forgets_what_came_before():
    estimator = _make_estimator()
    obs, state, starts = _make_sequence()
    starts[3, 1] = True
    estimate, last = estimator.unroll(obs, state, starts)
    fresh, fresh_last = estimator.unroll(
        obs[3:], estimator.initial_state(NUM_ENVS), torch.zeros_like(starts[3:])
    )
    torch.testing.assert_close(estimate.phase[3:, 1], fresh.phase[:, 1])
    torch.testing.assert_close(last[1][1], fresh_last[1][1])


def test_an_environment_that_starts_leaves_the_others_alone():
    estimator = _make_estimator()
    obs, state, starts = _make_sequence()
    undisturbed, _ = estimator.unroll(obs, state, starts)
    starts[3, 1] = True
    disturbed, _ = estimator.unroll(obs, state, starts)
    assert not torch.equal(disturbed.heights[3:, 1], undisturbed.heights[3:, 1])
    for ours, theirs in zip(disturbed, undisturbed, strict=True):
        torch.testing.assert_close(ours[:, [0, 2]], theirs[:, [0, 2]])


def test_a_state_that_is_not_finite_does_not_survive_a_start():
    estimator = _make_estimator()
    obs, state, starts = _make_sequence()
    state[0][1] = float("nan")
    state[1][1] = float("inf")
    starts[0, 1] = True
    estimate, _ = estimator.unroll(obs, state, starts)
    assert all(value.isfinite().all() for value in estimate)


def test_every_part_of_the_estimate_has_its_shape():
    estimate, (hidden, cell) = _make_estimator().unroll(*_make_sequence())
    assert [tuple(value.shape) for value in estimate] == [
        (NUM_STEPS, NUM_ENVS, size) for size in (3, NUM_HEIGHTS, 4, 4, 4, 4)
    ]
    assert hidden.shape == cell.shape == (NUM_ENVS, 8)


def test_the_decoder_turns_latents_into_observations():
    estimator = _make_estimator()
    estimate, _ = estimator.unroll(*_make_sequence())
    decoded = estimator.decode(estimate)
    assert decoded.shape == (NUM_STEPS, NUM_ENVS, OBS_DIM)
    elsewhere = estimate._replace(base_lin_vel=estimate.base_lin_vel + 1.0)
    assert torch.equal(estimator.decode(elsewhere), decoded)


def test_the_initial_state_is_zero():
    hidden, cell = _make_estimator().initial_state(2)
    assert torch.equal(hidden, torch.zeros(2, 8))
    assert torch.equal(cell, torch.zeros(2, 8))


def test_phase_and_log_variance_stay_in_range_for_enormous_weights():
    estimator = _make_estimator()
    with torch.no_grad():
        estimator.latent_log_var_head.weight.mul_(1e4)
        for parameter in _made(estimator.phase_network).parameters():
            parameter.mul_(1e4)
    estimate, _ = estimator.unroll(*_make_sequence())
    assert estimate.latent_log_var.min() == -10.0
    assert estimate.latent_log_var.max() == 5.0
    assert estimate.phase.min() >= 0.0
    assert estimate.phase.max() <= 1.0


def test_a_silent_height_head_says_the_offset_and_one_unit_is_the_scale():
    estimator = _make_estimator()
    with torch.no_grad():
        head = estimator.heights_head
        assert head is not None
        head.weight.zero_()
        head.bias.copy_(torch.tensor([0.0, 1.0, -1.0, 0.0, 0.0, 0.0]))
    obs, state, _ = _make_sequence()
    heights = estimator.step(obs[0], state)[0].heights[0]
    assert heights.tolist() == pytest.approx([0.25, 0.75, -0.25, 0.25, 0.25, 0.25])


def test_the_phase_network_reads_normalised_heights_then_velocity_then_latent():
    estimator = _make_estimator()
    obs, state, _ = _make_sequence()
    estimate, _ = estimator.step(obs[0], state)
    inputs = ((estimate.heights - 0.25) / 0.5, estimate.base_lin_vel, estimate.latent)
    expected = _made(estimator.phase_network)(torch.cat(inputs, dim=-1)).sigmoid()
    torch.testing.assert_close(estimate.phase, expected, atol=1e-5, rtol=0)


def test_acting_uses_the_mean_of_the_latent():
    obs, state, starts = _make_sequence()
    estimate, _ = _make_estimator().unroll(obs, state, starts)
    assert torch.equal(estimate.latent, estimate.latent_mean)


def test_a_sampled_latent_is_the_mean_plus_deviation_times_the_generators_noise():
    estimator = _make_estimator()
    obs, state, starts = _make_sequence()
    estimate, _ = estimator.unroll(obs, state, starts, True, torch.Generator().manual_seed(9))
    noise = torch.randn((NUM_STEPS, NUM_ENVS, 4), generator=torch.Generator().manual_seed(9))
    expected = estimate.latent_mean + (0.5 * estimate.latent_log_var).exp() * noise
    torch.testing.assert_close(estimate.latent, expected)


def test_samples_of_the_same_seed_are_equal_and_of_another_differ():
    estimator = _make_estimator()
    sequence = _make_sequence()
    phases = [
        estimator.unroll(*sequence, True, torch.Generator().manual_seed(seed))[0].phase
        for seed in (1, 1, 2)
    ]
    assert torch.equal(phases[0], phases[1])
    assert not torch.equal(phases[0], phases[2])


def test_a_loss_on_the_phase_reaches_the_encoder_and_the_heads_that_feed_it():
    estimator = _make_estimator()
    estimate, _ = estimator.unroll(*_make_sequence())
    estimate.phase.sum().backward()
    for module in (
        estimator.lstm,
        estimator.base_lin_vel_head,
        _made(estimator.heights_head),
        estimator.latent_mean_head,
    ):
        assert all(p.grad is not None and p.grad.abs().sum() > 0 for p in module.parameters())
    assert all(p.grad is None for p in estimator.decoder.parameters())


def test_a_reconstruction_of_a_sample_reaches_mean_and_variance_but_not_the_phase_network():
    estimator = _make_estimator()
    estimate, _ = estimator.unroll(*_make_sequence(), sample=True)
    estimator.decode(estimate).square().sum().backward()
    for head in (estimator.latent_mean_head, estimator.latent_log_var_head):
        assert head.weight.grad is not None
        assert head.weight.grad.abs().sum() > 0
    assert all(p.grad is None for p in _made(estimator.phase_network).parameters())
    assert all(p.grad is None for p in estimator.base_lin_vel_head.parameters())


def test_no_gradient_crosses_the_start_of_an_episode():
    estimator = _make_estimator()
    obs, state, starts = _make_sequence()
    starts[3, 1] = True
    obs.requires_grad_()
    estimate, _ = estimator.unroll(obs, state, starts)
    estimate.base_lin_vel[-1].sum().backward()
    assert obs.grad is not None
    assert (obs.grad[:3, 1] == 0).all()
    assert (obs.grad[:3, 0] != 0).any()


def test_a_step_changes_neither_the_observation_nor_the_state_it_was_given():
    obs, state, _ = _make_sequence()
    copies = (obs.clone(), state[0].clone(), state[1].clone())
    _make_estimator().step(obs[0], state)
    assert all(torch.equal(a, b) for a, b in zip((obs, *state), copies, strict=True))


def test_a_sequence_and_all_its_gradients_are_those_of_torchs_lstm():
    estimator = _make_estimator()
    obs, (hidden, cell), starts = _make_sequence()
    for leaf in (obs, hidden, cell):
        leaf.requires_grad_()
    lstm = torch.nn.LSTM(OBS_DIM, 8)
    lstm.load_state_dict({f"{k}_l0": v for k, v in estimator.lstm.state_dict().items()})
    estimate, (last, last_cell) = estimator.unroll(obs, (hidden, cell), starts)
    hiddens, (_, expected_cell) = lstm(obs, (hidden[None], cell[None]))
    expected = estimator.base_lin_vel_head(hiddens)
    torch.testing.assert_close(estimate.base_lin_vel, expected)
    torch.testing.assert_close((last, last_cell), (hiddens[-1], expected_cell[0]))
    inputs = [[obs, hidden, cell, *module.parameters()] for module in (estimator.lstm, lstm)]
    torch.testing.assert_close(
        torch.autograd.grad(estimate.base_lin_vel.square().sum(), inputs[0]),
        torch.autograd.grad(expected.square().sum(), inputs[1]),
    )


def test_a_sequence_of_no_robots_is_empty():
    obs, (hidden, cell), starts = _make_sequence()
    state = (hidden[:0], cell[:0])
    estimate, last = _make_estimator().unroll(obs[:, :0], state, starts[:, :0])
    assert estimate.phase.shape == (NUM_STEPS, 0, 4)
    assert last[0].shape == last[1].shape == (0, 8)


def test_starts_of_another_shape_are_refused():
    obs, state, starts = _make_sequence()
    with pytest.raises(ValueError, match="starts"):
        _make_estimator().unroll(obs, state, starts[:-1])


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("lstm_hidden", 0),
        ("decoder_hidden", (64, 0)),
        ("activation", "sine"),
    ],
)
def test_a_configuration_that_cannot_be_is_refused_by_name(field, value):
    with pytest.raises(ValueError, match=field):
        EstimatorCfg(**{field: value})


def test_in_bfloat16_the_state_stays_float32_and_all_is_as_before_within_its_rounding(monkeypatch):
    estimator = _make_estimator()
    obs, state, starts = _make_sequence()
    starts[3, 1] = True
    results = []
    for prepare in (lambda _: None, use_bfloat16):
        prepare(monkeypatch)
        estimate, last = estimator.unroll(obs, state, starts)
        loss = estimate.base_lin_vel.square().mean() + estimate.phase.square().mean()
        weights = [estimator.lstm.weight_ih, estimator.lstm.weight_hh, estimator.lstm.bias_ih]
        results.append(([*estimate, *last], torch.autograd.grad(loss, weights)))
    (exact, exact_gradients), (rounded, rounded_gradients) = results
    assert all(value.dtype == torch.float32 for value in rounded)
    assert not torch.equal(exact[0], rounded[0])
    # Gates are off by 2^-9 at most, and forget what they were off by.
    for one, other in zip(exact, rounded, strict=True):
        torch.testing.assert_close(one, other, rtol=0.0, atol=0.02)
    for one, other in zip(exact_gradients, rounded_gradients, strict=True):
        assert (one - other).norm() < 0.02 * one.norm()


def test_in_bfloat16_unrolling_a_sequence_agrees_with_stepping_through_it(monkeypatch):
    use_bfloat16(monkeypatch)
    _check_that_unrolling_is_stepping()
