"""What encoders remember, and what they forget; an LSTM's is tested with the estimator."""

from __future__ import annotations

import pytest
import torch

from mute.networks.encoders import HistoryEncoder, forgotten
from mute.networks.estimator import Estimator, EstimatorCfg
from mute.networks.reflection import Reflection

OBS_DIM, LENGTH, NUM_ENVS, NUM_STEPS = 3, 4, 2, 9


class _Window(torch.nn.Module):
    """Stands in for the layers: the features are the window."""

    def forward(self, window: torch.Tensor) -> torch.Tensor:
        return window


def _make_encoder(window: bool = False) -> HistoryEncoder:
    torch.manual_seed(0)
    encoder = HistoryEncoder(OBS_DIM, LENGTH, (8, 6), "elu")
    if window:
        encoder.layers = _Window()  # pyright: ignore[reportAttributeAccessIssue]
    return encoder


def _make_sequence() -> tuple[torch.Tensor, torch.Tensor]:
    torch.manual_seed(1)
    obs = torch.randn(NUM_STEPS, NUM_ENVS, OBS_DIM)
    return obs, torch.randn(NUM_ENVS, (LENGTH - 1) * OBS_DIM)


def test_a_window_holds_the_newest_observation_first_and_then_those_before():
    encoder, (obs, _) = _make_encoder(window=True), _make_sequence()
    state = (torch.zeros(NUM_ENVS, (LENGTH - 1) * OBS_DIM),)
    for t in range(NUM_STEPS):
        window, state = encoder.step(obs[t], state)
        for lag, seen in enumerate(window.split(OBS_DIM, dim=1)):
            expected = obs[t - lag] if t >= lag else torch.zeros(NUM_ENVS, OBS_DIM)
            assert torch.equal(seen, expected), (t, lag)


@pytest.mark.parametrize("starts_at", [(), (0,), (4,), (3, 5), (8,)])
def test_unrolling_agrees_with_stepping_whenever_episodes_begin(starts_at: tuple[int, ...]):
    encoder, (obs, history) = _make_encoder(), _make_sequence()
    starts = torch.zeros(NUM_STEPS, NUM_ENVS, dtype=torch.bool)
    starts[list(starts_at), 1] = True
    unrolled, (last,) = encoder.unroll(obs, (history,), starts)
    state = (history,)
    for t in range(NUM_STEPS):
        features, state = encoder.step(obs[t], forgotten(state, starts[t]))
        torch.testing.assert_close(features, unrolled[t])
    assert torch.equal(state[0], last)


def test_a_sequence_shorter_than_the_history_leaves_the_rest_of_it_standing():
    encoder, (obs, history) = _make_encoder(window=True), _make_sequence()
    no_starts = torch.zeros(2, NUM_ENVS, dtype=torch.bool)
    windows, (last,) = encoder.unroll(obs[:2], (history,), no_starts)
    expected = torch.cat((obs[1], obs[0], history[:, : 2 * OBS_DIM]), dim=1)
    assert torch.equal(windows[1], expected)
    assert torch.equal(last, expected[:, : 3 * OBS_DIM])


def test_what_is_not_finite_is_forgotten_too():
    state = (torch.tensor([[float("nan"), 1.0], [2.0, float("inf")], [3.0, 4.0]]),)
    (left,) = forgotten(state, torch.tensor([True, True, False]))
    assert left.tolist() == [[0.0, 0.0], [0.0, 0.0], [3.0, 4.0]]


def test_a_history_of_one_observation_remembers_nothing():
    encoder = HistoryEncoder(OBS_DIM, 1, (4,), "elu")
    obs, _ = _make_sequence()
    features, (state,) = encoder.step(obs[0], (torch.zeros(NUM_ENVS, 0),))
    assert features.shape == (NUM_ENVS, 4)
    assert state.shape == (NUM_ENVS, 0)


def test_dreamwaqs_estimator_commutes_with_a_mirror_once_it_is_tied():
    torch.manual_seed(2)
    cfg = EstimatorCfg(
        encoder="history",
        history_hidden=(8, 6),
        latent_dim=4,
        decoder_hidden=(8,),
        heights=False,
        phase=False,
        decodes_velocity=True,
    )
    estimator = Estimator(OBS_DIM, 7, cfg)
    mirror = Reflection((0, 2, 1), (-1.0, 1.0, 1.0))
    latent = Reflection.swapped(4)
    estimator.tie(mirror, mirror, Reflection.unchanged(7), Reflection.unchanged(4))
    obs, _ = _make_sequence()
    starts = torch.zeros(NUM_STEPS, NUM_ENVS, dtype=torch.bool)
    state = estimator.initial_state(NUM_ENVS)
    estimate, _ = estimator.unroll(obs, state, starts)
    image, _ = estimator.unroll(mirror(obs), state, starts)
    close = torch.testing.assert_close
    close(mirror(estimate.base_lin_vel), image.base_lin_vel)
    close(latent(estimate.latent), image.latent)
    close(mirror(estimator.decode(estimate)), estimator.decode(image))
    assert estimate.heights.shape == estimate.phase.shape == (NUM_STEPS, NUM_ENVS, 0)
    assert estimate.base_lin_vel.std() > 0.01


def test_the_decoder_may_see_the_velocity():
    cfg = EstimatorCfg(decodes_velocity=True, latent_dim=4)
    estimator = Estimator(OBS_DIM, 2, cfg)
    obs, _ = _make_sequence()
    estimate, _ = estimator.step(obs[0], estimator.initial_state(NUM_ENVS))
    faster = estimate._replace(base_lin_vel=estimate.base_lin_vel + 1.0)
    assert not torch.equal(estimator.decode(estimate), estimator.decode(faster))


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("history_length", 0, r"network.history_length must be"),
        ("history_hidden", (), r"network.history_hidden must be one width at least, got \(\)"),
        ("encoder", "gru", r"network.encoder must be one of \['lstm', 'history'\], got 'gru'"),
    ],
)
def test_a_bad_size_or_name_is_named(field: str, value: object, message: str):
    with pytest.raises(ValueError, match=message):
        EstimatorCfg(**{field: value})  # pyright: ignore[reportArgumentType]
